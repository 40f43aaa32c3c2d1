"""Fit what shares out a text's matters among the parts, on sentences whose words are marked.

Each weight in turn is moved up and down as long as that makes the chances of what each part is
given likelier, over the parts in the file's order and over them shuffled: half of the files of the
sets would otherwise teach that every file has the order of its text.
"""

from __future__ import annotations

import argparse
import json
import math
import random
from pathlib import Path

from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text import tagger
from autophyx_tet.predictors.text.reader import read_sentence
from autophyx_tet.research.training.tagger.templates import DATA
from sentences import SETS, _read

FITTED = [name for name in SETS if name.startswith(("sixteenth", "seventeenth"))]
WORTH = 0.3  # of the logarithm of the likelihood: what a step must bring


def marked(names):
    """Texts of sets as the readers have them, with the marked places of each part's matter."""
    table, found = load_table(), []
    marks = json.loads((DATA / "spans.json").read_text(encoding="utf-8"))
    dice = random.Random(0)
    for name in names:
        for sentence in _read(name)["sentence"]:
            if sentence["id"] not in marks.get(name, {}) or len(sentence["parts"]) < 2:
                continue
            _, skip, spans = marks[name][sentence["id"]]
            order = [*range(len(sentence["parts"]))]
            for shuffled in (False, True):
                if shuffled:
                    dice.shuffle(order)
                parts = [[*sentence["parts"]][i] for i in order]
                wanted = [
                    None
                    if i in skip
                    else [(a, b) for a, b, of, r in spans if i in of and r in (1, 2)]
                    for i in order
                ]
                bound = read_sentence(sentence["text"], [[p] for p in parts], table)
                if bound.sentence.text != sentence["text"]:
                    continue  # a table: the marks are at other places
                said = tagger.load_tagger().said(parts, sentence["text"], bound.sentence.gloss)
                found.append((said, bound, tagger.without_prefix(parts), wanted))
    return found


def likelihood(texts):
    """Logarithm of the likelihood of what is right, and how many parts and texts are."""
    total, parts, whole = 0.0, 0, 0
    for said, bound, names, wanted in texts:
        found, chances = tagger.chances_of(said, bound, names)
        right = []
        for likely, marks in zip(chances, wanted, strict=True):
            if marks is None:
                continue
            met = [any(a < s.end and s.start < b for a, b in marks) for s in found]
            met.append(not marks)
            right.append(met[likely.argmax()])
            total += math.log(max(likely[met].sum(), 1e-3)) if any(met) else 0.0
        parts, whole = parts + sum(right), whole + all(right)
    return total, parts, whole


def main():
    """Fit and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--sets", nargs="+", choices=SETS, default=FITTED)
    parser.add_argument("-o", "--output", type=Path, default=tagger.SHARING)
    parser.add_argument("--rounds", type=int, default=2)
    options = parser.parse_args()
    texts = marked(options.sets)
    weights = dict(tagger.load_sharing())
    tagger.load_sharing = lambda: weights
    best = likelihood(texts)
    print(len(texts), "texts:", best, flush=True)
    for k in range(options.rounds):
        for name in weights:
            for step in (0.4 / 2**k, -0.4 / 2**k):
                while True:
                    weights[name] += step
                    new = likelihood(texts)
                    if new[0] < best[0] + WORTH:
                        weights[name] -= step
                        break
                    best = new
            print(name, round(weights[name], 2), best, flush=True)
    rounded = {name: round(value, 2) for name, value in weights.items()}
    options.output.write_text(json.dumps(rounded, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

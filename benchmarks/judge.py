"""Fit the judge of readings on sets of sentences: which reading of a part is right, and how often.

Every sentence is read three times, each time with one reader's readings alone, and looked up in the
table as by the command; a small network from the facts about each part to whether its values are
right is the judge.
``--folds`` prints what the judge does to sentences that it was not fitted on.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
import torch
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.resolve import Lookup
from autophyx_tet.predictors.text import tagger as judge
from autophyx_tet.predictors.text.reader import read_sentence
from sentences import SETS, _read, allows, bands_of, is_right
from torch import nn
from torch.nn import functional

FITTED = SETS[SETS.index("sixteenth_engineers") :]
HIDDEN, LEFT_OUT, RATE, DECAY = 32, 0.2, 3e-3, 0.1
EPOCHS, BATCH = 30, 256
SHARES = 4  # of a set, read side by side


class Forced:
    """Takes one reader's readings wherever there are any, and doubts nothing."""

    doubted, plain = -1.0, 2.0

    def __init__(self, reader: str) -> None:
        self.reader = reader

    def chance(self, reader: str, facts: Mapping[str, float]) -> float:
        """The largest for the reader that is forced, then for the grammar."""
        return {self.reader: 1.0, "grammar": 0.5}.get(reader, 0.0)


def parts_of(names: Sequence[str]) -> list[dict[str, Any]]:
    """For each part of the sets its facts, and by reader whether its values are right."""
    jobs = [(name, k) for name in names for k in range(SHARES)]
    with Pool() as pool:
        return [part for found in pool.map(_of_share, jobs, chunksize=1) for part in found]


def _of_share(job: tuple[str, int]) -> list[dict[str, Any]]:
    """The parts of some of a set's sentences."""
    (name, share), found = job, list[dict[str, Any]]()
    table, bands = load_table(), bands_of(name)
    lookup, every, load = Lookup(table=table), judge.readings_of, judge.load_judge
    seen: dict[int, tuple[list[judge.Reading], dict[str, float]]] = {}

    def recorded(i, *rest):
        seen[i] = every(i, *rest)
        return seen[i]

    judge.readings_of = recorded
    for sentence in _read(name)["sentence"][share::SHARES]:
        wanted, parts = sentence["parts"], [*sentence["parts"]]
        if len(parts) == 1:
            continue
        labels = [[part] for part in parts]
        bound = read_sentence(sentence["text"], labels, table)
        text, gloss = bound.sentence.text, bound.sentence.gloss
        said = judge.load_tagger().said(parts, text, gloss)
        said = judge.shared_out(said, bound, judge.without_prefix(parts))
        right: dict[str, dict[str, bool]] = {part: {} for part in parts}
        seen.clear()
        for reader in judge.READERS:
            judge.load_judge = lambda reader=reader: Forced(reader)
            heard = judge.with_second_opinion(bound, labels, table, said)
            choices = lookup.settle(labels, heard, volumes=[1e-3] * len(parts)).choices
            values = {p: c.value._asdict() for p, c in zip(parts, choices, strict=True)}
            for part in parts:
                right[part][reader] = is_right(wanted[part], values[part], values, bands, False)
        for i, (readings, facts) in sorted(seen.items()):
            found.append(
                {
                    "set": name, "sentence": sentence["id"], "part": parts[i], "facts": facts,
                    "right": {r.reader: bool(right[parts[i]][r.reader]) for r in readings},
                    "aside": bool(sentence.get("must_warn"))
                    or any(allows(sentence, each) for each in wanted.values()),
                }
            )  # fmt: skip
    judge.readings_of, judge.load_judge = every, load
    return found


def fitted(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Facts, weights of a hidden layer (HIDDEN, facts + 1) and of the readers (3, HIDDEN + 1)."""
    names = list(parts[0]["facts"])
    x = torch.tensor([[part["facts"][name] for name in names] for part in parts])
    scale = x.abs().amax(dim=0).clamp(min=1e-9)
    there = torch.tensor([[float(r in part["right"]) for r in judge.READERS] for part in parts])
    right = [[float(part["right"].get(r, False)) for r in judge.READERS] for part in parts]
    y, x = torch.tensor(right), x / scale
    torch.manual_seed(0)
    hidden, out = nn.Linear(len(names), HIDDEN), nn.Linear(HIDDEN, len(judge.READERS))
    network = nn.Sequential(hidden, nn.ReLU(), nn.Dropout(LEFT_OUT), out)
    adam = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
    for epoch in range(EPOCHS):
        adam.param_groups[0]["lr"] = RATE * (1 - epoch / EPOCHS)
        for some in torch.randperm(len(x)).split(BATCH):
            loss = functional.binary_cross_entropy_with_logits(
                network(x[some]), y[some], weight=there[some], reduction="sum"
            )
            adam.zero_grad()
            (loss / len(some)).backward()
            adam.step()

    def told(layer: nn.Linear, scale: torch.Tensor) -> list[list[float]]:
        rows = torch.cat([layer.weight / scale, layer.bias[:, None]], dim=1).tolist()
        return [[float(f"{w:.4g}") for w in row] for row in rows]

    return {"facts": names, "hidden": told(hidden, scale), "out": told(out, torch.ones(()))}


def judged(
    parts: Sequence[Mapping[str, Any]], weights: Mapping[str, Any]
) -> list[tuple[float, bool]]:
    """Chance of the reading that is taken of each part, and whether it is right."""
    taken, out = judge.Judge({"doubted": 0.0, "plain": 1.0} | dict(weights)), []
    for part in parts:
        chances = {r: taken.chance(r, part["facts"]) for r in part["right"]}
        best = max(chances, key=chances.__getitem__)
        out.append((chances[best], part["right"][best]))
    return out


def line_of(parts: Sequence[Mapping[str, Any]], found: Sequence[tuple[float, bool]]) -> str:
    """Sentences and parts right, and what doubts below some chances would tell."""
    ids = {part["sentence"] for part in parts}
    wrong = {p["sentence"] for p, (_, right) in zip(parts, found, strict=True) if not right}
    line = f"{len(ids) - len(wrong)} of {len(ids)} sentences, "
    line += f"{sum(right for _, right in found)} of {len(found)} parts; "
    for at in (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9):
        silent = sum(not right and chance > at for chance, right in found)
        needless = sum(right and chance <= at for chance, right in found)
        line += f" {at}: silent {silent}, needless {needless};"
    return line


def main() -> None:
    """Fit and write; print what folds say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--sets", nargs="+", choices=SETS, default=FITTED)
    parser.add_argument("-o", "--output", type=Path, default=judge.JUDGE)
    parser.add_argument("--doubted", type=float, default=0.8)
    parser.add_argument("--plain", type=float, default=0.9)
    parser.add_argument("--parts", type=Path, help="keep, or take, the parts' facts in this file")
    parser.add_argument("--folds", type=int, default=10)
    options = parser.parse_args()
    if options.parts and options.parts.exists():
        parts = json.loads(options.parts.read_text())
    else:
        parts = parts_of(options.sets)
        if options.parts:
            options.parts.write_text(json.dumps(parts))
    ids = sorted({part["sentence"] for part in parts})
    fold = {
        name: k % options.folds for k, name in enumerate(np.random.default_rng(0).permutation(ids))
    }
    out: dict[int, tuple[float, bool]] = {}
    for k in range(options.folds):
        weights = fitted([part for part in parts if fold[part["sentence"]] != k])
        own = [i for i, part in enumerate(parts) if fold[part["sentence"]] == k]
        out |= dict(zip(own, judged([parts[i] for i in own], weights), strict=True))
    for name in dict.fromkeys(part["set"] for part in parts):
        own = [i for i, part in enumerate(parts) if part["set"] == name]
        print(name, line_of([parts[i] for i in own], [out[i] for i in own]))
    print("all", line_of(parts, [out[i] for i in range(len(parts))]))
    for reader in judge.READERS:
        alone = [(1.0, part["right"].get(reader, False)) for part in parts]
        print(reader, "alone", line_of(parts, alone)[:60])
    print("any", line_of(parts, [(1.0, any(part["right"].values())) for part in parts])[:60])
    data = {"doubted": options.doubted, "plain": options.plain} | fitted(parts)
    lines = ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in data.items())
    options.output.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


if __name__ == "__main__":
    main()

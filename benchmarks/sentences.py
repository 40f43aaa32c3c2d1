"""How many sentences are understood: parts right, and parts wrong without a word of warning.

``python benchmarks/sentences.py`` scores a corpus of sentences, each with the parts of an asset and
what an engineer expects of them, as a user meets the product: a mesh of named parts, the sentence,
``assign``. The corpus has two halves; one served to build the reader, of the other only the figures
were looked at (``--half held_out``). Each later set (``--half second``) was written
before the reader was run on it, and then served to mend it. The files say how they were written.

A part is right where E and rho lie in the band of the material that was said, where stated numbers
come out exactly, where a relation between parts holds, or where nothing can be known and a warning
names the part. It is *silently wrong* where it is wrong and no warning names it.
"""

from __future__ import annotations

import argparse
import json
import logging
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import autophyx_tet as apx
import numpy as np
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.mesh import TetMesh
from autophyx_tet.toolkit.options import AssignOptions

CORPUS = Path(__file__).resolve().parent / "data"
HALVES = ("building", "held_out")
# Written later, in this order; each knows the bands of those before.
SETS = ("second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth")
EXACT = 1e-6  # stated numbers come out as stated: nothing but round-off between
NOTHING_KNOWN = ("unknown", "open")


@dataclass(frozen=True)
class PartScore:
    """One part of one sentence: whether it is right, and whether a warning names it."""

    kind: str
    style: str
    sentence: str
    part: str
    right: bool
    warned: bool
    found: str
    wanted: str


def parts_mesh(names: tuple[str, ...]) -> TetMesh:
    """Boxes of 0.1 m in a row that do not touch, one a name."""
    boxes = [box_mesh((0.1, 0.1, 0.1), (1, 1, 1), lo=(0.2 * i, 0, 0)) for i in range(len(names))]
    count = len(boxes[0].points)
    return TetMesh(
        np.concatenate([box.points for box in boxes]),
        np.concatenate([box.tets + count * i for i, box in enumerate(boxes)]),
        region=np.repeat(np.arange(len(boxes)), len(boxes[0].tets)),
        region_names=names,
    )


def score_sentence(
    sentence: Mapping[str, Any], bands: Mapping[str, Any], predictor: str
) -> list[PartScore]:
    """Scores of the parts of one sentence."""
    names = tuple(sentence["parts"])
    options = AssignOptions(predictor=predictor, cells=8 * len(names))
    result = apx.assign(parts_mesh(names), sentence["text"], options=options)
    values = {choice.part: choice.value._asdict() for choice in result.choices}
    materials = {choice.part: choice.material for choice in result.choices}
    scores = []
    for name, wanted in sentence["parts"].items():
        warned = any(repr(name) in warning for warning in result.warnings)
        right = is_right(wanted, values[name], values, bands, warned)
        if sentence.get("or_warn") and warned:
            right = True
        value = "E={E:.3g} nu={nu:.3g} rho={rho:.4g}".format(**values[name])
        found = f"{materials[name]} {value}"
        scores.append(
            PartScore(
                sentence["kind"], sentence["style"], sentence["id"], name, right, warned,
                found, str(wanted),
            )
        )  # fmt: skip
    if sentence.get("must_warn") and not result.warnings:
        scores = [PartScore(**{**vars(score), "right": False}) for score in scores]
    return scores


def is_right(
    wanted: str | Mapping[str, Any],
    value: Mapping[str, float],
    values: Mapping[str, Mapping[str, float]],
    bands: Mapping[str, Any],
    warned: bool,
) -> bool:
    """Whether a part's ``value`` is what was ``wanted``: a band, numbers, a relation, a warning."""
    if wanted in NOTHING_KNOWN:
        return warned
    if isinstance(wanted, str):
        wanted = {"band": wanted}
    stated = {name: wanted[name] for name in ("E", "nu", "rho") if name in wanted}
    for name, number in stated.items():
        if abs(value[name] / number - 1) > EXACT:
            return False
    band = bands[wanted["band"]] if "band" in wanted else {}
    for name in {"E", "nu", "rho"} & set(band) - set(stated):
        low, high = band[name]
        if not low <= value[name] <= high:
            return False
    factor = wanted.get("E_factor", 1.0)
    if "less_than" in wanted and value["E"] * factor > values[wanted["less_than"]]["E"]:
        return False
    return not (
        "greater_than" in wanted and value["E"] < factor * values[wanted["greater_than"]]["E"]
    )


def score_half(half: str, predictor: str) -> Iterator[PartScore]:
    """Scores of all parts of all sentences of a half."""
    corpus = _read(half)
    before = ("building", *SETS[: SETS.index(half)]) if half in SETS else ()
    bands = {k: v for name in (*before, half) for k, v in _read(name)["band"].items()}
    for sentence in corpus["sentence"]:
        yield from score_sentence(sentence, bands, predictor)


def _read(half: str) -> dict[str, Any]:
    return tomllib.loads((CORPUS / f"sentences_{half}.toml").read_text(encoding="utf-8"))


def table(scores: list[PartScore], key: str) -> list[dict[str, Any]]:
    """One row a value of ``key``, and one of all: sentences and parts right, silent wrong parts."""
    groups = {name: [s for s in scores if getattr(s, key) == name] for name in
              sorted({getattr(s, key) for s in scores})}  # fmt: skip
    return [row(name, group) for name, group in {**groups, "all": scores}.items()]


def row(name: str, scores: list[PartScore]) -> dict[str, Any]:
    """Counts of one group."""
    wrong = Counter(score.sentence for score in scores if not score.right)
    sentences = {score.sentence for score in scores}
    silent = sum(not score.right and not score.warned for score in scores)
    return {
        "kind": name,
        "sentences": len(sentences),
        "sentences_right": len(sentences) - len(wrong),
        "parts": len(scores),
        "parts_right": sum(score.right for score in scores),
        "silent_wrong": silent,
    }


def main() -> None:
    """Print the table of a half, or of both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--half", choices=(*HALVES, *SETS), help="default: both halves")
    parser.add_argument("--predictor", default="retrieval", help="what guesses where words do not")
    parser.add_argument("--wrong", action="store_true", help="list what is wrong (not of held_out)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    for half in (options.half,) if options.half else HALVES:
        scores = list(score_half(half, options.predictor))
        rows = table(scores, "kind")
        print(json.dumps({"half": half, "rows": rows}) if options.json else text_of(half, rows))
        if options.wrong and half != "held_out":
            for score in scores:
                if not score.right:
                    print(score)


def text_of(half: str, rows: list[dict[str, Any]]) -> str:
    """The table as text."""
    lines = [f"{half}: {'kind':<12}{'sentences right':>18}{'parts right':>16}{'silent wrong':>15}"]
    for r in rows:
        share = f"{r['sentences_right']} of {r['sentences']}"
        parts = f"{r['parts_right']} of {r['parts']}"
        silent = f"{r['silent_wrong']} ({r['silent_wrong'] / r['parts']:.1%})"
        lines.append(f"{'':10}{r['kind']:<12}{share:>18}{parts:>16}{silent:>15}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()

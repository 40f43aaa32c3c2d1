"""Fit the judge of readings on sets of sentences: which reading of a part is right, and how often.

Every sentence goes through the command three times, each time with one reader's readings alone;
logistic regressions from the facts about each part to whether its values are right are the judge.
``--folds`` prints what the judge does to sentences that it was not fitted on.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from autophyx_tet.predictors.text import tagger as judge
from scipy.optimize import minimize
from sentences import SETS, _read, allows, assigned, is_right

FITTED = SETS[SETS.index("sixteenth_engineers") :]
RIDGE = 3.0  # penalty of the squares of the weights


class Forced:
    """Takes one reader's readings wherever there are any, and doubts nothing."""

    doubted, plain = -1.0, 2.0

    def __init__(self, reader: str) -> None:
        self.reader = reader

    def chance(self, reader: str, facts: Mapping[str, float]) -> float:
        """The largest for the reader that is forced, then for the grammar."""
        return {self.reader: 1.0, "grammar": 0.5}.get(reader, 0.0)


def parts_of(names: Sequence[str], options: Sequence[str]) -> list[dict[str, Any]]:
    """For each part of the sets its facts, and by reader whether its values are right."""
    found: list[dict[str, Any]] = []
    every = judge.readings_of
    seen: dict[int, tuple[list[judge.Reading], dict[str, float]]] = {}

    def recorded(i, *rest):
        seen[i] = every(i, *rest)
        return seen[i]

    judge.readings_of = recorded
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            data = _read(name)
            for sentence in data["sentence"]:
                wanted, parts = sentence["parts"], tuple(sentence["parts"])
                right: dict[str, dict[str, bool]] = {part: {} for part in parts}
                seen.clear()
                for reader in judge.READERS:
                    judge.load_judge = lambda reader=reader: Forced(reader)
                    code, said = assigned(parts, sentence["text"], Path(folder), options)
                    values = {} if code else {row["name"]: row for row in said["parts"]}
                    for part in parts:
                        right[part][reader] = part in values and is_right(
                            wanted[part], values[part], values, data["band"], warned=False
                        )
                for i, part in enumerate(parts):
                    if i not in seen:  # one part alone
                        continue
                    readings, facts = seen[i]
                    found.append(
                        {
                            "set": name, "sentence": sentence["id"], "part": part, "facts": facts,
                            "right": {r.reader: right[part][r.reader] for r in readings},
                            "aside": bool(sentence.get("must_warn"))
                            or any(allows(sentence, each) for each in wanted.values()),
                        }
                    )  # fmt: skip
    judge.readings_of = every
    return found


def fitted(parts: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Weights by reader and fact."""
    weights = {}
    for reader in judge.READERS:
        own = [part for part in parts if reader in part["right"]]
        names = list(own[0]["facts"])
        x = np.array([[part["facts"][name] for name in names] for part in own])
        y = np.array([part["right"][reader] for part in own], float)
        scale = np.maximum(np.abs(x).max(axis=0), 1e-9)

        def loss(w, x=x / scale, y=y):
            z = x @ w
            return np.logaddexp(0, z).sum() - y @ z + RIDGE / 2 * (w @ w)

        def slope(w, x=x / scale, y=y):
            return x.T @ (1 / (1 + np.exp(-(x @ w))) - y) + RIDGE * w

        w = minimize(loss, np.zeros(len(names)), jac=slope, method="L-BFGS-B").x / scale
        weights[reader] = {n: round(float(v), 4) for n, v in zip(names, w, strict=True) if v}
    return weights


def judged(
    parts: Sequence[Mapping[str, Any]], weights: Mapping[str, Mapping[str, float]]
) -> list[tuple[float, bool]]:
    """Chance of the reading that is taken of each part, and whether it is right."""
    out = []
    for part in parts:
        z = {
            r: sum(weights[r].get(name, 0.0) * v for name, v in part["facts"].items())
            for r in part["right"]
        }
        best = max(z, key=z.get)
        out.append((1 / (1 + np.exp(-z[best])), part["right"][best]))
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
    parser.add_argument("--doubted", type=float, default=0.84)
    parser.add_argument("--plain", type=float, default=0.9)
    parser.add_argument("--parts", type=Path, help="keep, or take, the parts' facts in this file")
    parser.add_argument("--folds", type=int, default=10)
    options, others = parser.parse_known_args()
    if options.parts and options.parts.exists():
        parts = json.loads(options.parts.read_text())
    else:
        parts = parts_of(options.sets, others)
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
    data = {"doubted": options.doubted, "plain": options.plain, "weights": fitted(parts)}
    options.output.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

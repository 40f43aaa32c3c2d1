"""How sure the network may call itself: its shares against how often they are right.

Real objects of the validation source, names withheld, as in ``evaluate --split validation``. The
calibration is fitted on every second object; the curve is that of the others. ``--write`` ships the
calibration with the weights, and draws the curve for their card.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from autophyx_tet.predictors.film.predictor import SHIPPED
from autophyx_tet.research.evaluation.held_out import HeldOutSet
from autophyx_tet.research.evaluation.reliability import (
    Answer,
    answers,
    borne_out,
    curve,
    expected_error,
    fit,
)
from autophyx_tet.research.learning import with_furniture

BINS = 5  # of a fifth each: some hundred answers fill no more
PICTURE = Path(__file__).resolve().parents[1] / "docs" / "reliability.png"


def measured(given: Sequence[Answer]) -> dict[str, Any]:
    """The calibration of one half of the objects, and both curves of the other."""
    fitted, others = ([a for a in given if a.index % 2 == odd] for odd in (0, 1))
    calibration = fit(fitted)
    right = [answer.right for answer in others]
    raw = np.array([answer.share for answer in others])
    curves = {
        "share": curve(raw, right, bins=BINS),
        "calibrated": curve(np.array([calibration(s) for s in raw]), right, bins=BINS),
    }
    return {
        "slope": calibration.slope,
        "offset": calibration.offset,
        "answers": [len(fitted), len(others)],
        "right": float(np.mean(right)),
        "spans": borne_out(curves["calibrated"]),
        "curves": {name: [b._asdict() for b in bins] for name, bins in curves.items()},
        "expected_error": {name: expected_error(bins) for name, bins in curves.items()},
    }


def write(result: dict[str, Any]) -> None:
    """Ship the calibration, and draw the curve."""
    shipped = {name: result[name] for name in ("slope", "offset", "spans")}
    SHIPPED.write_text(json.dumps(shipped, indent=1) + "\n", encoding="utf-8")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(4.2, 4))
    axis.plot([0, 1], [0, 1], color="#999999", linewidth=1)
    for name, mark in (("share", "o--"), ("calibrated", "s-")):
        bins = result["curves"][name]
        said, right = [b["said"] for b in bins], [b["right"] for b in bins]
        error = [np.sqrt(b["right"] * (1 - b["right"]) / b["count"]) for b in bins]
        axis.errorbar(said, right, error, fmt=mark, capsize=3, label=name)
    axis.set(xlabel="said", ylabel="right", xlim=(0, 1), ylim=(0, 1.02))
    axis.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(PICTURE, dpi=110, metadata={"Software": None})
    plt.close(figure)


def main() -> None:
    """Print the calibration and both curves."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", type=int, default=80)
    parser.add_argument("--texts", type=int, default=5)
    parser.add_argument("--write", action="store_true", help="ship it, and draw the curve")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    held_out = HeldOutSet("validation", options.objects, texts=options.texts)
    result = measured(list(answers(with_furniture(held_out))))
    if options.write:
        write(result)
    print(json.dumps(result) if options.json else _text(result))


def _text(result: dict[str, Any]) -> str:
    lines = [f"slope {result['slope']:.3f}, offset {result['offset']:.3f}, "
             f"{result['answers'][1]} answers, {result['right']:.0%} right"]  # fmt: skip
    for name, bins in result["curves"].items():
        lines.append(f"{name}: expected calibration error {result['expected_error'][name]:.3f}")
        lines += [
            f"  {b['low']:.1f}-{b['high']:.1f} {b['count']:5d} said {b['said']:.2f} "
            f"right {b['right']:.2f}"
            for b in bins
        ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()

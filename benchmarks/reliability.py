"""How sure the network may call itself: its shares against how often they are right.

Real objects of the validation source, names withheld, as in ``evaluate --split validation``. The
calibration is fitted on every second object; the curve is that of the others.
"""

from __future__ import annotations

import argparse
import json

import numpy as np
from autophyx_tet.predictors.evaluation.held_out import HeldOutSet
from autophyx_tet.predictors.evaluation.reliability import answers, curve, expected_error, fit
from autophyx_tet.toolkit.learning import with_furniture


def main() -> None:
    """Print the calibration and both curves."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", type=int, default=80)
    parser.add_argument("--texts", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    held_out = HeldOutSet("validation", options.objects, texts=options.texts)
    given = list(answers(with_furniture(held_out)))
    fitted, others = ([a for a in given if a.index % 2 == odd] for odd in (0, 1))
    calibration = fit(fitted)
    right = [answer.right for answer in others]
    raw = np.array([answer.share for answer in others])
    curves = {
        "share": curve(raw, right),
        "calibrated": curve(np.array([calibration(share) for share in raw]), right),
    }
    result = {
        "slope": calibration.slope,
        "offset": calibration.offset,
        "answers": [len(fitted), len(others)],
        "right": float(np.mean(right)),
        "curves": {name: [b._asdict() for b in bins] for name, bins in curves.items()},
        "expected_error": {name: expected_error(bins) for name, bins in curves.items()},
    }
    print(json.dumps(result) if options.json else _text(result))


def _text(result: dict) -> str:
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

"""Errors against textbooks as a table: what the notebook `analytic_checks` computes and asserts.

python benchmarks/accuracy.py --json
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import runpy
import sys
from pathlib import Path

NOTEBOOK = Path(__file__).resolve().parent.parent / "notebooks" / "analytic_checks.py"
ELEMENTS = {1: "linear", 2: "quadratic"}


def rows() -> list[dict]:
    """Relative error of every body, kind of element and number of cells across its thickness."""
    os.environ["MPLBACKEND"] = "Agg"
    with contextlib.redirect_stdout(sys.stderr):
        found = runpy.run_path(str(NOTEBOOK))
    bar = {"body": "pulled bar", "elements": "linear", "cells_across": 1}
    table = [bar | {"relative_error": float(found["bar_error"])}]
    for order, name in ELEMENTS.items():
        errors = abs(1 - found["sunk"][order] / found["textbook"])
        for cells, error in zip(found["across"][order].tolist(), errors.tolist(), strict=True):
            row = {"body": "bent beam, tip", "elements": name, "cells_across": cells}
            table.append(row | {"relative_error": error})
    for order, name in ELEMENTS.items():
        half = found["edges"][order] // 2  # the wall is half of the sphere's radius
        for cells, error in zip(half.tolist(), found["sphere"][order].tolist(), strict=True):
            row = {"body": "hollow sphere", "elements": name, "cells_across": cells}
            table.append(row | {"relative_error": error})
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    found = rows()
    if parser.parse_args().json:
        print(json.dumps({"rows": found}, indent=1))
        return
    for row in found:
        print("{body}, {elements}, {cells_across} across: {relative_error:.2g}".format(**row))


if __name__ == "__main__":
    main()

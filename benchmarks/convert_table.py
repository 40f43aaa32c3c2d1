"""Rows of ``convert_corpus.py`` as tables: what converted, what did not and why, beside peers.

python benchmarks/convert_table.py --note "On 2 cores." cgal.jsonl sweethome3d.jsonl
"""

from __future__ import annotations

import argparse
import json
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path

import numpy as np

OURS = "autophyx-tet"
MOST_LOST = 0.05  # share of the file's volume: the limit of the guarantee
REASON = 200  # characters of a reason that a table shows
INTRODUCTION = """\
# Conversion of whole corpora

Every input and tool in a fresh process; made by `benchmarks/convert_table.py` from the rows of
`benchmarks/convert_corpus.py`. *All guarantees*: positive tets, every boundary edge on two faces,
sampled distances to the file as read within epsilon both ways, volume within what the envelope
allows, and at most 5 % of the volume that the file encloses left out. Where thin closed pieces are
more than that the warning names them; a lattice, for open pieces that surround a body and after a
time-out, promises volume and angles, no distance.
Exit 3 is unreadable input, exit 4 input without a volume, each with a sentence. The engine of
pytetwild gets the same envelope (half of epsilon), edge and stop energy as ours. Dihedral angle,
seconds and memory are medians over the inputs that a tool converted with all guarantees, ratios
medians over those that both made some mesh of.
"""
HEADINGS = {
    "inputs": "inputs",
    "guarantees": "all guarantees",
    "converted": "some mesh",
    "named": "thin parts left out by name",
    "lattices": "by a lattice",
    "clear_errors": "exit 3 or 4",
    "other_errors": "other errors",
    "crashes": "crashes",
    "time_limit": "out of time",
    "volume_kept": "of these volume within 5 %",
    "warnings": "warnings, median",
    "most_warnings": "warnings, most",
    "lines": "warnings and notes, median",
    "most_lines": "warnings and notes, most",
    "longest_s": "longest [processor s]",
    "min_dihedral_deg": "min dihedral [deg]",
    "wall_s": "wall [s]",
    "cpu_s": "processor [s]",
    "wall_ratio": "wall / pytetwild",
    "cpu_ratio": "processor / pytetwild",
    "rss_mb": "memory [MiB]",
}


def read_rows(path: Path) -> list[dict]:
    """Rows of a file of JSON lines, of which the last one of an input and tool counts."""
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [json.loads(line) for line in lines]
    return list({(row["input"], row["tool"]): row for row in rows}.values())


def summary(rows: list[dict]) -> dict[str, dict]:
    """Per tool: inputs, converted with all guarantees, other ends, medians beside pytetwild."""
    base = {r["input"]: r for r in rows if r["tool"] == "pytetwild" and r["exit"] == 0}
    result = {}
    for tool in dict.fromkeys(row["tool"] for row in rows):
        mine = [row for row in rows if row["tool"] == tool]
        good = [row for row in mine if row["guarantees"]]
        both = [row for row in mine if row["exit"] == 0 and row["input"] in base]
        result[tool] = {
            "inputs": len(mine),
            "guarantees": len(good),
            "converted": sum(row["exit"] == 0 for row in mine),
            "named": sum(row.get("thin_volume", 0) > MOST_LOST for row in mine),
            "lattices": sum(row.get("mesher") == "stuffing" for row in mine),
            "clear_errors": sum(row["exit"] in (3, 4) for row in mine),
            "other_errors": sum(row["exit"] > 0 for row in mine)
            - sum(row["exit"] in (3, 4, 124) for row in mine),
            "crashes": sum(row["exit"] < 0 for row in mine),
            "time_limit": sum(row["exit"] == 124 for row in mine),
            "volume_kept": sum(abs(row.get("volume_off", np.inf)) < MOST_LOST for row in good),
            "warnings": median(row["warnings"] for row in good if "warnings" in row),
            "most_warnings": max((row.get("warnings", 0) for row in mine), default=None),
            "lines": median(len(row["told"]) for row in good if "told" in row),
            "most_lines": max((len(row.get("told", ())) for row in mine), default=None),
            "longest_s": max(row["cpu_s"] for row in mine),
            "min_dihedral_deg": median(row["min_dihedral_deg"] for row in good),
            "wall_s": median(row["wall_s"] for row in good),
            "cpu_s": median(row["cpu_s"] for row in good),
            "wall_ratio": median(r["wall_s"] / base[r["input"]]["wall_s"] for r in both),
            "cpu_ratio": median(r["cpu_s"] / base[r["input"]]["cpu_s"] for r in both),
            "rss_mb": median(row["rss_mb"] for row in good),
        }
    return result


def median(values: Iterable[float]) -> float | None:
    """Median to three digits, None of nothing."""
    values = list(values)
    return round(float(np.median(values)), 3) if values else None


def table(result: dict[str, dict]) -> str:
    """Markdown of a summary: a row for each quantity, a column for each tool."""
    lines = ["| | " + " | ".join(result) + " |", "|---" * (len(result) + 1) + "|"]
    for key, heading in HEADINGS.items():
        cells = ("-" if row[key] is None else f"{row[key]:g}" for row in result.values())
        lines.append(f"| {heading} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def others(rows: list[dict]) -> str:
    """Markdown of our inputs that have no mesh with all guarantees, and the reason."""
    bad = [row for row in rows if row["tool"] == OURS and not row["guarantees"]]
    if not bad:
        return "Every input converted with all guarantees."
    lines = ["| input | exit | seconds | reason |", "|---|---|---|---|"]
    for row in sorted(bad, key=lambda row: (row["exit"], row["input"])):
        reason = row["reason"].split("; --thicken")[0].replace("|", "/")
        short = reason if len(reason) <= REASON else f"{reason[:REASON]} ..."
        lines.append(f"| {row['input']} | {row['exit']} | {row['wall_s']:.0f} | {short} |")
    return "\n".join(lines)


def sound(rows: list[dict]) -> str:
    """How many of our inputs have all guarantees, or are refused for what they are; the interval.

    An input of which every mesh breaks a guarantee is neither.
    """
    from scipy.stats import binomtest

    mine = [row for row in rows if row["tool"] == OURS]
    refused = [r for r in mine if r["exit"] in (3, 4) and "no tet mesh" not in r["reason"]]
    count = sum(row["guarantees"] for row in mine) + len(refused)
    low, high = binomtest(count, len(mine)).proportion_ci(0.95, "exact")
    return (
        f"{count} of {len(mine)} have all guarantees or are refused for what they are: as a random "
        f"sample that is {low:.1%} to {high:.1%} of all (95 %, Clopper and Pearson)."
    )


def main() -> None:
    """Print one section per file of rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="+", type=Path)
    parser.add_argument("--note", default="", help="a paragraph about how the rows were made")
    args = parser.parse_args()
    note = f"{textwrap.fill(args.note, 100, break_on_hyphens=False)}\n\n" if args.note else ""
    sys.stdout.write(f"{INTRODUCTION}\n{note}")
    for path in args.rows:
        rows = read_rows(path)
        sys.stdout.write(f"## {path.stem}\n\n{table(summary(rows))}\n\n{sound(rows)}\n\n")
        sys.stdout.write(f"Without all guarantees:\n\n{others(rows)}\n\n")


if __name__ == "__main__":
    main()

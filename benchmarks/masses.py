"""Masses of things that were weighed: what the product makes of a shape and a few words.

``python benchmarks/masses.py`` takes the things of ``data/known_masses.toml`` as a user meets the
product: the closed outside of a thing, converted, and a sentence, assigned; once with a full
description and once with the bare name. ALDE is the mean of |ln(m' / m)|; the errors are those of
NeRF2Physics and of AutoPhyX table 2. An interval of masses covers a thing that weighs what lies in
it. The half ``tune`` was looked at while the table of walls was made, of ``report`` the figures.
"""

from __future__ import annotations

import argparse
import json
import logging
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import autophyx_tet as apx
import numpy as np
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.research.evaluation.mass_errors import mass_errors

TABLE = Path(__file__).resolve().parent / "data" / "known_masses.toml"
HALVES = ("tune", "report")
WORDINGS = ("text", "name")
MM = 1e-3
SEGMENTS = 48  # of a circle: the area of a 48-gon is .3 % below
WATER = 1000.0  # kg/m^3 everywhere: what knows nothing


@dataclass(frozen=True)
class Weighed:
    """One thing under one wording: its mass, the one found, what bounds it [kg], and why."""

    name: str
    half: str
    wording: str
    truth: float
    found: float
    low: float
    high: float
    water: float
    why: str

    @property
    def covered(self) -> bool:
        """Whether the truth lies in the interval."""
        return self.low <= self.truth <= self.high


def things(half: str | None = None) -> list[dict[str, Any]]:
    """The things of the table, or of one half of it."""
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))["thing"]
    return [thing for thing in table if half in (None, thing["half"])]


def shape(thing: Mapping[str, Any]):
    """The closed surface [m] of a thing, as one trimesh."""
    import trimesh
    from trimesh import creation

    if "box" in thing:
        return creation.box(np.array(thing["box"]) * MM)
    if "boxes" in thing:
        rows = np.array(thing["boxes"]) * MM
        pieces = [creation.box(row[:3]).apply_translation(row[3:] + row[:3] / 2) for row in rows]
        return trimesh.util.concatenate(pieces)
    if "ball" in thing:
        return creation.icosphere(3, thing["ball"] / 2 * MM)
    if "ellipsoid" in thing:
        return creation.icosphere(3, 0.5).apply_scale(np.array(thing["ellipsoid"]) * MM)
    if "cylinder" in thing:
        diameter, height = thing["cylinder"]
        return creation.cylinder(diameter / 2 * MM, height * MM, sections=SEGMENTS)
    if "tube" in thing:
        outer, wall, height = thing["tube"]
        return creation.annulus(
            (outer / 2 - wall) * MM, outer / 2 * MM, height * MM, sections=SEGMENTS
        )
    height, diameter = np.array(thing["profile"]).T * MM
    outline = np.stack([diameter / 2, height], axis=1)
    closed = [[0, height[0]], *outline.tolist(), [0, height[-1]]]
    return creation.revolve(_without_repeats(closed), sections=SEGMENTS)


def _without_repeats(outline: Sequence[Sequence[float]]) -> np.ndarray:
    """A profile without the points that repeat the one before: a tip lies on the axis already."""
    kept = [outline[0]]
    kept += [b for a, b in pairwise(outline) if not np.allclose(a, b)]
    return np.array(kept)


def weigh(thing: Mapping[str, Any]) -> Iterator[Weighed]:
    """Convert a thing once, and assign it under both wordings, with the defaults of both."""
    asset = Asset("thing", (Part("body", shape(thing)),), up="z")
    solid = apx.convert(asset)
    for wording in WORDINGS:
        result = apx.assign(solid.mesh, thing[wording], asset=solid.asset)
        row = result.part_rows()[0]
        low, high = row["mass_interval"]
        yield Weighed(
            name=thing["name"],
            half=thing["half"],
            wording=wording,
            truth=thing["mass"],
            found=row["mass"],
            low=low,
            high=high,
            water=WATER * float(solid.mesh.volumes.sum()),
            why=f"{row['material']}; {result.built[0].construction.sentence}",
        )


def figures(rows: Sequence[Weighed]) -> dict[str, Any]:
    """Errors of some rows, how many their intervals cover, and the error of water everywhere."""
    truth = np.array([row.truth for row in rows])
    errors = mass_errors(truth, np.array([row.found for row in rows]))
    water = mass_errors(truth, np.array([row.water for row in rows]))
    ratios = [row.high / row.low for row in rows]
    return {
        "things": len(rows),
        **errors._asdict(),
        "covered": float(np.mean([row.covered for row in rows])),
        "median high / low": float(np.median(ratios)),
        "ALDE of water": water.ALDE,
    }


def main() -> None:
    """Weigh the things and print the figures of each half and wording."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--half", choices=HALVES, help="one half; by default both")
    parser.add_argument("--list", action="store_true", help="every thing; not the half `report`")
    parser.add_argument("--json", type=Path, help="file for all rows")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    rows = [row for thing in things(options.half) for row in weigh(thing)]
    for row in rows if options.list else ():
        if row.half == "tune":
            mark = " " if row.covered else "!"
            print(
                f"{np.log(row.found / row.truth):+5.2f} {row.truth:9.4g} {row.found:9.4g} "
                f"[{row.low:8.3g}, {row.high:8.3g}]{mark} {row.wording:4} {row.name}: {row.why}"
            )
    for half in dict.fromkeys(row.half for row in rows):
        for wording in WORDINGS:
            found = figures([r for r in rows if (r.half, r.wording) == (half, wording)])
            line = ", ".join(f"{key} {value:.3g}" for key, value in found.items())
            print(f"{half}, {wording}: {line}")
    if options.json:
        options.json.write_text(json.dumps([row.__dict__ for row in rows], indent=1))


if __name__ == "__main__":
    main()

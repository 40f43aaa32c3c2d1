"""A dry run: what a command would do, and what it would cost, without doing it.

The numbers are estimates: power laws fitted to 104 real surfaces that were converted with the
default options. Four in five of those lie within the range that is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..fem.solve.method import SCENARIOS
from ..predictors.asset import Asset
from .asset.document import check_mesh, check_run
from .options import ConvertOptions, SimulateOptions


class PowerLaw(NamedTuple):
    """``factor * (area / edge^2)^area * faces^faces``, and its 10 and 90 % quantiles as ratios."""

    factor: float
    area: float
    faces: float
    low: float
    high: float

    def at(self, area: float, faces: int) -> dict[str, float]:
        """Estimate with its range, to two digits."""
        value = self.factor * area**self.area * faces**self.faces
        ratios = {"low": self.low, "likely": 1.0, "high": self.high}
        return {name: float(f"{ratio * value:.2g}") for name, ratio in ratios.items()}


TETS = PowerLaw(factor=12.6, area=0.825, faces=0.153, low=0.51, high=1.65)
CONVERT_SECONDS = PowerLaw(factor=0.0477, area=0.468, faces=0.311, low=0.46, high=2.43)
# Tets of a lattice by those wanted, and seconds of a core for start, tet and triangle, with their
# range: thin parts get more tets, for their volume is matched.
LATTICE_RATIOS = {"low": 0.85, "likely": 1.2, "high": 2.0}
LATTICE_SECONDS, LATTICE_TET_SECONDS, LATTICE_FACE_SECONDS = 2.5, 4e-5, 5e-5
LATTICE_SPREAD = {"low": 0.5, "likely": 1.0, "high": 2.5}
# Of a core, for materials, sag, pictures and report of one sentence: start, and for each tet.
SENTENCE_SECONDS, TET_SECONDS = 4.0, 1e-3
# Of our process, which holds the solver and the report; the engine's own child takes .13 to .4 GB.
BASE_MEMORY, TET_MEMORY = 5e8, 8e3  # bytes


def plan(
    path: Path,
    options: ConvertOptions,
    *,
    output: Path,
    texts: Sequence[str] = (),
    simulate: SimulateOptions | None = None,
) -> dict[str, Any]:
    """What `convert`, or with ``texts`` `run`, would do: steps, size [m], tets, seconds, bytes.

    Raises InputError: Where the asset cannot be read or the output not be written, as the command
        itself would.
    """
    from .asset.load import load_asset
    from .meshing.import_tets import SUFFIXES, import_tets

    if texts:
        check_run(output)
    else:
        check_mesh(output)
    scale = {"size": options.size, "units": options.units, "up": options.up}
    if path.suffix.lower() in SUFFIXES:
        asset, mesh, _ = import_tets(path, **scale)
        tets: dict[str, float] = dict.fromkeys(TETS.at(1.0, 1), float(len(mesh.tets)))
        seconds = dict.fromkeys(tets, 0.0)
        steps = [f"take over the {len(mesh.tets):,} tets of {path}"]
    else:
        asset = load_asset(path, **options.loading())
        tets, seconds = _cost(asset, options)
        steps = [f"fill {len(asset.parts)} parts of {path} with tets"]
    scenario = simulate.scenario if simulate else ""
    for text in texts:
        steps.append(
            f"give every tet E, nu and rho from {text!r}" if text else "guess the materials"
        )
        steps.append(f"simulate: {scenario}")
    steps.append(f"write {'the folder ' if texts else ''}{output}")
    memory = {name: BASE_MEMORY + TET_MEMORY * count for name, count in tets.items()}
    if scenario and SCENARIOS[scenario].method != "statics":
        # how long a motion or its Newton steps take is not known
        estimates = {"tets": tets, "convert_cpu_seconds": seconds, "memory": memory}
    else:
        total = {
            name: round(seconds[name] + len(texts) * (SENTENCE_SECONDS + TET_SECONDS * count), 1)
            for name, count in tets.items()
        }
        estimates = {"tets": tets, "cpu_seconds": total, "memory": memory}
    return {
        "dry_run": True,
        "steps": steps,
        "part_names": [part.name for part in asset.parts],
        "faces": _faces(asset),
        "bounds": asset.bounds,
        "up": asset.up,
        "estimates": estimates,
        "warnings": list(asset.warnings),
    }


def _cost(asset: Asset, options: ConvertOptions) -> tuple[dict[str, float], dict[str, float]]:
    """Tets and seconds of a core that converting takes."""
    from .meshing.ftetwild import EDGE_LENGTH_REL, TETS_PER_CUBE, EngineTarget
    from .meshing.meshers import STUFFING, chosen_mesher

    diagonal, faces = float(np.linalg.norm(asset.size)), _faces(asset)
    if chosen_mesher(options.mesher, sampled=asset.sampled) == STUFFING:
        # tets of a lattice fill the volume, or are as many as wanted
        rel = options.edge_length / diagonal if options.edge_length else options.edge_length_rel
        epsilon, most = options.epsilon_rel, options.max_tets
        target = EngineTarget.of(diagonal, rel, epsilon, max_tets=most)
        count = float(target.tets)
        if rel is not None:
            volume = sum(abs(float(part.mesh.volume)) for part in asset.parts)
            count = max(TETS_PER_CUBE * volume / target.edge_length**3, 1.0)
        total = LATTICE_SECONDS + LATTICE_TET_SECONDS * count + LATTICE_FACE_SECONDS * faces
        return (
            {name: float(f"{ratio * count:.2g}") for name, ratio in LATTICE_RATIOS.items()},
            {name: round(ratio * total, 1) for name, ratio in LATTICE_SPREAD.items()},
        )
    edge = options.edge_length or (options.edge_length_rel or EDGE_LENGTH_REL) * diagonal
    area = sum(float(part.mesh.area) for part in asset.parts) / edge**2
    tets = TETS.at(area, faces)
    if options.max_tets:
        tets = {name: min(count, options.max_tets) for name, count in tets.items()}
    return tets, CONVERT_SECONDS.at(area, faces)


def _faces(asset: Asset) -> int:
    return sum(len(part.mesh.faces) for part in asset.parts)

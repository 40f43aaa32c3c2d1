"""CalculiX and Abaqus .inp: a ready-to-run gravity-sag deck with one material a bin."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...fem.scene.mesh import TetMesh
from ...fem.scene.support_finder import find_supports
from ..files import writing
from ..registry import MATERIAL, Format, Keeps, Program
from .material_bins import Bins
from .scene_options import SceneOptions

_A_LINE = 16  # entries of a set on one line, the format's limit


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write the deck; ``ccx STEM`` then writes displacement and stress to STEM.frd and .dat."""
    with writing(path) as target, target.open("w", encoding="ascii", newline="\n") as file:
        file.write("*HEADING\nGravity sag; SI units: m, kg, s, N, Pa\n")
        file.writelines(_mesh(mesh, bins))
        file.writelines(_materials(bins))
        file.writelines(_step(mesh, options))
    return [path]


CALCULIX = Program(
    (
        Format(
            "CalculiX and Abaqus deck",
            (".inp",),
            write=_write,
            keeps=frozenset({Keeps.REGIONS, Keeps.HELD, Keeps.ROLLERS, Keeps.PRESCRIBED}),
            binned=MATERIAL,
        ),
    )
)


def _mesh(mesh: TetMesh, bins: Bins) -> Iterator[str]:
    yield "*NODE, NSET=NALL\n"
    yield from (
        f"{i}, {_number(x)}, {_number(y)}, {_number(z)}\n"
        for i, (x, y, z) in enumerate(mesh.points.tolist(), 1)
    )
    ids = np.column_stack([np.arange(1, len(mesh.tets) + 1), mesh.tets + 1])
    for bin_id in range(len(bins)):
        yield f"*ELEMENT, TYPE=C3D4, ELSET=BIN{bin_id + 1}\n"
        yield from (", ".join(map(str, row)) + "\n" for row in ids[bins.label == bin_id].tolist())
    yield "*ELSET, ELSET=EALL\n"
    yield from _list([f"BIN{i + 1}" for i in range(len(bins))])
    for region, name in enumerate(mesh.region_names):
        if (members := np.flatnonzero(mesh.region == region) + 1).size:
            yield f"** region {region + 1}: {name.encode('ascii', 'replace').decode()!r}\n"
            yield f"*ELSET, ELSET=REGION{region + 1}\n"
            yield from _list(members.tolist())


def _materials(bins: Bins) -> Iterator[str]:
    rows = zip(bins.E.tolist(), bins.nu.tolist(), bins.rho.tolist(), strict=True)
    for i, (E, nu, rho) in enumerate(rows, 1):
        yield f"*MATERIAL, NAME=MAT{i}\n*ELASTIC\n{_number(E)}, {_number(nu)}\n"
        yield f"*DENSITY\n{_number(rho)}\n"
        yield f"*SOLID SECTION, ELSET=BIN{i}, MATERIAL=MAT{i}\n"


def _step(mesh: TetMesh, options: SceneOptions) -> Iterator[str]:
    axis = "xyz".index(options.up)
    supports = options.supports or find_supports(mesh, axis)[0]
    down = -np.eye(3, dtype=int)[axis]
    yield "*STEP\n*STATIC\n*BOUNDARY\n"
    for component in range(3):
        held = np.flatnonzero(supports.fixed[:, component])
        values = supports.values[held, component].tolist()
        for node, value in zip((held + 1).tolist(), values, strict=True):
            yield f"{node}, {component + 1}, {component + 1}, {_number(value)}\n"
    yield f"*DLOAD\nEALL, GRAV, {_number(options.gravity)}, {down[0]}., {down[1]}., {down[2]}.\n"
    yield "*NODE FILE\nU, RF\n*EL FILE\nS\n*NODE PRINT, NSET=NALL\nU\n*END STEP\n"


def _number(value: float) -> str:
    """At most 20 characters: CalculiX cuts the rest off, the exponent with it."""
    return f"{value:.13g}"


def _list(entries: list) -> Iterator[str]:
    for start in range(0, len(entries), _A_LINE):
        yield ", ".join(map(str, entries[start : start + _A_LINE])) + ",\n"

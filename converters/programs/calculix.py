"""CalculiX and Abaqus .inp: a ready-to-run gravity-sag deck with one material a bin.

Its elements are those of our own static solver: quadratic tets (C3D10, whose node order is VTK's)
while those are affordable, else linear ones (C3D4).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...fem.elements.assembly import node_supports
from ...fem.elements.space import Space, affordable_order, make_space
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ...fem.scene.supports import Supports, find_supports
from ...fem.scene.up import UpAxis, up_vector
from ..files import writing
from ..registry import MATERIAL, Format, Keeps, Program
from .export import SceneOptions
from .material_bins import Bins

_A_LINE = 16  # entries of a set on one line, the format's limit
_ELEMENT = {1: "C3D4", 2: "C3D10"}


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write the deck; ``ccx STEM`` then writes displacement and stress to STEM.frd and .dat."""
    space = make_space(mesh, options.order or affordable_order(mesh))
    supports = node_supports(options.supports or find_supports(mesh, options.up)[0], space)
    with writing(path) as target, target.open("w", encoding="ascii", newline="\n") as file:
        file.write("*HEADING\nGravity sag; SI units: m, kg, s, N, Pa\n*NODE, NSET=NALL\n")
        for i, place in enumerate(space.nodes.tolist(), 1):
            file.write(f"{i}, {', '.join(map(_number, place))}\n")
        # The points of the mesh come first: those alone are printed with their results.
        file.write(f"*NSET, NSET=POINTS, GENERATE\n1, {space.points}, 1\n")
        file.writelines(_elements(mesh, space, bins))
        file.writelines(_springs(supports, first=len(mesh.tets) + 1))
        file.writelines(_materials(mesh, bins))
        file.writelines(_step(supports, options.gravity, options.up))
    return [path]


CALCULIX = Program(
    (
        Format(
            Note("calculix.calculix_abaqus"),
            (".inp",),
            write=_write,
            keeps=frozenset(
                {
                    Keeps.REGIONS,
                    Keeps.HELD,
                    Keeps.ROLLERS,
                    Keeps.PRESCRIBED,
                    Keeps.SPRINGS,
                    Keeps.QUADRATIC,
                }
            ),
            binned=MATERIAL | {Keeps.GRAIN},
        ),
    )
)


def _elements(mesh: TetMesh, space: Space, bins: Bins) -> Iterator[str]:
    ids = np.column_stack([np.arange(1, len(mesh.tets) + 1), space.elements + 1])
    for bin_id in range(len(bins)):
        yield f"*ELEMENT, TYPE={_ELEMENT[space.order]}, ELSET=BIN{bin_id + 1}\n"
        yield from (", ".join(map(str, row)) + "\n" for row in ids[bins.label == bin_id].tolist())
    yield "*ELSET, ELSET=EALL\n"
    yield from _list([f"BIN{i + 1}" for i in range(len(bins))])
    for region, name in enumerate(mesh.region_names):
        if (members := np.flatnonzero(mesh.region == region) + 1).size:
            yield f"** region {region + 1}: {_plain(name)}\n"
            yield f"*ELSET, ELSET=REGION{region + 1}\n"
            yield from _list(members.tolist())


def _materials(mesh: TetMesh, bins: Bins) -> Iterator[str]:
    rows = zip(bins.E.tolist(), bins.nu.tolist(), bins.rho.tolist(), strict=True)
    for i, (E, nu, rho) in enumerate(rows, 1):
        regions = np.unique(mesh.region[bins.label == i - 1]).tolist()
        yield f"** material {i}: {', '.join(_plain(mesh.region_names[r]) for r in regions)}\n"
        yield f"*MATERIAL, NAME=MAT{i}\n"
        wooden = bins.grain is not None and bins.grain.axes[i - 1].any()
        if bins.grain is not None and wooden:
            # Along, radial, tangential: E, then nu, then G; eight values on the first line
            along = np.split(bins.grain.constants[i - 1], 3)
            values = [_number(value) for k in (0, 2, 1) for value in along[k]]
            yield "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n"
            yield f"{', '.join(values[:8])}\n{values[8]}\n"
        else:
            yield f"*ELASTIC\n{_number(E)}, {_number(nu)}\n"
        yield f"*DENSITY\n{_number(rho)}\n"
        section = f"*SOLID SECTION, ELSET=BIN{i}, MATERIAL=MAT{i}"
        if bins.grain is not None and wooden:
            plane = ", ".join(map(_number, bins.grain.axes[i - 1, :2].ravel().tolist()))
            yield f"*ORIENTATION, NAME=GRAIN{i}, SYSTEM=RECTANGULAR\n{plane}\n"
            section += f", ORIENTATION=GRAIN{i}"
        yield f"{section}\n"


def _springs(supports: Supports, first: int) -> Iterator[str]:
    """Springs to the ground, a set for every axis and stiffness; element ids from ``first``.

    A stiffness without a decimal point is an axis to CalculiX, which skips the line.
    """
    nodes, axes = np.nonzero(supports.springs)
    stiffness = supports.springs[nodes, axes]
    kinds, label = np.unique(np.stack([axes, stiffness], axis=1), axis=0, return_inverse=True)
    for i, (axis, k) in enumerate(kinds.tolist()):
        members = np.flatnonzero(label.ravel() == i)
        yield f"*ELEMENT, TYPE=SPRING1, ELSET=SPRING{i + 1}\n"
        yield from (f"{first + m}, {nodes[m] + 1}\n" for m in members)
        yield f"*SPRING, ELSET=SPRING{i + 1}\n{int(axis) + 1}\n{k:.12e}\n"


def _step(supports: Supports, gravity: float, up: UpAxis) -> Iterator[str]:
    down = -up_vector(up).astype(int)
    yield "*STEP\n*STATIC\n*BOUNDARY\n"
    for component in range(3):
        held = np.flatnonzero(supports.fixed[:, component])
        values = supports.values[held, component].tolist()
        for node, value in zip((held + 1).tolist(), values, strict=True):
            yield f"{node}, {component + 1}, {component + 1}, {_number(value)}\n"
    yield f"*DLOAD\nEALL, GRAV, {_number(gravity)}, {down[0]}., {down[1]}., {down[2]}.\n"
    yield "*NODE FILE\nU, RF\n*EL FILE\nS\n*NODE PRINT, NSET=POINTS\nU\n*END STEP\n"


def _plain(name: str) -> str:
    return repr(name.encode("ascii", "replace").decode())


def _number(value: float) -> str:
    """At most 20 characters: CalculiX cuts the rest off, the exponent with it."""
    return f"{value:.13g}"


def _list(entries: list) -> Iterator[str]:
    for start in range(0, len(entries), _A_LINE):
        yield ", ".join(map(str, entries[start : start + _A_LINE])) + ",\n"

"""The grain of every part: which way it runs, and how stiff its material is along and across it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from .errors import UsageError
from .mesh import TetMesh, material_of
from .note import Note
from .table import OrthotropicConstants, load_grains, load_table

# A part that is so many times as long as it is wide was cut along the grain.
LONGEST = 1.2
# E of a part may leave the range of its row by this factor before it is not that of the material:
# an apparent modulus, of a hollow part that is meshed solid.
SAME_E = 1.5


class Grained(NamedTuple):
    """A ``mesh`` whose material has its grain, and in ``notes`` what was taken for known."""

    mesh: TetMesh
    notes: tuple[str, ...]


def parts_of_grain(materials: Mapping[str, str]) -> tuple[str, ...]:
    """Those parts of ``materials`` (part -> row of the table) that are stiffer along a grain."""
    return tuple(part for part, row in materials.items() if row in load_grains())


def grained_parts(mesh: TetMesh) -> tuple[str, ...]:
    """Names of the regions of ``mesh`` whose material has a grain."""
    if mesh.material is None:
        return ()
    regions = np.unique(mesh.region[mesh.material.grained])
    return tuple(mesh.region_names[region] for region in regions)


def with_grains(
    mesh: TetMesh, materials: Mapping[str, str], stated: Mapping[str, Float[np.ndarray, "3"]]
) -> Grained:
    """Give every part its grain whose row in ``materials`` (part -> row) has one in the table.

    It runs as ``stated`` (part -> direction), else as the mesh has it, else along the part's
    longest axis; a part without one, or whose E is not its row's, stays isotropic. The rings may
    lie anyhow about the grain: the compliance is their mean.

    Raises UsageError: Where a direction is stated of a part that has no grain.
    """
    grains, material = load_grains(), material_of(mesh)
    for part in stated:
        if materials.get(part) not in grains:
            row = materials.get(part)
            why = Note("grain.grain_table", row=row) if row else Note("grain.material_known")
            names = ", ".join(parts_of_grain(materials)) or "none"
            raise UsageError("grain.grain_part", part=part, why=why, names=names)
    grained = material.grained
    along: list[str] = []
    blind: list[str] = []
    for region, part in enumerate(mesh.region_names):
        tets = np.flatnonzero(mesh.region == region)
        row = materials.get(part, "")
        if row not in grains or not tets.size:
            continue
        way = stated.get(part)
        if way is None and grained[tets].any():
            continue
        way = longest_axis(mesh, tets) if way is None else way
        if way is None or not is_of_row(material.E[tets], row):
            blind.append(part)
            continue
        shown = np.round(way / np.linalg.norm(way), 3) + 0.0
        along.append(f"{part} ({', '.join(f'{x:g}' for x in shown)})")
        unit = ring_mean(grains[row].constants(1.0))
        material = material.with_grain(tets, unit.times(material.E[tets]), axes_about(way))
    taken = (Note("grain.grain_taken", along="; ".join(along)),) if along else ()
    unknown = (Note("grain.way_grain", blind=", ".join(blind)),) if blind else ()
    return Grained(mesh.with_material(material), taken + unknown)


def longest_axis(mesh: TetMesh, tets: Int[np.ndarray, "n"]) -> Float[np.ndarray, "3"] | None:
    """Unit vector along the longest principal axis of ``tets``; None where none is the longest."""
    weight, middle = mesh.volumes[tets], mesh.centroids[tets]
    away = middle - np.average(middle, axis=0, weights=weight)
    spread, axes = np.linalg.eigh((away * weight[:, None]).T @ away)
    if not spread[2] > LONGEST**2 * spread[1]:
        return None
    way = axes[:, 2]
    return way * np.sign(way[np.argmax(np.abs(way))])


def axes_about(grain: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Three unit vectors, square on, the first along ``grain`` (any length)."""
    first = grain / np.linalg.norm(grain)
    side = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    side /= np.linalg.norm(side)
    return np.stack([first, side, np.cross(first, side)])


def ring_mean(c: OrthotropicConstants) -> OrthotropicConstants:
    """Constants [Pa, 1] of a solid whose rings lie in all directions about its grain.

    Its compliance is their mean, so that E along the grain stays what it is.
    """
    radial, tangential, shear, cross = 1 / c.E_R, 1 / c.E_T, 1 / c.G_RT, -c.nu_RT / c.E_R
    across = (3 * (radial + tangential) + 2 * cross + shear) / 8
    beside = (radial + tangential + 6 * cross - shear) / 8
    G, nu = 2 / (1 / c.G_LR + 1 / c.G_LT), (c.nu_LR + c.nu_LT) / 2
    E, G_RT = 1 / across, 0.5 / (across - beside)
    return OrthotropicConstants(c.E_L, E, E, G, G, G_RT, nu, nu, -beside / across)


def is_of_row(E: Float[np.ndarray, "n"], row: str) -> bool:
    """Whether ``E`` [Pa] is that of a row of the table, not an apparent one."""
    span = load_table().exact(row).E
    return bool(span.min / SAME_E <= E.min() and E.max() <= span.max * SAME_E)

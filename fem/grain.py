"""The grain of every part: which way it runs, and how stiff its material is along and across it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from .errors import UsageError
from .scene.material import isotropic_tensor, orthotropic_tensor
from .scene.material_properties import OrthotropicConstants, load_grains
from .scene.materials import load_table
from .scene.mesh import TetMesh, material_of

# A part that is so many times as long as it is wide was cut along the grain.
LONGEST = 1.2
# Directions of the rings about the grain over which a compliance is averaged.
RINGS = 8
# E of a part may leave the range of its row by this factor before it is not that of the material:
# an apparent modulus, of a hollow part that is meshed solid.
SAME_E = 1.5


class Grained(NamedTuple):
    """A ``mesh`` whose material has its grain, and in ``notes`` what was taken for known."""

    mesh: TetMesh
    notes: tuple[str, ...]


def has_grain(materials: Mapping[str, str]) -> bool:
    """Whether any part of ``materials`` (part -> row of the table) is stiffer along a grain."""
    return any(row in load_grains() for row in materials.values())


def with_grains(
    mesh: TetMesh, materials: Mapping[str, str], stated: Mapping[str, Float[np.ndarray, "3"]]
) -> Grained:
    """Give every part its grain whose row in ``materials`` (part -> row) has one in the table.

    It runs as ``stated`` (part -> direction), else along the part's longest axis; a part without
    one, or whose E is not its row's, stays isotropic. The rings may lie anyhow about the grain: the
    compliance is their mean.

    Raises
    ------
    UsageError
        Where a direction is stated of a part that has no grain.
    """
    grains, material = load_grains(), material_of(mesh)
    for part in stated:
        if materials.get(part) not in grains:
            row = materials.get(part)
            why = f"{row!r} has no grain in the table" if row else "its material is not known"
            raise UsageError(f"--grain part:{part}: {why}; parts with one are {_named(materials)}")
    tensor = isotropic_tensor(*material.lame)
    along: list[str] = []
    blind: list[str] = []
    for region, part in enumerate(mesh.region_names):
        tets = np.flatnonzero(mesh.region == region)
        row = materials.get(part, "")
        if row not in grains or not tets.size:
            continue
        way = stated.get(part)
        way = longest_axis(mesh, tets) if way is None else way
        if way is None or not is_of_row(material.E[tets], row):
            blind.append(part)
            continue
        along.append(f"{part} ({', '.join(f'{x:.2g}' for x in way / np.linalg.norm(way))})")
        unit = ring_mean(grains[row].constants(1.0), way)
        tensor[tets] = material.E[tets, None, None] * unit
    if along:
        tensor.flags.writeable = False
        mesh = mesh.with_material(replace(material, tensor=tensor))
    return Grained(mesh, tuple(_notes(along, blind)))


def longest_axis(mesh: TetMesh, tets: Int[np.ndarray, "n"]) -> Float[np.ndarray, "3"] | None:
    """Unit vector along the longest principal axis of ``tets``; None where none is the longest."""
    weight, middle = mesh.volumes[tets], mesh.centroids[tets]
    away = middle - np.average(middle, axis=0, weights=weight)
    spread, axes = np.linalg.eigh((away * weight[:, None]).T @ away)
    if not spread[2] > LONGEST**2 * spread[1]:
        return None
    way = axes[:, 2]
    return way * np.sign(way[np.argmax(np.abs(way))])


def ring_mean(
    constants: OrthotropicConstants, grain: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "6 6"]:
    """Stiffness tensor [Pa] along ``grain`` (any length) of rings that lie in all directions.

    The inverse of the mean compliance: E along the grain stays what it is.
    """
    first = grain / np.linalg.norm(grain)
    side = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    side /= np.linalg.norm(side)
    other = np.cross(first, side)
    total = np.zeros((6, 6))
    for angle in np.arange(RINGS) * np.pi / RINGS:
        radial = np.cos(angle) * side + np.sin(angle) * other
        axes = np.stack([first, radial, np.cross(first, radial)])
        total += np.linalg.inv(orthotropic_tensor(constants, axes))
    return np.linalg.inv(total / RINGS)


def is_of_row(E: Float[np.ndarray, "n"], row: str) -> bool:
    """Whether ``E`` [Pa] is that of a row of the table, not an apparent one."""
    span = load_table().exact(row).E
    return bool(span.min / SAME_E <= E.min() and E.max() <= span.max * SAME_E)


def _named(materials: Mapping[str, str]) -> str:
    return ", ".join(part for part, row in materials.items() if row in load_grains()) or "none"


def _notes(along: list[str], blind: list[str]) -> list[str]:
    notes = []
    if along:
        notes.append(f"the grain is taken along {'; '.join(along)}: --grain says otherwise")
    if blind:
        notes.append(
            f"{', '.join(blind)}: which way the grain runs is not known, so it is as stiff across "
            "as along: --grain part:NAME=x,y,z says it"
        )
    return notes

"""Particles of voxels: mass, places and values; tets of voxels carry the same."""

import numpy as np
import pytest
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.converters.transfer import field_from_points, particles_of_field, tets_of_field
from autophyx_tet.fem.mpm.materials import MaterialClass, Substance
from autophyx_tet.fem.mpm.particles import sample_tets
from autophyx_tet.predictors.field import MaterialField
from autophyx_tet.predictors.grid import Grid


def two_parts():
    """An L of five voxels of 0.1 m, its foot of another part and matter."""
    occupied = np.zeros((4, 3, 5), dtype=bool)
    occupied[1, 1, 1:4], occupied[2, 1, 1], occupied[1, 2, 1] = True, True, True
    part = np.where(occupied, 0, -1)
    part[:, :, 1][occupied[:, :, 1]] = 2
    foot = part == 2
    return MaterialField(
        Grid(np.array([0.3, 0.0, -0.2]), 0.1, occupied.shape), occupied,
        E=np.where(foot, 1e6, 1e5), nu=np.where(foot, 0.2, 0.3), rho=np.where(foot, 900.0, 200.0),
        part=part, part_names=("stem", "none", "foot"),
    )  # fmt: skip


def test_particles_have_the_mass_and_the_parts_of_their_voxels():
    """M = sum rho h^3 of every part, eight in a voxel; a part without voxels is left out."""
    field = two_parts()
    still = Substance(kind=MaterialClass.STATIONARY)
    found = particles_of_field(field, substances={"foot": still})
    assert len(found.x) == 8 * 5
    assert found.parts == ("stem", "foot")
    masses = np.bincount(found.part, found.mass)
    assert masses == pytest.approx([2 * 200 * 1e-3, 3 * 900 * 1e-3], rel=1e-12)
    assert found.held.sum() == 24
    cells = field.grid.cell_of(found.x)
    assert np.array_equal(found.E, field.E[tuple(cells.T)])
    alone = field.grid.to_world(np.argwhere(field.occupied)).mean(axis=0)
    assert found.x.mean(axis=0) == pytest.approx(alone, abs=1e-12)


def test_tets_of_voxels_carry_the_same_particles():
    """A watertight surface of 2 (6 n - 2 joints) triangles; its lattice is that of the voxels."""
    field = two_parts()
    mesh, straight = tets_of_field(field), particles_of_field(field)
    assert mesh.volume == pytest.approx(5e-3, rel=1e-12)
    assert mesh.region_names == ("stem", "foot")
    assert len(mesh.boundary.faces) == 2 * (6 * 5 - 2 * 4)
    assert mesh.mass == pytest.approx(straight.mass.sum(), rel=1e-12)
    lattice = sample_tets(mesh, field.grid.h)
    order = [np.lexsort(np.round(x / field.grid.h, 6).T) for x in (lattice.x, straight.x)]
    assert np.allclose(lattice.x[order[0]], straight.x[order[1]], atol=1e-12)
    assert np.array_equal(mesh.material.E[lattice.tet][order[0]], straight.E[order[1]])


def test_a_shell_of_points_becomes_a_full_ball():
    """Its volume lies between those of the cells within it and of the cells it touches."""
    rng = np.random.default_rng(0)
    ways = rng.standard_normal((20_000, 3))
    place = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    given = {**dict(zip("xyz", place.T, strict=True)), "E": np.full(20_000, 1e5)}
    table = PointTable({**given, "nu": np.full(20_000, 0.3), "rho": np.full(20_000, 100.0)})
    found = particles_of_field(field_from_points(table, cells=24))
    h = 2 / 24
    ball = [4 / 3 * np.pi * r**3 * 100 for r in (1, 1 + h)]  # a touched cell reaches h at most
    assert ball[0] < found.mass.sum() < ball[1]

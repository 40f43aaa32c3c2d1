"""Quality numbers against closed forms, and the separation of non-manifold boundaries."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, altitudes, boundary_faces, box_mesh
from autophyx_tet.toolkit.meshing.guarantees import separate
from autophyx_tet.toolkit.meshing.quality import (
    boundary_kind,
    dihedral_angles,
    quality,
    radius_ratios,
)
from autophyx_tet.toolkit.verdict.checks import largest_explicit_step

REGULAR = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)


def _tet(points):
    mesh = TetMesh.oriented(points, [[0, 1, 2, 3]])
    return mesh.points, mesh.tets


def test_regular_tet():
    """All dihedral angles are arccos(1/3), 3 r/R is 1, the altitude is sqrt(2/3) of the edge."""
    points, tets = _tet(REGULAR)
    edge = np.sqrt(8)
    assert dihedral_angles(points, tets) == pytest.approx(np.degrees(np.arccos(1 / 3)))
    assert radius_ratios(points, tets) == pytest.approx(1)
    assert altitudes(points, tets) == pytest.approx(np.sqrt(2 / 3) * edge)


def test_corner_tet():
    """The corner of a unit cube: right angles at the three legs, altitude 1 / sqrt(3) to (111)."""
    points, tets = _tet(np.vstack([np.zeros(3), np.eye(3)]))
    angles = np.sort(dihedral_angles(points, tets)[0])
    assert angles[3:] == pytest.approx(90)
    assert angles[:3] == pytest.approx(np.degrees(np.arccos(1 / np.sqrt(3))))
    assert altitudes(points, tets).min() == pytest.approx(1 / np.sqrt(3))


def test_quality_is_free_of_units_and_place():
    """Angles and ratios do not change under rotation, scaling and translation; altitudes scale."""
    mesh = box_mesh((1, 2, 3), (2, 3, 4))
    q, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    moved = TetMesh.oriented(1e-3 * mesh.points @ q.T + 5, mesh.tets)
    a, b = quality(mesh), quality(moved)
    assert b.dihedral_min == pytest.approx(a.dihedral_min, rel=1e-6)
    assert b.radius_ratio_median == pytest.approx(a.radius_ratio_median, rel=1e-6)
    assert b.altitude_min == pytest.approx(1e-3 * a.altitude_min, rel=1e-6)
    assert a.boundary.bad_edges == a.boundary.pinched_vertices == 0
    assert a.components == 1


def test_the_table_of_a_mesh():
    """Percentiles in order, and the step of steel: altitude by sqrt((lam + 2 mu) / rho)."""
    mesh = box_mesh((1, 2, 3), (2, 3, 4))
    found = quality(mesh)
    speed = np.sqrt(2.1e11 * 0.7 / (1.3 * 0.4) / 7850)
    assert found.time_step == pytest.approx(found.altitude_min / speed)
    soft = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.0, rho=1e3))
    assert quality(soft).time_step == pytest.approx(found.altitude_min / np.sqrt(1e3))
    for row in found.rows()[:2]:
        assert row["min"] <= row["5 %"] <= row["median"]


def test_largest_explicit_step():
    """h / c on one corner tet: altitude 1/sqrt(3), c^2 = E/rho for nu = 0; none without E."""
    points, tets = _tet(np.vstack([np.zeros(3), np.eye(3)]))
    mesh = TetMesh.oriented(points, tets)
    with pytest.raises(InputError, match="assign"):
        largest_explicit_step(mesh)
    steel = mesh.with_material(ElementMaterial.uniform(1, E=4e6, nu=0.0, rho=1e2))
    assert largest_explicit_step(steel) == pytest.approx(1 / np.sqrt(3) / 200)


def _boxes(*corners):
    """Unit boxes at the given corners, sharing the nodes that coincide."""
    cells = [box_mesh((1, 1, 1), (1, 1, 1), lo=c) for c in corners]
    points = np.concatenate([c.points for c in cells])
    tets = np.concatenate([c.tets + 8 * i for i, c in enumerate(cells)])
    points, node = np.unique(points, axis=0, return_inverse=True)
    return points, node.reshape(-1)[tets]


@pytest.mark.parametrize(
    ("corners", "doubled", "split"),
    [
        ([(0, 0, 0), (1, 1, 1)], 1, 0),  # they share one vertex
        ([(0, 0, 0), (1, 1, 0)], 2, 0),  # they share one edge
        # they share an edge whose ends hang together through two more boxes
        ([(0, 0, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 0, -1), (1, 0, -1),
          (1, 1, -1)], 1, 1),
    ],
)  # fmt: skip
def test_separation_makes_the_boundary_manifold(corners, doubled, split):
    """Tets that share no face get nodes of their own; no volume changes, no edge stays bad."""
    points, tets = _boxes(*corners)
    before = boundary_kind(boundary_faces(tets).faces)
    assert before.bad_edges + before.pinched_vertices > 0
    result = separate(points, tets)
    mesh = TetMesh.oriented(result.points, result.tets)
    assert quality(mesh).boundary.bad_edges == 0
    assert quality(mesh).boundary.pinched_vertices == 0
    assert mesh.volume == pytest.approx(len(corners))
    assert (result.doubled_points, result.split_edges) == (doubled, split)
    inside = TetMesh.oriented(points, tets)
    share = np.bincount(result.origin, weights=mesh.volumes, minlength=len(tets))
    assert share == pytest.approx(inside.volumes)


def test_separation_leaves_a_manifold_mesh_alone():
    mesh = box_mesh((1, 1, 1), (3, 3, 3))
    result = separate(mesh.points, mesh.tets)
    assert (result.points == mesh.points).all()
    assert (result.tets == mesh.tets).all()

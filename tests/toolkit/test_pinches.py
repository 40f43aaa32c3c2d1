"""Boundaries with one fan at every vertex: hollows that touch in a point are taken apart."""

import numpy as np
import pytest
from autophyx_tet.fem.mesh import TetMesh, box_mesh, signed_volumes
from autophyx_tet.toolkit.meshing.pinches import manifold
from autophyx_tet.toolkit.meshing.quality import quality

CELL = 1.0  # m
EVEN = 4  # cells a side of the block


def block(*, without=(), seed=None, share=0.0) -> TetMesh:
    """A block of cells of six tets, without some cells, or without a share of them at random."""
    whole = box_mesh((EVEN * CELL,) * 3, (EVEN,) * 3)
    cell = np.floor(whole.points[whole.tets].mean(axis=1) / CELL).astype(int)
    gone = np.zeros(len(cell), dtype=bool)
    for one in without:
        gone |= (cell == one).all(axis=1)
    if seed is not None:
        inner = ((cell > 0) & (cell < EVEN - 1)).all(axis=1)
        gone |= inner & (np.random.default_rng(seed).random(len(cell)) < share)
    return TetMesh(whole.points, whole.tets[~gone], whole.region[~gone])


def mended(mesh: TetMesh, reach: float):
    """What becomes of a mesh, and the mesh of it."""
    found = manifold(mesh.points, mesh.tets, reach=reach, worst=0.1)
    return found, TetMesh(found.points, found.tets, mesh.region[found.origin])


@pytest.mark.parametrize("reach", [0.05 * CELL, 2 * CELL])
def test_two_hollow_cells_that_touch_in_a_corner_are_two_cavities(reach):
    """Their walls have one fan a vertex; nothing moves farther than it may, and no tet is lost."""
    before = block(without=((1, 1, 1), (2, 2, 2)))
    assert quality(before).boundary.pinched_vertices == 1
    found, after = mended(before, reach)
    kind = quality(after).boundary
    assert (found.mended, len(found.pinched)) == (1, 0)
    assert (kind.bad_edges, kind.pinched_vertices) == (0, 0)
    assert (signed_volumes(found.points, found.tets) > 0).all()
    # The two hollows have 2 m^3, of which at most a cap as high as the reach is filled
    filled = after.volume - before.volume
    assert 0 < filled < 2 * CELL**3
    assert filled <= 2 * reach * CELL**2
    # What was solid still is: no old point has moved
    assert np.array_equal(found.points[: len(before.points)], before.points)
    # Outside, the block's own box, nothing has changed
    assert after.points.min() == before.points.min()
    assert after.points.max() == before.points.max()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_boundaries_of_random_holes_are_manifold(seed):
    """Tets missing at random: cavities that touch in vertices and edges, alone or several of them.

    The volume of the tets there were stays, whatever is added beside them; tets never overlap, for
    the volume is also what the boundary encloses, and its faces lie on two tets or the outside.
    """
    before = block(seed=seed, share=0.15 + 0.02 * seed)
    if quality(before).boundary.pinched_vertices == 0:
        pytest.fail("nothing is pinched here: the test would show nothing")
    found, after = mended(before, 0.2 * CELL)
    kind = quality(after).boundary
    assert (signed_volumes(found.points, found.tets) > 0).all()
    assert (kind.bad_edges, kind.pinched_vertices, len(found.pinched)) == (0, 0, 0)
    assert after.volume >= before.volume * (1 - 1e-12)
    corners = after.points[after.boundary.faces]
    enclosed = np.einsum("fi,fi->", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) / 6
    assert enclosed == pytest.approx(after.volume, rel=1e-9)
    assert after.volume <= (EVEN * CELL) ** 3 * (1 + 1e-12)


def test_a_vertex_stays_where_it_would_take_bad_tets():
    """Where no tet may be worse than a regular one the place is told, and nothing is touched."""
    before = block(without=((1, 1, 1), (2, 2, 2)))
    found = manifold(before.points, before.tets, reach=CELL, worst=70.0)
    assert found.mended == 0
    assert found.pinched == pytest.approx(np.full((1, 3), 2 * CELL))
    assert np.array_equal(found.tets, before.tets)

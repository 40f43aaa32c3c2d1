"""The tables of the lattice: every pattern of signs, every junction of regions, any cuts."""

from itertools import combinations

import numpy as np
import pytest
from autophyx_tet.fem.mesh import boundary_faces, signed_volumes
from autophyx_tet.toolkit.meshing.stuffing.lattice import (
    EDGES,
    NodeField,
    lattice_around,
    tets_around,
)
from autophyx_tet.toolkit.meshing.stuffing.mesher import CORNERS, cut, patterns, stencil

MIRRORS = [np.array(signs) for signs in ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, -1))]


def test_both_sides_of_every_pattern_fill_the_tet():
    """Inside and outside, cut anywhere, add up to the tet; no piece is turned over."""
    rng = np.random.default_rng(0)
    for signs in patterns():
        if not any(signs):
            continue
        here, there = stencil(signs), stencil(tuple(-s for s in signs))
        for mirror in MIRRORS:
            points = CORNERS * mirror
            share = rng.uniform(0.01, 0.99, (len(EDGES), 1))
            ends = np.array(EDGES)
            points[4:] = (1 - share) * points[ends[:, 0]] + share * points[ends[:, 1]]
            whole = signed_volumes(points, np.array([[0, 1, 2, 3]]))[0]
            pieces = signed_volumes(points, np.array([*here, *there]))
            assert (pieces * np.prod(mirror) > 0).all(), signs
            assert pieces.sum() == pytest.approx(whole), signs


def test_both_sides_of_every_pattern_share_the_surface():
    """The triangles between inside and outside are the same seen from either."""

    def surface(signs):
        on = {i for i in range(4) if signs[i] == 0} | set(range(4, 10))
        return {face for tet in stencil(signs) for face in combinations(sorted(tet), 3)
                if set(face) <= on}  # fmt: skip

    for signs in patterns():
        if min(signs) < 0 < max(signs):
            assert surface(signs) == surface(tuple(-s for s in signs)), signs


def test_lattice_tets_are_oriented_and_fill_space():
    """12 tets of 1/12 a cube; A exceeds C in an even number of coordinates in all of them."""
    lattice = lattice_around(np.array([[0.0, 0, 0], [3, 2, 4]]))
    tets, mirrored = tets_around(lattice, np.ones(lattice.node_count, dtype=bool))
    nodes = lattice.nodes()
    volume = signed_volumes(nodes, tets)
    assert np.abs(volume) == pytest.approx(1 / 12)
    assert ((volume < 0) == mirrored).all()
    assert not ((nodes[tets[:, 0]] > nodes[tets[:, 2]]).sum(axis=1) % 2).any()


class RandomRegions(NodeField):
    """In place of distances: any region at any node, any cut of any edge."""

    def __init__(self, lattice, regions, rng):
        self.where, self._regions, self._rng = lattice.nodes(), regions, rng

    def regions(self, offsets):
        return self._regions

    def crossings(self, ends, regions, offsets):
        return self._rng.uniform(0.001, 0.999, len(ends))

    def region_at(self, where, offsets):
        return np.ones(len(where), dtype=int)


@pytest.mark.parametrize("seed", range(4))
def test_random_regions_conform(seed):
    """Five regions at random: positive tets that fill the lattice, whose hull alone bounds them.

    A face that two neighbours divide otherwise would bound both. The nodes near the hull are of one
    region, so that it stays as it is. Tets of four moved nodes are left out where they are flat,
    which opens a hole: the cuts are kept off the nodes in every second case.
    """
    rng = np.random.default_rng(seed)
    lattice = lattice_around(np.array([[0.0, 0, 0], [4, 5, 6]]))
    nodes = lattice.nodes()
    regions = rng.integers(1, 6, len(nodes))
    regions[(np.abs(nodes - [2, 2.5, 3]) > [1.6, 2.1, 2.6]).any(axis=1)] = 1
    field = RandomRegions(lattice, regions, rng)
    if seed % 2:
        field.crossings = lambda ends, *_: rng.uniform(0.42, 0.58, len(ends))
    mesh = cut(lattice, field, np.zeros(1))
    assert (mesh.volumes > 0).all()
    whole, _ = tets_around(lattice, np.ones(len(nodes), dtype=bool))
    hull = boundary_faces(whole).faces
    if seed % 2:
        assert mesh.volumes.sum() == pytest.approx(len(whole) / 12)
        found = boundary_faces(mesh.tets).faces
        assert sorted(map(tuple, np.sort(mesh.points[found].mean(axis=1)).round(6))) == sorted(
            map(tuple, np.sort(nodes[hull].mean(axis=1)).round(6))
        )
    faces = np.sort(mesh.tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3))
    assert np.unique(faces, axis=0, return_counts=True)[1].max() <= 2

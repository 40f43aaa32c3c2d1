"""Volumes of shells on a lattice: of many, beside hopeless ones, once for every lattice."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids
from autophyx_tet.toolkit.meshing.stuffing import mesher
from autophyx_tet.toolkit.meshing.stuffing.lattice import SolidField
from autophyx_tet.toolkit.meshing.stuffing.mesher import own_volumes, stuff, wanted_volumes
from autophyx_tet.toolkit.meshing.stuffing.pieces import LONGEST, WIDER, narrowest

from .test_stuffing import turned
from .test_tetrahedralize import asset_of

EDGE = 0.05


def bench():
    """Six turned planks of one to three long edges, and four nails of a fifth of one."""
    planks = {
        f"plank {i}": turned(trimesh.creation.box((0.5, 0.2, EDGE * (1 + i % 3))), i)
        for i in range(6)
    }
    nails = {
        f"nail {i}": turned(trimesh.creation.cylinder(EDGE / 10, 2 * EDGE, sections=8), i)
        for i in range(4)
    }
    bodies = planks | nails
    for i, body in enumerate(bodies.values()):
        body.apply_translation((0.6 * i, 0.013 * i, 0.017 * i))  # not alike on the lattice
    asset = asset_of(**bodies)
    return Solids.of(repair(asset.parts)[0], len(bodies), thinnest=1e-6), len(planks)


@pytest.mark.slow
def test_what_no_lattice_holds_does_not_decide_over_the_rest():
    """Planks get their volumes to 1 % beside nails that are off by anything."""
    solids, thick = bench()
    found = stuff(SolidField(solids, origin=solids.bounds[0], edge=EDGE))
    assert np.abs(found.errors[:thick]).max() < 0.01  # the largest shells come first
    assert np.abs(found.errors[thick:]).max() > 0.05
    assert found.misplaced < 0.01


@pytest.mark.slow
def test_a_volume_is_sampled_once_for_all_lattices():
    """And is the same in metres whatever the edge; beads come on top of it."""
    solids, _ = bench()
    own = own_volumes(solids)
    assert own_volumes(solids) is own
    for edge in (0.05, 0.11):
        field = SolidField(solids, origin=solids.bounds[0], edge=edge)
        assert wanted_volumes(field) * edge**3 == pytest.approx(own, rel=1e-12)
    beads = solids.bounds.mean(axis=0)[None]
    field = SolidField(solids, origin=solids.bounds[0], edge=0.05, beads=np.repeat(beads, 2, 0))
    assert (wanted_volumes(field) * 0.05**3 - own).sum() == pytest.approx(
        field.added.sum() * 0.05**3, rel=1e-9
    )


@pytest.mark.slow
def test_a_search_that_begins_where_one_ended_is_over_at_once(monkeypatch):
    """The second lattice of one body, with beads or none, needs one pass."""
    rod = turned(trimesh.creation.cylinder(0.04, 1, sections=48))
    solids = Solids.of(repair(asset_of(rod=rod).parts)[0], 1, thinnest=1e-6)
    passes, cut = [], mesher.cut
    monkeypatch.setattr(mesher, "cut", lambda *given: passes.append(1) or cut(*given))
    field = SolidField(solids, origin=solids.bounds[0], edge=EDGE)
    first = stuff(field)
    needed = len(passes)
    again = stuff(field, offsets=first.offsets)
    assert needed > 2
    assert len(passes) - needed <= 2  # GOOD of a first pass is less than GOOD_ENOUGH of a last one
    assert again.error <= 0.009


def test_gaps_are_those_that_all_distances_give():
    """Beside the distances of all places to all pieces, with pieces of one tet and of none."""
    rng = np.random.default_rng(0)
    where, edge = rng.random((500, 3)), 0.15
    pieces = [rng.random(3) + 0.05 * rng.random((n, 3)) for n in (1, 40, 7, 0, 90, 3, 1)]
    distance = np.array(
        [
            np.linalg.norm(where[:, None] - piece, axis=-1).min(axis=1, initial=np.inf)
            for piece in pieces
        ]
    ).T
    ends = np.sort(np.argsort(distance, axis=1)[:, :2], axis=1)
    width = np.sort(distance, axis=1)[:, :2].sum(axis=1)
    wanted = {}
    for pair in {tuple(one) for one in ends.tolist()}:
        mine = np.where((ends == pair).all(axis=1), width, np.inf)
        if mine.min() <= LONGEST * edge:
            wanted[pair] = where[mine <= min(mine.min() + WIDER * edge, LONGEST * edge)]
    found = {tuple(pair.tolist()): places for pair, places in narrowest(where, pieces, edge)}
    assert len(found) > 3
    assert found.keys() == wanted.keys()
    assert all(np.array_equal(found[pair], wanted[pair]) for pair in found)

"""What the guarantees measure: distances of bodies that are known to differ."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.predictors.asset import Part
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids
from autophyx_tet.toolkit.meshing.guarantees import SHARE_TOLD, measure_distances

EPSILON = 0.02


def _gaps(mesh, *meshes):
    surface, _ = repair([Part(str(i), m) for i, m in enumerate(meshes)])
    solids = Solids.of(surface, len(meshes), thinnest=1e-4)
    return measure_distances(mesh, solids, epsilon=EPSILON, rng=np.random.default_rng(0))


def _cube(size=(1, 1, 1), at=(0.5, 0.5, 0.5)):
    return trimesh.creation.box(size, transform=trimesh.transformations.translation_matrix(at))


def test_the_same_body_is_at_no_distance():
    gaps = _gaps(box_mesh((1, 1, 1), (4, 4, 4)), _cube())
    assert gaps.largest == pytest.approx(0, abs=1e-12)
    assert gaps.good(EPSILON)


def test_a_larger_input_is_as_far_as_it_is_larger():
    """A wall 0.1 beyond the mesh: both distances are 0.1, at its corners and everywhere."""
    gaps = _gaps(box_mesh((1, 1, 1), (4, 4, 4)), _cube((1.1, 1, 1), (0.55, 0.5, 0.5)))
    assert gaps.from_input == pytest.approx(0.1, rel=1e-6)
    assert gaps.to_input == pytest.approx(0.1, rel=1e-6)
    assert not gaps.good(EPSILON)


def test_a_lost_block_is_a_distance_and_a_lost_sheet_of_metal_a_share():
    """A block thicker than epsilon that has no tets fails; a thinner plate is counted by area."""
    body = box_mesh((1, 1, 1), (4, 4, 4))
    block = _gaps(body, _cube(), _cube((0.2, 0.2, 0.2), (2, 0.5, 0.5)))
    assert block.from_input > 0.9
    assert block.part_from == 1
    plate = _gaps(body, _cube(), _cube((0.5, 0.5, 0.5 * EPSILON), (2, 0.5, 0.5)))
    assert plate.from_input <= EPSILON
    area = 2 * 0.5 * 0.5 + 4 * 0.5 * 0.5 * EPSILON
    assert plate.missed_share == pytest.approx(area / (6 + area), rel=0.1)
    assert plate.missed_share > SHARE_TOLD
    assert not plate.good(EPSILON)

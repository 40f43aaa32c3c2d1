"""The layer under a surface: closed forms of its volume and of its second moment."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.asset.solids import hull_fraction, wall_fraction
from trimesh import creation

K = 0.9
# A box, a plate (its shortest axis is z) and a long tube with its ends: the inner body taken away.
BOX = creation.box((1, 2, 3)), 0.1, 1 - 0.8 * 1.8 * 2.8 / 6, 1 - 0.8**3 * 1.8 * 2.8 / 6
PLATE = creation.box((1, 1, 0.1)), 0.005, 1 - 0.99**2 * 0.9, 1 - 0.99**2 * 0.9**3
TUBE = (
    creation.cylinder(0.1, 3, sections=96), 0.01,
    1 - K**2 * 2.98 / 3, 1 - K**4 * 2.98 / 3,
)  # fmt: skip


@pytest.mark.parametrize(("mesh", "wall", "volume", "bending"), [BOX, PLATE, TUBE])
def test_shares_of_a_wall(mesh, wall, volume, bending):
    """Shares within 3 %: 16,000 samples are good to half a per cent, the tube's polygon to one."""
    turned = trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.6, 0.9]))
    body = mesh.copy().apply_transform(turned)
    found = wall_fraction(np.asarray(body.vertices), np.asarray(body.faces), wall)
    assert found.volume == pytest.approx(volume, rel=0.03)
    assert found.bending == pytest.approx(bending, rel=0.03)


def test_a_wall_of_half_the_thickness_is_all():
    """Nothing is counted twice: a wall deeper than the middle is the solid, to a per cent."""
    box = creation.box((1, 2, 3))
    found = wall_fraction(np.asarray(box.vertices), np.asarray(box.faces), 0.8)
    assert found.volume == pytest.approx(1, abs=0.03)
    assert found.volume <= 1


def test_hull_share_tells_a_tube_from_a_ball():
    """A tube with a wall of a tenth of its radius fills 1 - .9^2 of its hull, a ball all of it."""
    tube, ball = creation.annulus(0.9, 1, 2, sections=64), creation.icosphere(2)
    assert hull_fraction(tube.vertices, tube.faces) == pytest.approx(1 - K**2, rel=1e-6)
    assert hull_fraction(ball.vertices, ball.faces) == pytest.approx(1)

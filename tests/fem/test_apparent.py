"""Apparent materials against bending of what they stand for."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.fem.table import MaterialValue, WallShare, apparent_material

from .bodies import faces_at

WALL = MaterialValue(2e11, 0.3, 7850.0)
SIZE, CELLS = (1.0, 0.1, 0.1), (8, 5, 5)
K = 0.6  # inner by outer side: the wall is one of five cells
CORE = 1e-4  # of the wall's E: the room inside, which keeps the system regular


def tip(mesh):
    """Displacement [m] of the tip of a cantilever along x under a load across it."""
    held = Supports.none(len(mesh.points)).with_fixed(mesh.points[:, 0] < 1e-9, (0, 1, 2))
    load = Traction(faces_at(mesh, 0, SIZE[0]), np.array([0, 0, 1e5]))
    result = solve_static(mesh, held, traction=load, order=2)
    return result.displacement[mesh.points[:, 0] > SIZE[0] - 1e-9, 2].mean()


def test_a_square_tube_bends_as_the_solid_that_stands_for_it():
    """A cantilever of square tube by elements, and a solid one of the apparent E: one tip.

    beta = 1 - k^4. The tube has more shear, which is no part of the law: 3 to 4 % at this length.
    """
    solid = box_mesh(SIZE, CELLS)
    middle = np.abs(solid.points[solid.tets].mean(axis=1)[:, 1:] - 0.05).max(axis=1)
    core = middle < K * 0.05
    E = np.where(core, CORE, 1) * WALL.E
    fields = np.full(len(E), WALL.nu), np.full(len(E), WALL.rho)
    tube = solid.with_material(ElementMaterial(E, *fields))
    apparent = apparent_material(WALL, WallShare(1 - K**2, 1 - K**4))
    one = ElementMaterial.uniform(len(E), **apparent._asdict())
    assert apparent.rho * solid.volume == pytest.approx((tube.volumes * WALL.rho)[~core].sum())
    assert tip(solid.with_material(one)) == pytest.approx(tip(tube), rel=0.05)


def test_filling_adds_its_mass_and_stiffness():
    """rho and E of wall and core side by side; a core of the wall's own material is the solid."""
    share = WallShare(0.1, 0.27)
    found = apparent_material(WALL, share, inside_rho=WALL.rho, inside_E=WALL.E)
    assert found == pytest.approx(WALL)
    water = apparent_material(WALL, share, inside_rho=1000.0)
    assert water.rho == pytest.approx(785 + 900)
    assert water.E == pytest.approx(0.27 * WALL.E)


@pytest.mark.parametrize("share", [(0.0, 0.5), (0.5, 1.1), (float("nan"), 0.5)])
def test_shares_are_shares(share):
    with pytest.raises(InputError, match="share of the"):
        WallShare(*share)

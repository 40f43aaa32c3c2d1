"""Laws of bodies under load: what leaves the displacement alone leaves the pictures alone."""

from itertools import pairwise

import numpy as np
import pytest
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.research.evaluation.sag_render import SLOPE, SagRender, slowest_period, swing
from autophyx_tet.research.voxels import voxel_mesh

pytestmark = pytest.mark.usefixtures("one_thread")
PART = np.full((8, 8, 12), -1)
PART[2:6, 2:6, :8], PART[1:7, 1:7, 8:11] = 0, 1  # a table of one leg


def values(leg, top) -> np.ndarray:
    """Normalised (log E, nu, log rho) of every voxel."""
    rows = np.array([DEFAULT.normalise(*leg), DEFAULT.normalise(*top)])
    return np.where((PART >= 0)[..., None], rows[PART.clip(min=0)], 0.0)


TRUTH = values((1e7, 0.3, 400.0), (1e9, 0.3, 700.0))


@pytest.fixture(scope="module")
def sag() -> SagRender:
    """The true table under its load."""
    return SagRender(PART, TRUTH)


@pytest.mark.slow
def test_the_true_body_is_like_itself(sag):
    """The same values give the same pictures."""
    assert sag.similarity(TRUTH) == pytest.approx((54.15, 1.0), abs=0.01)


def test_stiffness_and_weight_together_change_nothing(sag):
    """u is proportional to rho g / E: ten times both is the same displacement."""
    both = values((1e8, 0.3, 4000.0), (1e10, 0.3, 7000.0))
    assert sag.similarity(both) == pytest.approx(sag.similarity(TRUTH), abs=0.02)


def test_the_softer_the_less_alike(sag):
    """The similarity falls with the error of E; so it does with a weight that is wrong."""
    legs = [(1e7 / factor, 0.3, 400.0) for factor in (1.0, 1.2, 2.0, 4.0)]
    seen = [sag.similarity(values(leg, (1e9, 0.3, 700.0))) for leg in legs]
    assert all(a.psnr > b.psnr and a.ssim > b.ssim for a, b in pairwise(seen))
    heavy = sag.similarity(values((1e7, 0.3, 400.0), (1e9, 0.3, 1400.0)))
    assert heavy.psnr < sag.similarity(TRUTH).psnr - 10


def test_a_column_that_is_let_go_swings_about_its_rest():
    """Pulled along its axis at once a rod of length L moves by 2 rho g / E (L - z/2) z at most.

    Its first period is 4 L sqrt(rho / E); u(t) = 16 rho g L^2 / (pi^3 E) sum 1/n^3 (1 - cos n w t)
    at the tip, n odd: the rest rho g L^2 / 2 E in the mean, twice that after half a period.
    """
    L, E, rho, g = 1.0, 1e6, 1000.0, 1.0
    rod = box_mesh((0.1, 0.1, L), (1, 1, 40))
    rod = rod.with_material(ElementMaterial(*(np.full(len(rod.tets), x) for x in (E, 0.0, rho))))
    held = Supports.clamp(len(rod.points), rod.points[:, 2] < 1e-9)
    down = np.array([0.0, 0.0, -g])
    period, rest = 4 * L * (rho / E) ** 0.5, rho * g * L**2 / (2 * E)
    found = swing(rod, held, down, period=period, steps=64)
    tip = -found[:, rod.points[:, 2] > L - 1e-9, 2].mean(axis=1)
    # Elements and steps are of second order: 1/40 and 1/64 of the wave.
    assert tip[32] == pytest.approx(2 * rest, rel=0.01)
    assert tip[:-1].mean() == pytest.approx(rest, rel=0.01)
    assert abs(tip[64]) < 0.02 * rest
    still = solve_static(rod, held, gravity_vector=SLOPE, order=1).displacement
    assert slowest_period(rod, still) > period  # it bends more slowly than it is stretched


@pytest.mark.slow
def test_motions_are_alike_where_stiffness_and_weight_are():
    """Ten times E and rho is the same motion; it falls out of step the more, the stiffer it is."""
    sag = SagRender(PART, TRUTH, swing=True)
    assert sag.similarity(TRUTH) == pytest.approx((54.15, 1.0), abs=0.01)
    both = values((1e8, 0.3, 4000.0), (1e10, 0.3, 7000.0))
    assert sag.similarity(both) == pytest.approx(sag.similarity(TRUTH), abs=0.02)
    legs = [(1e7 * factor, 0.3, 400.0) for factor in (1.0, 1.05, 1.2, 1.5)]
    seen = [sag.similarity(values(leg, (1e9, 0.3, 700.0))) for leg in legs]
    assert all(a.psnr > b.psnr and a.ssim > b.ssim for a, b in pairwise(seen))


def test_voxels_are_filled_with_tets():
    """The tets of the occupied cells have their volume, and every cell its six in order."""
    occupied = PART >= 0
    mesh = voxel_mesh(occupied)
    assert mesh.volume == pytest.approx(occupied.sum() / 12**3)
    centre = mesh.centroids.reshape(-1, 6, 3).mean(axis=1)
    assert np.allclose(np.floor(centre * 12), np.argwhere(occupied))

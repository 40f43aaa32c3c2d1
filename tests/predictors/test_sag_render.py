"""Laws of bodies under load: what leaves the displacement alone leaves the pictures alone."""

from itertools import pairwise

import numpy as np
import pytest
from autophyx_tet.predictors.evaluation.sag_render import SagRender
from autophyx_tet.predictors.normalisation import DEFAULT
from autophyx_tet.predictors.voxels import voxel_mesh

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


def test_voxels_are_filled_with_tets():
    """The tets of the occupied cells have their volume, and every cell its six in order."""
    occupied = PART >= 0
    mesh = voxel_mesh(occupied)
    assert mesh.volume == pytest.approx(occupied.sum() / 12**3)
    centre = mesh.centroids.reshape(-1, 6, 3).mean(axis=1)
    assert np.allclose(np.floor(centre * 12), np.argwhere(occupied))

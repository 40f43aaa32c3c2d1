"""Laws of PSNR and SSIM: where both are known in closed form."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.research.evaluation.ssim import FINEST, K1, image_similarity, psnr, ssim

PLAIN = np.full((24, 30, 3), 0.4)
NOISE = np.random.default_rng(0).random((24, 30, 3))


def test_the_same_picture():
    """No error is half a grey level at most, and the structure is the same."""
    assert image_similarity(NOISE, NOISE) == pytest.approx((-10 * np.log10(FINEST), 1.0))


def test_psnr_of_an_offset():
    """An error d everywhere is -20 log10 d."""
    assert psnr(NOISE + 0.03, NOISE) == pytest.approx(-20 * np.log10(0.03))


def test_ssim_of_plain_pictures():
    """Without structure SSIM is its first factor: (2ab + C1) / (a^2 + b^2 + C1)."""
    wanted = (2 * 0.4 * 0.7 + K1**2) / (0.4**2 + 0.7**2 + K1**2)
    assert ssim(PLAIN + 0.3, PLAIN) == pytest.approx(wanted)


def test_ssim_of_a_negative():
    """A negative has the opposite structure; SSIM is symmetric, and less than 1 for others."""
    assert ssim(1 - NOISE, NOISE) < -0.8
    assert ssim(1 - NOISE, NOISE) == pytest.approx(ssim(NOISE, 1 - NOISE))
    assert 0 < ssim(0.5 * NOISE + 0.25, NOISE) < 1


def test_a_picture_too_small_is_refused():
    """A picture smaller than the window has no SSIM."""
    with pytest.raises(InputError, match="sides > 10"):
        image_similarity(PLAIN[:9], PLAIN[:9])

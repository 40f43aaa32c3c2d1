"""Bodies of cells that heads of skinning are trained on, and what counts as moving them well."""

import numpy as np
import pytest
import torch
from autophyx_tet.research.datasets.objects import Objects
from autophyx_tet.research.datasets.shapes import MAX_PARTS, Solid, pack
from autophyx_tet.research.training.unipixie.simplicits import (
    BODY_HASH,
    FEATURES,
    HANDLES,
    frozen_body,
    hash_of,
)
from autophyx_tet.research.training.unipixie.skinning import (
    NU,
    CellBodies,
    cell_bodies,
    cell_stiffness,
    compliance_share,
)

CORNERS = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), -1).reshape(-1, 3)


def work(u: np.ndarray) -> float:
    """Twice the energy of a unit cube whose corners move by ``u`` (8, 3)."""
    return float(u.ravel() @ cell_stiffness().reshape(24, 24) @ u.ravel())


def test_a_cell_has_the_energy_of_an_even_strain():
    """W = lam tr(e)^2 / 2 + mu e:e of any displacement gradient; none of a rigid motion."""
    lam, mu = NU / ((1 + NU) * (1 - 2 * NU)), 1 / (2 * (1 + NU))
    H = np.random.default_rng(0).normal(size=(3, 3))
    e = (H + H.T) / 2
    assert work(CORNERS @ H.T) == pytest.approx(lam * np.trace(e) ** 2 + 2 * mu * (e * e).sum())
    assert work(CORNERS @ (H - H.T) + H[0]) == pytest.approx(0, abs=1e-12)  # round-off


def test_a_cell_bends_as_a_beam_does():
    """u = (-x z, 0, x^2 / 2) of a slice with free sides: its energy is E I k^2, I = 1 / 12.

    Wilson's modes give it without locking, but for what an even nu holds back: nothing at nu 0,
    at .3 at most 1 / (1 - nu^2), a plate's.
    """
    x, _, z = (CORNERS - 0.5).T
    bent = np.stack([-x * z, 0 * x, 0 * x], axis=1)
    assert 1 <= 12 * work(bent) <= 1.0001 / (1 - NU**2)


def bars(*stiffness: float) -> CellBodies:
    """The same bar of two parts, the second of other E."""
    solid = Solid()
    solid.box("a", (0, 0, 0), (0.5, 0.05, 0.05))
    solid.box("b", (1, 0, 0), (0.5, 0.05, 0.05))
    count = len(stiffness)
    kinds = np.zeros((count, MAX_PARTS), dtype=np.int64)
    objects = Objects(pack([solid] * count), kinds, np.zeros(count, dtype=np.int64))
    E = np.ones((count, MAX_PARTS))
    E[:, 1] = stiffness
    return cell_bodies(objects, E, "cpu")


def thetas(count: int) -> torch.Tensor:
    dice = torch.Generator().manual_seed(0)
    return torch.randn(count, (FEATURES + 1) * HANDLES, generator=dice, dtype=torch.float64) / 8


def test_handles_can_only_help_and_never_pass_the_full_body():
    """Ritz: a subspace has less compliance, and a larger one has more."""
    bodies, theta = bars(1.0, 0.01), thetas(2)
    few = torch.cat([theta[:, : FEATURES * HANDLES].unflatten(1, (FEATURES, HANDLES))], 1).clone()
    few[:, :, 5:] = 0
    few = torch.cat([few.flatten(1), theta[:, FEATURES * HANDLES :]], 1)
    none, some, all_ = (compliance_share(t, bodies) for t in (0 * theta, few, theta))
    assert (none < some).all()
    assert (some < all_ + 1e-6).all()  # the shift of dependent fields
    assert (all_ < 1).all()
    assert (none > 0).all()


def test_mixed_handles_move_the_body_alike():
    """Any regular mixture of the handles spans the same motions: no theta is a target."""
    bodies, theta = bars(1.0, 0.01), thetas(2)
    mix = torch.linalg.qr(torch.randn(HANDLES, HANDLES, dtype=torch.float64))[0] @ torch.diag(
        torch.linspace(0.5, 2, HANDLES, dtype=torch.float64)
    )
    head = theta.unflatten(1, (FEATURES + 1, HANDLES)) @ mix
    torch.testing.assert_close(
        compliance_share(head.flatten(1), bodies), compliance_share(theta, bodies),
        rtol=1e-3, atol=0,  # the shift of dependent fields
    )  # fmt: skip


def test_one_stiffness_is_as_good_as_another():
    """The share has no unit: a body ten times softer throughout is moved as well."""
    same = bars(1.0, 1.0)
    theta = thetas(1).expand(2, -1)
    found = compliance_share(theta, same._replace(stiff=same.stiff / 10, full=10 * same.full))
    torch.testing.assert_close(found, compliance_share(theta, same), rtol=1e-6, atol=0)


def test_the_body_is_the_one_of_the_hash():
    """Its numbers are drawn anew here, and any other number has another hash."""
    body = frozen_body()
    assert hash_of(body) == BODY_HASH
    changed = body[0]._replace(b=body[0].b + np.float32(1e-6))
    assert hash_of((changed, *body[1:])) != BODY_HASH

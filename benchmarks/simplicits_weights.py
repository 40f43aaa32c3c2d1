"""Skinning weights as Simplicits makes them: a small network trained on the body's elastic energy.

Written after the paper (Modi et al. 2024) for comparison, with the settings that Kaolin publishes:
ten handles, 10,000 steps of Adam at 1e-3, ten random poses of 1,000 places a step, elastic energy
(from Hooke's to the neo-Hookean law) times .1 and orthogonality times 1e6. Two kindnesses: energies
are those of the real shape, not of its box stretched to a cube, and of moduli over the softest one
at 1e5 Pa, so that neither loss drowns the other whatever the material is.
"""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from autophyx_tet.fem.mesh import TetMesh

HANDLES, WIDTH, HIDDEN, STEPS = 10, 64, 9, 10_000
POSES, PLACES, POSE_SIZE = 10, 1000, 0.1
RATE, ELASTIC, ORTHOGONAL, SOFTEST = 1e-3, 0.1, 1e6, 1e5
# Places in the body that those of a step are drawn from.
DRAWN = 20_000


def network():
    """Layers of the network, 3 -> 64, eight times 64 -> 64, 64 -> 10, as torch draws them."""
    import torch

    torch.manual_seed(0)
    sizes = [3, *[WIDTH] * HIDDEN, HANDLES]
    return torch.nn.ModuleList(torch.nn.Linear(a, b) for a, b in itertools.pairwise(sizes))


def with_gradients(layers, x):
    """Weights (n, handles) at ``x`` (n, 3), and their derivatives (3, n, handles), forward."""
    import torch

    slopes = torch.eye(3, device=x.device)[:, None, :].expand(3, len(x), 3)
    for layer in layers[:-1]:
        x, slopes = layer(x), slopes @ layer.weight.T
        slopes = slopes * torch.where(x > 0, torch.ones_like(x), torch.exp(x))
        x = torch.nn.functional.elu(x)
    return layers[-1](x), slopes @ layers[-1].weight.T


def energies(H, lam, mu, share: float):
    """Energy densities of displacement gradients ``H`` (..., 3, 3): Hooke's and neo-Hookean."""
    import torch

    trace = H.diagonal(dim1=-2, dim2=-1).sum(-1)
    square = (H**2).sum((-1, -2))
    cross = (H * H.transpose(-1, -2)).sum((-1, -2))
    linear = mu * (square + cross) / 2 + lam / 2 * trace**2
    grown = torch.linalg.det(H + torch.eye(3, device=H.device)) - 1
    finite = mu / 2 * (2 * trace + square) - mu * grown + (lam + mu) / 2 * grown**2
    return share * finite + (1 - share) * linear


def trained_weights(
    points: np.ndarray, tets: np.ndarray, E: np.ndarray, nu: np.ndarray, steps: int = STEPS
) -> np.ndarray:
    """Weights (points, handles) of a network trained so many steps on a body of tets.

    ``points`` (points, 3) [m], ``tets`` (tets, 4), ``E`` [Pa] and ``nu`` [1] of each; on a GPU
    where there is one.
    """
    import torch

    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.set_num_threads(1)
    lo, side = points.min(axis=0), np.ptp(points, axis=0)
    corners = points[tets]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    rng = np.random.default_rng(0)
    drawn = rng.choice(len(tets), DRAWN, p=volumes / volumes.sum())
    mixed = rng.dirichlet(np.ones(4), DRAWN)
    places = np.einsum("na,nai->ni", mixed, corners[drawn]) - lo

    def tensor(array: np.ndarray):
        return torch.tensor(array, dtype=torch.float32, device=device)

    soft = SOFTEST * E / E.min()
    lam, mu = (
        tensor((soft * nu / ((1 + nu) * (1 - 2 * nu)))[drawn]),
        tensor((soft / 2 / (1 + nu))[drawn]),
    )
    cubed, real = tensor(places / side), tensor(places / side.max())
    affine = torch.cat([real, torch.ones_like(real[:, :1])], 1)
    stretch = tensor(side.max() / side)[:, None, None]
    volume = float(volumes.sum() / side.max() ** 3)
    layers = network().to(device)
    adam = torch.optim.Adam(layers.parameters(), RATE)
    diagonal, apart = torch.eye(3, 4, device=device), torch.eye(HANDLES, device=device)
    for step in range(steps):
        now = torch.randint(DRAWN, (PLACES,), device=device)
        w, slopes = with_gradients(layers, cubed[now])
        # Gradients (j, places, handles, 4) of w_h (x, y, z, 1).
        G = (stretch * slopes)[..., None] * affine[now][None, :, None, :]
        G = G + w[None, :, :, None] * diagonal[:, None, None, :]
        poses = POSE_SIZE * torch.randn(POSES, 3, 4 * HANDLES, device=device)
        H = torch.einsum("bia,jna->bnij", poses, G.reshape(3, PLACES, -1))
        elastic = energies(H, lam[now], mu[now], step / steps).sum() * volume / PLACES
        orthogonal = torch.nn.functional.mse_loss(w.T @ w, apart)
        adam.zero_grad()
        (ELASTIC * elastic + ORTHOGONAL * orthogonal).backward()
        adam.step()
    with torch.no_grad():
        return with_gradients(layers, tensor((points - lo) / side))[0].cpu().numpy().astype(float)


def kept_weights(name: str, mesh: TetMesh, folder: Path) -> tuple[np.ndarray, float]:
    """Weights of the body ``name``, and the CPU seconds that it took to train them, once.

    Later calls read ``folder``, as they do of the meshes.
    """
    from autophyx_tet.converters.npz import load_npz

    path = folder / f"simplicits-{name}.npz"
    if not path.exists():
        started = time.process_time()
        weights = trained_weights(mesh.points, mesh.tets, mesh.material.E, mesh.material.nu)
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(path, weights=weights, seconds=time.process_time() - started)
    known = load_npz(path)
    return known["weights"], float(known["seconds"])

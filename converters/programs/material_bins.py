"""Binned materials, for targets that know one material a group of tets; and names of arrays."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError, UsageError
from ...fem.material import ElementMaterial
from ...fem.mesh import TetMesh, material_of

log = logging.getLogger(__name__)

NameStyle = Literal["symbols", "usd", "vomp", "pixie", "newton"]

# What E, nu, rho are called on export. Newton takes the Lame parameters instead.
NAMES: dict[str, tuple[str, str, str]] = {
    "symbols": ("E", "nu", "rho"),
    "usd": ("youngsModulus", "poissonsRatio", "density"),
    "vomp": ("youngs_modulus", "poisson_ratio", "density"),
    "pixie": ("E", "nu", "density"),
}
_ITERATIONS = 30
# Decimals of log10 E, nu and log10 rho that tell two materials apart: values of one part that went
# through a field differ in the last bits of fp64, and are one material.
_DIGITS = 9


class BinError(NamedTuple):
    """What binning changed: largest and volume-weighted mean |change|, for each of E, nu, rho.

    E and rho in decades (log10), nu plainly.
    """

    largest: tuple[float, float, float]
    mean: tuple[float, float, float]


class BinGrain(NamedTuple):
    """``axes`` and ``constants`` of every bin as an ``ElementMaterial`` has them; 0: no grain."""

    axes: Float[np.ndarray, "bins 3 3"]
    constants: Float[np.ndarray, "bins 9"]


@dataclass(frozen=True, eq=False)
class Bins:
    """One material a bin: ``E`` [Pa], ``nu``, ``rho`` [kg/m^3] (bins,), ``label`` (tets,).

    ``grain`` is theirs where it was asked for and some have one.
    """

    E: Float[np.ndarray, "bins"]
    nu: Float[np.ndarray, "bins"]
    rho: Float[np.ndarray, "bins"]
    label: Int[np.ndarray, "tets"]
    error: BinError
    grain: BinGrain | None = None

    def __len__(self) -> int:
        return len(self.E)

    @property
    def material(self) -> ElementMaterial:
        """The binned material of every tet."""
        return ElementMaterial(self.E[self.label], self.nu[self.label], self.rho[self.label])


def bin_materials(mesh: TetMesh, *, bins: int = 64, grain: bool = False) -> Bins:
    """Group tets of like (log10 E, nu, log10 rho); exact where there are no more than ``bins``.

    Otherwise by k-means. A bin has the mean log10 E, mean nu and mean rho of its volume, so that
    the mass stays the same. With ``grain``, tets of a bin share its axes and its constants over E.

    Raises UsageError: Where the grain runs in more ways than there are bins.
    """
    if bins < 1:
        raise InputError("material_bins.bins_must", bins=bins)
    material = material_of(mesh)
    exact = np.stack([material.E, material.nu, material.rho], axis=1)
    plain = np.stack([np.log10(material.E), material.nu, np.log10(material.rho)], axis=1)
    rounded = np.round(plain, _DIGITS)
    way = np.zeros(len(exact), dtype=np.int64)
    if grain and material.axes is not None:
        # Tets whose axes and constants over E agree share one way
        constants = material.constants.copy()
        constants[:, :6] /= material.E[:, None]
        both = np.round(np.column_stack([material.axes.reshape(-1, 9), constants]), _DIGITS)
        way = np.unique(both, axis=0, return_inverse=True)[1].ravel()
    if (ways := way.max() + 1) > bins:
        raise UsageError("material_bins.bins_grain", bins=bins, ways=ways)
    keyed = np.column_stack([way, rounded])
    rows, first, label = np.unique(keyed, axis=0, return_index=True, return_inverse=True)
    if len(rows) <= bins:
        none = BinError((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        known = _bin_grain(material, first, exact[first, 0]) if grain else None
        return Bins(*exact[first].T, label=label.ravel(), error=none, grain=known)
    # By k-means among those of one way; ways share the bins as they differ within
    weight, label, used = mesh.volumes, np.zeros(len(keyed), dtype=np.int64), 0
    kinds = [len(np.unique(keyed[way == w], axis=0)) - 1 for w in range(ways)]
    for w, kind in enumerate(kinds):
        own = way == w
        room = 1 + (bins - len(kinds)) * kind // max(sum(kinds), 1)
        label[own] = used + _cluster(keyed[own, 1:], weight[own], room)
        used = label[own].max() + 1
    share = np.bincount(label, weight)
    logE, nu, rho = (
        np.bincount(label, weight * values) / share
        for values in (plain[:, 0], plain[:, 1], material.rho)
    )
    change = np.abs(np.stack([logE, nu, np.log10(rho)], axis=1)[label] - plain)
    error = BinError(_three(change.max(axis=0)), _three(weight @ change / weight.sum()))
    log.info("binned %d materials into %d: %s", len(rows), len(share), error)
    one = np.unique(label, return_index=True)[1]
    return Bins(
        10**logE, nu, rho, label, error, _bin_grain(material, one, 10**logE) if grain else None
    )


def _bin_grain(material: ElementMaterial, first: np.ndarray, E: np.ndarray) -> BinGrain | None:
    """Grain of bins of ``E`` [Pa] whose first tets are ``first``."""
    if material.axes is None:
        return None
    constants = material.constants[first].copy()
    constants[:, :6] *= (E / material.E[first])[:, None]
    return BinGrain(material.axes[first], constants)


def _three(values: np.ndarray) -> tuple[float, float, float]:
    E, nu, rho = values.tolist()
    return E, nu, rho


def _cluster(values: np.ndarray, weight: np.ndarray, bins: int) -> np.ndarray:
    """Label of every row by k-means on columns of equal spread, without empty bins.

    It starts from halving, again and again, the bin of the largest weighted variance, so that the
    answer depends on no seed.
    """
    from scipy.spatial import KDTree

    spread = np.ptp(values, axis=0)
    scaled = (values - values.min(axis=0)) / np.where(spread > 0, spread, 1)
    label = np.zeros(len(scaled), dtype=np.int64)
    waiting = [_variance(scaled, weight, np.arange(len(scaled)))]
    for new in range(1, bins):
        worst = max(range(len(waiting)), key=lambda i: waiting[i][0])
        variance, axis, rows = waiting.pop(worst)
        if variance == 0:
            break
        column = scaled[rows, axis]
        upper = column > np.average(column, weights=weight[rows])
        label[rows[upper]] = new
        waiting += [_variance(scaled, weight, rows[part]) for part in (upper, ~upper)]
    for _ in range(_ITERATIONS):
        total = np.bincount(label, weight)
        centres = [np.bincount(label, weight * column) / total for column in scaled.T]
        nearest = np.unique(KDTree(np.stack(centres, 1)).query(scaled)[1], return_inverse=True)[1]
        if np.array_equal(nearest, label):
            break
        label = nearest
    return label


def _variance(scaled, weight, rows) -> tuple[float, int, np.ndarray]:
    """Weighted sum of squares about the mean, the axis with most of it, and the rows."""
    mean = np.average(scaled[rows], axis=0, weights=weight[rows])
    squares = weight[rows] @ (scaled[rows] - mean) ** 2
    return float(squares.sum()), int(squares.argmax()), rows


def named_arrays(mesh: TetMesh, names: str) -> dict[str, np.ndarray]:
    """Per-tet arrays under the names of another program; ``newton``: k_mu, k_lambda [Pa], rho."""
    material = material_of(mesh)
    if names == "newton":
        lam, mu = material.lame
        return {"k_mu": mu, "k_lambda": lam, "rho": material.rho}
    if names not in NAMES:
        raise InputError("material_bins.unknown_names", names=names, value=[*NAMES, "newton"])
    return dict(zip(NAMES[names], (material.E, material.nu, material.rho), strict=True))


def vertex_masses(mesh: TetMesh) -> Float[np.ndarray, "points"]:
    """Mass [kg] of every point: a quarter of rho V of each tet around it, shape (points,)."""
    share = material_of(mesh).rho * mesh.volumes / 4
    return np.bincount(mesh.tets.ravel(), np.repeat(share, 4), len(mesh.points))

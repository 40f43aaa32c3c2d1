"""How E, nu and rho become numbers in [-1, 1] for a network, and back."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..fem.errors import InputError


@dataclass(frozen=True)
class Normalisation:
    """Ranges that map (log10 E [Pa], nu, log10 rho [kg/m^3]) linearly to [-1, 1].

    Predictions of nu are capped at ``nu_cap``, where elements do not lock yet.
    """

    log10_E: tuple[float, float] = (3.0, 12.0)
    nu: tuple[float, float] = (0.0, 0.5)
    log10_rho: tuple[float, float] = (0.7, 4.4)
    nu_cap: float = 0.495

    @property
    def low(self) -> np.ndarray:
        """Lower ends of the three ranges, (3,)."""
        return np.array([self.log10_E[0], self.nu[0], self.log10_rho[0]])

    @property
    def span(self) -> np.ndarray:
        """Widths of the three ranges, (3,)."""
        return np.array([self.log10_E[1], self.nu[1], self.log10_rho[1]]) - self.low

    def normalise(self, E, nu, rho) -> np.ndarray:
        """Numbers in [-1, 1], shape (..., 3), of E [Pa], nu [1], rho [kg/m^3]; outliers clip."""
        raw = np.stack(np.broadcast_arrays(np.log10(E), nu, np.log10(rho)), axis=-1)
        return np.clip(2 * (raw - self.low) / self.span - 1, -1.0, 1.0)

    def physical(self, normalised) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """E [Pa], nu [1], rho [kg/m^3] of numbers in [-1, 1], shape (..., 3)."""
        unit = (np.clip(np.asarray(normalised, dtype=np.float64), -1.0, 1.0) + 1) / 2
        raw = self.low + unit * self.span
        nu = np.clip(raw[..., 1], 0.0, self.nu_cap)
        return np.asarray(10 ** raw[..., 0]), np.asarray(nu), np.asarray(10 ** raw[..., 2])

    def to_dict(self) -> dict:
        """Plain data for a checkpoint's metadata."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict) -> Normalisation:
        """Rebuild from ``to_dict``; a missing or unknown key is an ``InputError``."""
        try:
            plain: dict[str, Any] = {
                k: tuple(v) if isinstance(v, list | tuple) else v for k, v in data.items()
            }
            return cls(**plain)
        except TypeError as error:
            raise InputError(f"not a normalisation: {data} ({error})") from error


DEFAULT = Normalisation()

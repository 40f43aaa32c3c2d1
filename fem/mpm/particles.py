"""Particles: places, volumes, material and class of what is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..errors import InputError
from ..scene.material import lame_parameters, wave_speed
from .classes import MaterialClass, Substance
from .fracture import CrackBand, crack_band, scattered

JELLY = Substance()


@dataclass(frozen=True, eq=False, kw_only=True)
class Particles:
    """Particles of a body at rest, in SI.

    Parameters
    ----------
    x, volume
        Places [m], shape (n, 3), and volumes [m^3], shape (n,).
    E, nu, rho
        Young's modulus [Pa], Poisson's ratio [1] and density [kg/m^3], each (n,).
    part
        Index into ``parts`` of every particle, shape (n,).
    parts
        Names of the parts.
    substance
        Index into ``substances`` of every particle, shape (n,).
    substances
        Class and yield of the matter.
    velocity
        Velocity at the start [m/s], shape (n, 3).
    rigid
        Number of the rigid body of every particle, shape (n,); -1 where it deforms.

    Raises
    ------
    InputError
        Where there are none, shapes differ, or a value is not finite or has the wrong sign.
    """

    x: Float[np.ndarray, "n 3"]
    volume: Float[np.ndarray, "n"]
    E: Float[np.ndarray, "n"]
    nu: Float[np.ndarray, "n"]
    rho: Float[np.ndarray, "n"]
    part: Int[np.ndarray, "n"]
    parts: tuple[str, ...] = ("body",)
    substance: Int[np.ndarray, "n"]
    substances: tuple[Substance, ...] = field(default=(JELLY,))
    velocity: Float[np.ndarray, "n 3"]
    rigid: Int[np.ndarray, "n"]

    def __post_init__(self) -> None:
        if not len(self.x):
            raise InputError("no particles: the body is thinner than the grid, or empty")
        sides = {
            "volume": self.volume > 0,
            "E": self.E > 0,
            "nu": (self.nu >= 0) & (self.nu < 0.5),
            "rho": self.rho > 0,
            "x": np.isfinite(self.x).all(axis=1),
            "velocity": np.isfinite(self.velocity).all(axis=1),
        }
        for name, good in sides.items():
            values = getattr(self, name)
            if len(values) != len(self.x):
                raise InputError(f"{len(values)} values of {name} for {len(self.x)} particles")
            good = good & np.isfinite(values).reshape(len(values), -1).all(axis=1)
            if not good.all():
                first = int(np.flatnonzero(~good)[0])
                raise InputError(
                    f"{name} = {values[first]} at particle {first} ({int((~good).sum())} of "
                    f"{len(values)} bad): wanted finite values in SI, of the right sign"
                )
        for name, names in (("part", self.parts), ("substance", self.substances)):
            ids = getattr(self, name)
            if len(ids) != len(self.x) or ids.min() < 0 or ids.max() >= len(names):
                raise InputError(f"{name} of the particles: wanted {len(self.x)} ids below "
                                 f"{len(names)}")  # fmt: skip

    @classmethod
    def of(
        cls,
        x: np.ndarray,
        volume: float | np.ndarray,
        *,
        E: float | np.ndarray,
        nu: float | np.ndarray,
        rho: float | np.ndarray,
        substance: Substance = JELLY,
        velocity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    ) -> Particles:
        """Particles of one part and one class; numbers are for all of them or one for each."""
        x = np.array(x, dtype=np.float64)

        def each(value: float | np.ndarray) -> np.ndarray:
            return np.broadcast_to(np.asarray(value, dtype=np.float64), len(x)).copy()

        none = np.zeros(len(x), dtype=np.int64)
        return cls(
            x=x, volume=each(volume), E=each(E), nu=each(nu), rho=each(rho), part=none,
            substance=none.copy(), substances=(substance,),
            velocity=np.broadcast_to(np.asarray(velocity, dtype=np.float64), x.shape).copy(),
            rigid=none - 1,
        )  # fmt: skip

    @property
    def mass(self) -> Float[np.ndarray, "n"]:
        """Mass [kg] of every particle."""
        return self.rho * self.volume

    @property
    def kinds(self) -> Int[np.ndarray, "n"]:
        """Class of every particle; a rigid body is stationary in itself."""
        found = np.array([int(s.kind) for s in self.substances])[self.substance]
        return np.where(self.rigid >= 0, int(MaterialClass.STATIONARY), found)

    @property
    def held(self) -> Bool[np.ndarray, "n"]:
        """Particles that never move: stationary, and of no rigid body."""
        return (self.kinds == MaterialClass.STATIONARY) & (self.rigid < 0)

    @property
    def wave_speed(self) -> Float[np.ndarray, "n"]:
        """Speed of pressure waves [m/s]; of a fluid by its bulk modulus, of what is rigid zero."""
        found = wave_speed(self.E, self.nu, self.rho)
        for i, substance in enumerate(self.substances):
            if substance.kind == MaterialClass.FLUID and substance.bulk is not None:
                own = self.substance == i
                found[own] = np.sqrt(substance.bulk / self.rho[own])
        return np.where(self.kinds == MaterialClass.STATIONARY, 0.0, found)

    def numbers(self, spacing: float) -> Float[np.ndarray, "n 3"]:
        """What the kernel of every particle's class is given, on a grid of ``spacing`` [m]."""
        lam, mu = lame_parameters(self.E, self.nu)
        found = np.zeros((len(self.x), 3))
        for i, substance in enumerate(self.substances):
            own = self.substance == i
            found[own] = substance.numbers(0.0)
            if substance.kind == MaterialClass.FLUID and substance.bulk is None:
                found[own, 0] = (lam + 2 * mu / 3)[own]
            if substance.tears:
                band = self.crack_band(i, spacing)
                found[own, 0], found[own, 1] = band.tension, band.softening
        return found

    def crack_band(self, substance: int, spacing: float) -> CrackBand:
        """Strength and softening of the particles of a substance that tears."""
        found, own = self.substances[substance], self.substance == substance
        if found.tension is None or found.fracture_energy is None:
            raise InputError(f"substance {substance} does not tear")
        tension = scattered(found.tension, int(own.sum()), found.seed)
        return crack_band(tension, found.fracture_energy, self.E[own], spacing)

    def only(self, keep: Bool[np.ndarray, "n"]) -> Particles:
        """The particles of a mask."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        kept = {name: a[keep] for name, a in arrays.items() if isinstance(a, np.ndarray)}
        return replace(self, **kept)


class ParticleState(NamedTuple):
    """Particles at one time, in the order they were given in.

    ``x`` [m] and ``v`` [m/s] (n, 3), ``F`` total deformation gradient (n, 3, 3), ``q`` the state of
    the class (n,).
    """

    time: float
    x: np.ndarray
    v: np.ndarray
    F: np.ndarray
    q: np.ndarray


def block_places(
    low: Sequence[float], high: Sequence[float], spacing: float, *, along: int = 2
) -> Float[np.ndarray, "n 3"]:
    """Places [m] of ``along``^3 particles a cell that fill the box from ``low`` to ``high`` [m]."""
    h = spacing / along
    axes = [a + h * (np.arange(round((b - a) / h)) + 0.5) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

"""Rigid bodies among the particles: stiff parts that move as one, without a limit on the step."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ..device import start_warp
from ..note import Note
from ..scene.supports import Supports
from .kernels_grid import rigid_kernels
from .materials import MaterialClass, Substance
from .particles import ALONG, REACH, Particles, rigid_labels
from .time_step import BUDGET, largest_modulus

# Share of the mass of an inner node: 0.5 at a plane surface, 0.17 half a spacing away from it.
TOUCHING = 0.2
# A body that walls leave less than this share of the speed that they took from it rests on them, if
# they stand still themselves: a flat cube is left .001 to .003, a slope of so much is none.
REST = 0.02
# What changes with time.
BODIES_CHANGING = ("centre", "rotation", "velocity", "spin")


def merged_inside(particles: Particles, spacing: float) -> Particles:
    """``particles`` with those deep in rigid bodies merged, block by block.

    A block of two ``spacing`` [m] is one particle, at their centre of mass and with their mass,
    where it and all blocks around it are full of one body: what meets others keeps its particles.
    """
    rigid = np.flatnonzero(particles.rigid >= 0)
    full = (2 * ALONG) ** 3
    if len(rigid) < 27 * full:
        return particles
    low = particles.x[rigid].min(axis=0) - spacing / (2 * ALONG)
    block = np.floor((particles.x[rigid] - low) / (2 * spacing) + 1e-6).astype(np.int64) + 1
    shape = tuple((block.max(axis=0) + 2).tolist())
    kind = np.stack(
        [particles.rigid[rigid], particles.part[rigid], particles.substance[rigid]], axis=1
    )
    kinds, which = np.unique(kind, axis=0, return_inverse=True)
    number = np.asarray(np.ravel_multi_index(tuple(block.T), shape))
    inside, which = np.zeros(len(rigid), dtype=bool), which.reshape(-1)
    for k in range(len(kinds)):
        counts = np.bincount(number[which == k], minlength=int(np.prod(shape)))
        solid = (counts == full).reshape(shape)
        for axis in range(3):  # full are the neighbours too, across edges and corners
            solid = solid & np.roll(solid, 1, axis) & np.roll(solid, -1, axis)
        inside |= (which == k) & solid.ravel()[number]
    if not inside.any():
        return particles
    deep = rigid[inside]
    _, first, row = np.unique(number[inside], return_index=True, return_inverse=True)
    row, mass, volume = row.reshape(-1), particles.mass[deep], particles.volume[deep]

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(row, values, len(first))

    masses, volumes, ones = total(mass), total(volume), deep[first]
    kept = np.delete(np.arange(len(particles.x)), deep)
    changed = {f.name: getattr(particles, f.name) for f in fields(particles)}
    for name in ("E", "nu", "part", "substance", "rigid"):
        changed[name] = np.concatenate([changed[name][kept], changed[name][ones]])
    for name in ("x", "velocity"):
        means = np.stack([total(mass * v) for v in changed[name][deep].T], axis=1) / masses[:, None]
        changed[name] = np.concatenate([changed[name][kept], means])
    changed["volume"] = np.concatenate([particles.volume[kept], volumes])
    changed["rho"] = np.concatenate([particles.rho[kept], masses / volumes])
    return Particles(**changed)


class RigidBodies:
    """Rigid bodies of ``particles`` on a device, on a grid of ``spacing`` [m].

    Their inertia is that of the particles with the affine part of their velocities, m dx^2 / 2:
    momentum and angular momentum go to the grid and come back exactly.
    """

    def __init__(self, particles: Particles, spacing: float, real: Any, device: str) -> None:
        wp = start_warp()
        self.kernels = rigid_kernels(real)
        given, mass = particles, particles.mass
        count = int(given.rigid.max()) + 1
        self.count = count
        # Mass of a node that a body touches: its surface is half a spacing away then.
        self.touching = float(TOUCHING * given.rho[given.rigid >= 0].min() * spacing**3)
        sums, centres = np.zeros(count), np.zeros((count, 3))
        inertia, velocity, spin = (
            np.zeros((count, 3, 3)),
            np.zeros((count, 3)),
            np.zeros((count, 3)),
        )
        for b in range(count):
            rows = given.rigid == b
            m, x, v = mass[rows], given.x[rows], given.velocity[rows]
            sums[b] = m.sum()
            centres[b], velocity[b] = m @ x / sums[b], m @ v / sums[b]
            arm = x - centres[b]
            square = np.einsum("n,ni,nj->ij", m, arm, arm)
            inertia[b] = (np.trace(square) + sums[b] * spacing**2 / 2) * np.eye(3) - square
            turning = (m[:, None] * np.cross(arm, v)).sum(axis=0)
            spin[b] = np.linalg.solve(inertia[b], turning)
        struct = self.struct = self.kernels.Bodies()
        vec3 = wp.types.vector(length=3, dtype=real)
        mat33 = wp.types.matrix(shape=(3, 3), dtype=real)
        struct.mass = wp.array(sums, dtype=real, device=device)
        arrays = {"start": centres, "centre": centres, "velocity": velocity, "spin": spin}
        arrays |= {
            name: np.zeros((count, 3))
            for name in ("momentum", "turning", "push", "torque", "extra")
        }
        for name, values in arrays.items():
            setattr(struct, name, wp.array(values, dtype=vec3, device=device))
        struct.approach = wp.zeros(count, dtype=real, device=device)
        struct.inertia = wp.array(inertia, dtype=mat33, device=device)
        eyes = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
        struct.rotation = wp.array(eyes, dtype=mat33, device=device)

    def take_push(self) -> Float[np.ndarray, "3"]:
        """Momentum [N s] that walls gave beyond what their nodes say, since asked last."""
        extra = self.struct.extra.numpy().astype(np.float64).sum(axis=0)
        self.struct.extra.zero_()
        return extra


# Matter too stiff for explicit steps: stationary, rigid or softened, and counted.

# A softened part sags by less than this share of its size: nobody sees the difference.
INVISIBLE = 1e-3


class Stiff(StrEnum):
    """What happens to matter above the largest modulus that the steps allow."""

    RIGID = "rigid"
    STATIONARY = "stationary"
    CAP = "cap"


@dataclass(frozen=True, kw_only=True)
class Treatment:
    """What was made of stiff parts.

    ``particles`` with ``stationary``, ``rigid`` (in ``bodies`` bodies) and ``capped`` ones counted;
    ``notes`` what to know.
    """

    particles: Particles
    stationary: int = 0
    rigid: int = 0
    bodies: int = 0
    capped: int = 0
    notes: tuple[str, ...] = ()


def treated(
    particles: Particles,
    spacing: float,
    *,
    held: Bool[np.ndarray, "n"],
    stiff: Stiff = Stiff.RIGID,
    budget: float = BUDGET,
    gravity: float = 9.81,
    reach: float = REACH,
) -> Treatment:
    """Decide what becomes of particles stiffer than ``budget`` substeps a second allow.

    ``held`` are particles at what holds the body: stiff bodies among them stand still, free ones
    move as rigid ones. ``gravity`` [m/s^2] says whether softening would be seen. Particles within
    ``reach`` [spacings] of each other are of one rigid body.
    """
    x, rho = particles.x, particles.rho
    most = np.asarray(largest_modulus(particles.nu, rho, spacing, 1 / budget))
    hard = (particles.E > most) & (particles.kinds != MaterialClass.FLUID) & ~particles.held
    if not hard.any():
        return Treatment(particles=particles)
    parts = ", ".join(particles.parts[i] for i in np.unique(particles.part[hard]))
    if stiff == Stiff.CAP:
        size = float(np.ptp(x[hard], axis=0).max())
        sag = float((rho[hard] * gravity * size / most[hard]).max())
        seen = "invisible: " if sag < INVISIBLE else Note("rigid.seen")
        note = Note(
            "rigid.softened_pa",
            parts=parts,
            max=particles.E[hard].max(),
            min=most[hard].min(),
            seen=seen,
            sag=sag,
        )
        softened = replace(particles, E=np.where(hard, most, particles.E))
        return Treatment(particles=softened, capped=int(hard.sum()), notes=(note,))
    labels = np.full(len(hard), -1)
    labels[hard] = rigid_labels(x[hard], reach * spacing)
    standing = np.isin(labels, np.unique(labels[hard & held])) & hard
    if stiff == Stiff.STATIONARY:
        standing = hard
    free = hard & ~standing
    numbers = np.full(len(hard), -1, dtype=np.int64)
    numbers[free] = np.unique(labels[free], return_inverse=True)[1]
    bodies = int(numbers.max()) + 1
    still = Substance(kind=MaterialClass.STATIONARY)
    changed = replace(
        particles,
        substance=np.where(standing, len(particles.substances), particles.substance),
        substances=(*particles.substances, still),
        rigid=numbers,
    )
    changed = merged_inside(changed, spacing)
    rigid, stationary = int((changed.rigid >= 0).sum()), int(standing.sum())
    moves = Note(
        "rigid.particles_move", rigid=rigid, bodies=bodies, ending="y" if bodies == 1 else "ies"
    )
    stands = Note("rigid.particles_stand", stationary=stationary)
    done = ", ".join([*[stands] * bool(stationary), *[moves] * bool(bodies)])
    note = Note("rigid.stiffer_pa", parts=parts, min=most[hard].min(), budget=budget, done=done)
    return Treatment(
        particles=changed, stationary=stationary, rigid=rigid, bodies=bodies, notes=(note,)
    )


def near_fixed(
    points: Float[np.ndarray, "points 3"],
    supports: Supports,
    x: Float[np.ndarray, "n 3"],
    spacing: float,
) -> Bool[np.ndarray, "n"]:
    """Which places ``x`` [m] are within a ``spacing`` [m] of the ``points`` [m] that are held."""
    from scipy.spatial import KDTree

    fixed = points[supports.fixed.any(axis=1)]
    return KDTree(fixed).query(x)[0] < spacing if len(fixed) else np.zeros(len(x), dtype=bool)

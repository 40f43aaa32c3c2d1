"""Matter too stiff for explicit steps: stationary, rigid or softened, and counted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from jaxtyping import Bool, Float

from ..scene.mesh import material_of
from ..scene.scene import Scene
from .classes import MaterialClass, Substance
from .particles import Particles
from .rigid import merged_inside, rigid_labels
from .stability import BUDGET, COURANT, largest_modulus

# Particles this close, in spacings of the grid, are of one rigid body: two to a cell and axis.
REACH = 0.9
# A softened part sags by less than this share of its size: nobody sees the difference.
INVISIBLE = 1e-3


class Stiff(StrEnum):
    """What happens to matter above the largest modulus that the steps allow."""

    RIGID = "rigid"
    STATIONARY = "stationary"
    CAP = "cap"


@dataclass(frozen=True, kw_only=True)
class Treatment:
    """What was made of stiff matter.

    ``particles`` with ``stationary``, ``rigid`` (in ``bodies`` bodies) and ``capped`` ones counted;
    ``E_max`` [Pa] (n,) is what the steps of ``dt`` [s] allow, ``notes`` what to know.
    """

    particles: Particles
    dt: float
    E_max: Float[np.ndarray, "n"]
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
    courant: float = COURANT,
    reach: float = REACH,
) -> Treatment:
    """Decide what becomes of particles stiffer than ``budget`` substeps a second allow.

    ``held`` are particles at what holds the body: stiff bodies among them stand still, free ones
    move as rigid ones. ``gravity`` [m/s^2] says whether softening would be seen. Particles within
    ``reach`` [spacings] of each other are of one rigid body.
    """
    dt = 1 / budget
    most = np.asarray(largest_modulus(particles.nu, particles.rho, spacing, dt, courant=courant))
    hard = (particles.E > most) & (particles.kinds != MaterialClass.FLUID) & ~particles.held
    parts = [particles.parts[i] for i in np.unique(particles.part[hard])]
    found = Treatment(particles=particles, dt=dt, E_max=most)
    if not hard.any():
        return found
    if stiff == Stiff.CAP:
        return _capped(found, hard, parts, gravity)
    labels = np.full(len(hard), -1)
    labels[hard] = rigid_labels(particles.x[hard], reach * spacing)
    standing = np.isin(labels, np.unique(labels[hard & held])) & hard
    if stiff == Stiff.STATIONARY:
        standing = hard
    free = hard & ~standing
    numbers = np.full(len(hard), -1, dtype=np.int64)
    numbers[free] = np.unique(labels[free], return_inverse=True)[1]
    still = Substance(kind=MaterialClass.STATIONARY)
    substance = np.where(standing, len(particles.substances), particles.substance)
    changed = replace(
        particles,
        substance=substance,
        substances=(*particles.substances, still),
        rigid=numbers,
    )
    bodies = int(numbers.max()) + 1
    changed = merged_inside(changed, spacing)
    rigid = int((changed.rigid >= 0).sum())
    moves = f"{rigid:,} particles move as {bodies} rigid bod{'y' if bodies == 1 else 'ies'}"
    stands = f"{int(standing.sum()):,} particles stand still"
    done = ", ".join([*[stands] * bool(standing.any()), *[moves] * bool(bodies)])
    note = (
        f"{', '.join(parts)}: stiffer than the {most[hard].min():.3g} Pa that {budget:,.0f} steps "
        f"a second allow: {done}"
    )
    return replace(
        found,
        particles=changed,
        stationary=int(standing.sum()),
        rigid=rigid,
        bodies=bodies,
        notes=(note,),
    )


def _capped(
    found: Treatment, hard: Bool[np.ndarray, "n"], parts: list[str], gravity: float
) -> Treatment:
    """Matter softened to what the steps allow; whether that is seen is said."""
    given, most = found.particles, found.E_max
    E = np.where(hard, most, given.E)
    size = float(np.ptp(given.x[hard], axis=0).max())
    sag = float((given.rho[hard] * gravity * size / most[hard]).max())
    seen = "invisible: " if sag < INVISIBLE else "it is seen: "
    note = (
        f"{', '.join(parts)}: softened from {given.E[hard].max():.3g} to {most[hard].min():.3g} Pa "
        f"({seen}rho g L / E is {sag:.2g} then)"
    )
    changed = replace(given, E=E)
    return replace(found, particles=changed, capped=int(hard.sum()), notes=(note,))


def bending_regions(
    scene: Scene,
    substances: Mapping[str, Substance],
    spacing: float,
    *,
    step: float,
    courant: float = COURANT,
) -> Bool[np.ndarray, "regions"]:
    """Which regions are jelly that bends under steps of ``step`` [s], at their weights at rest.

    ``spacing`` [m] is that of the grid; ``substances`` are classes by name, jelly where none is.
    """
    mesh, material = scene.mesh, material_of(scene.mesh)
    given = [substances.get(name, Substance()) for name in mesh.region_names]
    jelly = np.array([s.kind == MaterialClass.JELLY and not s.tears for s in given])
    most = largest_modulus(material.nu, material.rho, spacing, step, courant=courant)
    soft = np.isin(np.arange(len(given)), mesh.region[material.E <= most])
    return jelly & soft & (bool(scene.held.fixed.any()) and not scene.obstacles)


def near_held(scene: Scene, x: Float[np.ndarray, "n 3"], spacing: float) -> Bool[np.ndarray, "n"]:
    """Which places [m] are within a ``spacing`` [m] of the points that hold a body."""
    from scipy.spatial import KDTree

    points = scene.mesh.points[scene.held.fixed.any(axis=1)]
    if not len(points):
        return np.zeros(len(x), dtype=bool)
    return KDTree(points).query(x)[0] < spacing


def treatment_notes(found: Treatment, thin: tuple[str, ...]) -> tuple[str, ...]:
    """What to know of a treatment, and of the parts that are too ``thin`` for the grid to bend."""
    given, notes = found.particles, list(found.notes)
    bending = np.unique(given.part[given.kinds != MaterialClass.STATIONARY])
    names = [name for name in thin if name in {given.parts[i] for i in bending}]
    if names:
        notes.append(
            f"{', '.join(names)}: less than about two cells thick, bends wrongly, by a fifth and "
            "more: finer --grid"
        )
    if given.held.all():
        notes.append("everything is stationary: nothing can move")
    return tuple(notes)

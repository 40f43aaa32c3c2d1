"""Procedural vehicles; z is up."""

from __future__ import annotations

import numpy as np

from ..shapes import Solid, rotation_about


def car(r: np.random.Generator) -> Solid:
    """A body with a cabin, windows and wheels."""
    s, length, w, radius = Solid(), r.uniform(0.9, 1.3), r.uniform(0.4, 0.5), r.uniform(0.16, 0.25)
    z = radius + 0.15
    s.box("window", (-0.1, 0, z + 0.35), (length * 0.45, w * 0.92, 0.17))
    s.box("carbody", (-0.1, 0, z + 0.55), (length * 0.42, w * 0.9, 0.05))
    s.box("carbody", (0, 0, z), (length, w, 0.2))
    for i in (-1, 1):
        for j in (-1, 1):
            at = np.array([i * length * 0.6, j * w, radius])
            s.rod("wheel", at - np.array([0, 0.08, 0]), at + np.array([0, 0.08, 0]), radius)
    return s


def wagon(r: np.random.Generator) -> Solid:
    """An open crate on wheels with a pole to pull."""
    s, length, w, radius = Solid(), r.uniform(0.6, 0.9), r.uniform(0.35, 0.5), r.uniform(0.15, 0.25)
    s.box("crate", (0, 0, radius + 0.3), (length, w, 0.25))
    s.box(None, (0, 0, radius + 0.42), (length - 0.08, w - 0.08, 0.25))
    s.rod("pole", (length, 0, radius + 0.1), (length + 0.6, 0, radius + 0.6), 0.05)
    for i in (-1, 1):
        for j in (-1, 1):
            at = np.array([i * length * 0.7, j * (w + 0.06), radius])
            s.rod("wheel", at - np.array([0, 0.06, 0]), at + np.array([0, 0.06, 0]), radius)
    return s


def airplane(r: np.random.Generator) -> Solid:
    """A fuselage with wings, fins and a propeller."""
    s, length, span = Solid(), r.uniform(0.9, 1.2), r.uniform(0.8, 1.2)
    s.box("wing", (0.1, 0, r.uniform(-0.1, 0.15)), (r.uniform(0.15, 0.25), span, 0.04))
    s.box("fins", (-length * 0.85, 0, 0.2), (0.14, 0.035, 0.22))
    s.box("fins", (-length * 0.85, 0, 0.05), (0.14, 0.4, 0.035))
    s.ball("fuselage", (0, 0, 0), (length, 0.2, 0.2))
    s.box("propeller", (length, 0, 0), (0.05, 0.06, r.uniform(0.25, 0.35)), rotation_about("x", 40))
    return s


def rocket(r: np.random.Generator) -> Solid:
    """An upright fuselage with a tip and fins."""
    s, radius, h = Solid(), r.uniform(0.2, 0.3), r.uniform(1.0, 1.6)
    for angle in np.arange(4) * 90 + 45.0:
        turn = rotation_about("z", angle)
        s.box("fins", turn @ [radius + 0.1, 0, 0.2], (0.2, 0.04, 0.25), turn)
    s.rod("fuselage", (0, 0, 0.1), (0, 0, h), radius)
    s.rod("tip", (0, 0, h), (0, 0, h + 0.45), radius, 0.1)
    s.ball("window", (0, -radius, h * 0.75), 0.12)
    return s


def boat(r: np.random.Generator) -> Solid:
    """Held out: a hull with a mast and a sail."""
    s, length, w = Solid(), r.uniform(0.8, 1.1), r.uniform(0.3, 0.4)
    s.ball("hull", (0, 0, 0.3), (length, w, 0.35))
    s.box(None, (0, 0, 0.65), (length * 1.1, w * 1.1, 0.33))
    s.rod("mast", (0, 0, 0.2), (0, 0, 1.7), 0.05)
    s.box("sail", (-0.32, 0, 1.05), (0.28, 0.035, r.uniform(0.45, 0.6)))
    return s


VEHICLES = {f.__name__: f for f in (car, wagon, airplane, rocket)}

"""Procedural clothing; z is up."""

from __future__ import annotations

import numpy as np

from ..shapes import Solid, along


def shoe(r: np.random.Generator) -> Solid:
    """A sole, an upper and laces."""
    s, length, w = Solid(), r.uniform(0.7, 1.0), r.uniform(0.22, 0.32)
    s.ball("upper", (length * 0.35, 0, 0.18), (length * 0.6, w, 0.25))
    s.rod("upper", (-length * 0.45, 0, 0.1), (-length * 0.45, 0, r.uniform(0.5, 0.9)), w)
    s.box("sole", (0, 0, 0), (length, w * 1.05, r.uniform(0.06, 0.12)))
    for k in range(3):
        x = length * (0.05 + 0.18 * k)
        s.box("laces", (x, 0, 0.45 - 0.06 * k), (0.04, w * 0.55, 0.04))
    return s


def hat(r: np.random.Generator) -> Solid:
    """A crown on a wide brim with a band."""
    s, radius, h = Solid(), r.uniform(0.35, 0.5), r.uniform(0.3, 0.7)
    s.rod("brim", (0, 0, 0), (0, 0, 0.08), radius * r.uniform(1.6, 2.1))
    s.rod("hatcrown", (0, 0, 0.05), (0, 0, h), radius, r.uniform(0.7, 1))
    s.rod("strap", (0, 0, 0.08), (0, 0, 0.2), radius * 1.08)
    return s


def helmet(r: np.random.Generator) -> Solid:
    """A hard shell over a lining, with a strap."""
    s, a = Solid(), r.uniform(0.5, 0.6)
    s.ball("helmet", (0, 0, 0.1), (a, a * 0.85, a))
    s.ball("lining", (0, 0, 0.05), (a * 0.82, a * 0.68, a * 0.8))
    s.ball(None, (0, 0, -0.05), (a * 0.6, a * 0.48, a * 0.6))
    s.box(None, (0, 0, -a * 0.75), (a * 0.95, a * 0.6, a * 0.5))
    s.ring("strap", (0, 0, 0.05), a * 0.75, 0.05, along((0, 1, 0)))
    return s


def glasses(r: np.random.Generator) -> Solid:
    """Two lenses in a frame with long temples."""
    s, radius, gap = Solid(), r.uniform(0.25, 0.35), r.uniform(0.1, 0.2)
    for i in (-1, 1):
        x = i * (radius + gap)
        s.rod("lens", (x, 0.04, 0), (x, -0.04, 0), radius)
        s.ring("spectacles", (x, 0, 0), radius, 0.05, along((0, 1, 0)))
        side = i * (2 * radius + gap)
        s.rod("spectacles", (side, 0, 0.05), (side, r.uniform(0.8, 1.1), 0), 0.04)
    s.box("spectacles", (0, 0, 0.05), (gap, 0.05, 0.05))
    return s


CLOTHING = {f.__name__: f for f in (shoe, hat, helmet, glasses)}

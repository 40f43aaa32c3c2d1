"""Procedural things for sport, music and the desk; z is up."""

from __future__ import annotations

import numpy as np

from ..shapes import Solid, along


def dumbbell(r: np.random.Generator) -> Solid:
    """A bar between weights."""
    s, a, radius = Solid(), r.uniform(0.5, 1.0), r.uniform(0.25, 0.5)
    s.rod("bar", (-a - 0.1, 0, 0), (a + 0.1, 0, 0), 0.07)
    for i in (-1, 1):
        s.rod("weights", (i * a, 0, 0), (i * (a - 0.25), 0, 0), radius)
    return s


def trophy(r: np.random.Generator) -> Solid:
    """A bowl with two handles on a plinth."""
    s, radius, h = Solid(), r.uniform(0.3, 0.45), r.uniform(0.4, 0.6)
    s.box("plinth", (0, 0, 0.12), (0.3, 0.3, 0.14))
    s.rod("pole", (0, 0, 0.2), (0, 0, 0.6), 0.08)
    for i in (-1, 1):
        s.ring("handle", (i * radius, 0, 0.6 + h / 2), 0.17, 0.05, along((0, 1, 0)))
    s.tub("bowl", (0, 0, 0.55), (0, 0, 0.55 + h), radius * 0.6, 1.8, 0.08)
    return s


def drum(r: np.random.Generator) -> Solid:
    """A shell with a membrane and hoops."""
    s, radius, h = Solid(), r.uniform(0.4, 0.6), r.uniform(0.4, 0.9)
    s.rod("drumshell", (0, 0, 0), (0, 0, h), radius)
    s.rod("hoops", (0, 0, h - 0.08), (0, 0, h + 0.06), radius * 1.1)
    s.rod("membrane", (0, 0, h - 0.02), (0, 0, h + 0.1), radius * 0.92)
    return s


def racket(r: np.random.Generator) -> Solid:
    """A rim with strings on a handle."""
    s, radius = Solid(), r.uniform(0.4, 0.55)
    s.rod("handle", (0, 0, 0), (0, 0, 0.7), r.uniform(0.05, 0.08))
    s.rod("strings", (0, -0.03, 0.7 + radius), (0, 0.03, 0.7 + radius), radius)
    s.ring("hoopframe", (0, 0, 0.7 + radius), radius, 0.06, along((0, 1, 0)))
    return s


def pencil(r: np.random.Generator) -> Solid:
    """A shaft with a tip and an eraser."""
    s, length, radius = Solid(), r.uniform(0.8, 1.2), r.uniform(0.08, 0.14)
    s.rod("pencilshaft", (-length, 0, 0), (length, 0, 0), radius)
    s.rod("tip", (length, 0, 0), (length + 0.35, 0, 0), radius, 0.1)
    s.rod("eraser", (-length - 0.2, 0, 0), (-length, 0, 0), radius)
    return s


def book(r: np.random.Generator) -> Solid:
    """Pages between covers."""
    s, w, h, d = Solid(), r.uniform(0.4, 0.6), r.uniform(0.6, 0.8), r.uniform(0.12, 0.25)
    s.box("bookcover", (0, 0, 0), (w, d, h))
    s.box(None, (0.1, 0, 0), (w, d - 0.06, h + 0.1))
    s.box("pages", (0.02, 0, 0), (w - 0.05, d - 0.06, h - 0.04))
    return s


HOUSEHOLD = {f.__name__: f for f in (dumbbell, trophy, drum, racket, pencil, book)}

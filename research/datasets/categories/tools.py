"""Procedural tools, weapons and brushes; z is up."""

from __future__ import annotations

import numpy as np

from ..shapes import Solid


def hammer(r: np.random.Generator) -> Solid:
    """A handle with a head across it."""
    s, h = Solid(), r.uniform(0.8, 1.3)
    s.rod("handle", (0, 0, 0), (0, 0, h), r.uniform(0.06, 0.1))
    half = r.uniform(0.2, 0.4)
    if r.random() < 0.5:
        s.rod("head", (-half, 0, h), (half, 0, h), r.uniform(0.1, 0.18))
    else:
        s.box("head", (0, 0, h), (half, r.uniform(0.1, 0.2), r.uniform(0.1, 0.16)))
    return s


def axe(r: np.random.Generator) -> Solid:
    """A handle with a flat blade on one side."""
    s, h = Solid(), r.uniform(0.9, 1.4)
    s.rod("handle", (0, 0, 0), (0, 0, h), r.uniform(0.05, 0.09))
    s.box("blade", (0.2, 0, h - 0.15), (0.25, 0.06, r.uniform(0.12, 0.25)))
    return s


def knife(r: np.random.Generator) -> Solid:
    """A blade and a handle in line."""
    s, a, b = Solid(), r.uniform(0.3, 0.5), r.uniform(0.4, 0.9)
    s.box("handle", (-a, 0, 0), (a, r.uniform(0.05, 0.09), r.uniform(0.07, 0.12)))
    s.box("blade", (b, 0, 0), (b, 0.03, r.uniform(0.08, 0.15)))
    return s


def sword(r: np.random.Generator) -> Solid:
    """A long upright blade, a guard and a handle."""
    s, h = Solid(), r.uniform(1.0, 1.5)
    s.rod("handle", (0, 0, 0), (0, 0, 0.4), 0.06)
    s.box("blade", (0, 0, 0.4 + h / 2), (r.uniform(0.06, 0.1), 0.03, h / 2))
    s.box("guard", (0, 0, 0.4), (r.uniform(0.2, 0.35), 0.06, 0.05))
    return s


def screwdriver(r: np.random.Generator) -> Solid:
    """A thick handle, a thin shank, a tip."""
    s, h = Solid(), r.uniform(0.5, 0.9)
    s.rod("handle", (0, 0, 0), (0, 0, 0.5), r.uniform(0.12, 0.2), 0.8)
    s.rod("shank", (0, 0, 0.5), (0, 0, 0.5 + h), 0.05)
    s.box("tip", (0, 0, 0.55 + h), (0.08, 0.03, 0.08))
    return s


def shovel(r: np.random.Generator) -> Solid:
    """A pole with a grip at one end and a blade at the other."""
    s, h = Solid(), r.uniform(1.0, 1.5)
    s.rod("pole", (0, 0, 0.5), (0, 0, h), 0.05)
    s.rod("handle", (-0.15, 0, h), (0.15, 0, h), 0.06)
    s.box("blade", (0, 0, 0.28), (r.uniform(0.15, 0.25), 0.05, 0.28))
    return s


def broom(r: np.random.Generator) -> Solid:
    """A pole with bristles."""
    s, h, w = Solid(), r.uniform(0.9, 1.5), r.uniform(0.2, 0.4)
    s.box("bristles", (0, 0, 0.15), (w, r.uniform(0.07, 0.15), 0.18))
    s.box("head", (0, 0, 0.36), (w, 0.1, 0.06))
    s.rod("pole", (0, 0, 0.4), (0, 0, h + 0.4), 0.05)
    return s


def brush(r: np.random.Generator) -> Solid:
    """A lying handle with bristles at one end."""
    s, a = Solid(), r.uniform(0.6, 1.0)
    s.box("handle", (0, 0, 0.15), (a, r.uniform(0.06, 0.15), 0.06))
    s.box("bristles", (a * 0.7, 0, 0), (a * 0.3, r.uniform(0.07, 0.15), 0.12))
    return s


TOOLS = {f.__name__: f for f in (hammer, axe, knife, sword, screwdriver, shovel, broom, brush)}

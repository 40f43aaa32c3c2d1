"""Procedural pots, bottles, boxes and bags: what holds something; z is up."""

from __future__ import annotations

import numpy as np

from ..shapes import Solid, along


def pan(r: np.random.Generator) -> Solid:
    """An open pan with a long handle."""
    s, radius, h = Solid(), r.uniform(0.5, 0.7), r.uniform(0.12, 0.3)
    s.tub("pan", (0, 0, 0), (0, 0, h), radius, r.uniform(1, 1.2), 0.07)
    s.rod("handle", (radius, 0, h * 0.8), (radius + r.uniform(0.5, 0.9), 0, h), 0.06)
    return s


def saucepan(r: np.random.Generator) -> Solid:
    """A deep pan with a lid, a knob and two grips."""
    s, radius, h = Solid(), r.uniform(0.4, 0.6), r.uniform(0.4, 0.7)
    s.tub("pan", (0, 0, 0), (0, 0, h), radius, 1.0, 0.07)
    s.rod("lid", (0, 0, h), (0, 0, h + 0.12), radius, 0.8)
    s.ball("knob", (0, 0, h + 0.2), r.uniform(0.07, 0.12))
    for i in (-1, 1):
        s.box("handle", (i * (radius + 0.1), 0, h * 0.75), (0.14, 0.12, 0.05))
    return s


def teapot(r: np.random.Generator) -> Solid:
    """A round kettle with spout, handle and lid."""
    s, a, h = Solid(), r.uniform(0.4, 0.55), r.uniform(0.35, 0.5)
    s.rod("spout", (a * 0.7, 0, h * 0.6), (a + 0.35, 0, h * 1.7), 0.09, 0.7)
    s.ring("handle", (-a, 0, h), h * 0.6, 0.06, along((0, 1, 0)))
    s.ball("kettle", (0, 0, h), (a, a, h))
    s.ball("lid", (0, 0, 2 * h - 0.04), (a * 0.5, a * 0.5, 0.09))
    return s


def mug(r: np.random.Generator) -> Solid:
    """An open cup with a round handle."""
    s, radius, h = Solid(), r.uniform(0.3, 0.5), r.uniform(0.6, 0.9)
    s.ring("handle", (radius, 0, h / 2), h * 0.3, 0.06, along((0, 1, 0)))
    s.tub("mug", (0, 0, 0), (0, 0, h), radius, r.uniform(0.9, 1.2), 0.08)
    return s


def bottle(r: np.random.Generator) -> Solid:
    """A bottle with a neck and a cap."""
    s, radius, h = Solid(), r.uniform(0.2, 0.35), r.uniform(0.6, 1.0)
    s.rod("bottle", (0, 0, 0), (0, 0, h), radius)
    s.rod("bottle", (0, 0, h), (0, 0, h + 0.35), radius, 0.4)
    s.rod("cap", (0, 0, h + 0.3), (0, 0, h + 0.5), radius * r.uniform(0.4, 0.5))
    return s


def jar(r: np.random.Generator) -> Solid:
    """A vase with a flat lid."""
    s, radius, h = Solid(), r.uniform(0.3, 0.5), r.uniform(0.4, 0.8)
    s.rod("vase", (0, 0, 0), (0, 0, h), radius, r.uniform(0.8, 1.1))
    s.rod("lid", (0, 0, h), (0, 0, h + r.uniform(0.1, 0.2)), radius)
    return s


def bucket(r: np.random.Generator) -> Solid:
    """An open pail with a bail over it."""
    s, radius, h = Solid(), r.uniform(0.35, 0.5), r.uniform(0.6, 0.9)
    s.ring("handle", (0, 0, h), radius * 1.1, 0.05, along((0, 1, 0)))
    s.box(None, (0, 0, h * 0.4), (radius * 1.3, radius, h * 0.6))
    s.tub("bucket", (0, 0, 0), (0, 0, h), radius, 1.25, 0.08)
    return s


def basket(r: np.random.Generator) -> Solid:
    """An open basket under an arched handle."""
    s, radius, h = Solid(), r.uniform(0.4, 0.6), r.uniform(0.3, 0.5)
    s.ring("handle", (0, 0, h), radius, 0.06, along((1, 0, 0)))
    s.box(None, (0, 0, 0), (radius, radius * 1.3, h))
    s.tub("basket", (0, 0, 0), (0, 0, h), radius, 1.2, 0.09)
    return s


def barrel(r: np.random.Generator) -> Solid:
    """Staves held by hoops."""
    s, radius, h = Solid(), r.uniform(0.35, 0.5), r.uniform(0.9, 1.3)
    s.rod("staves", (0, 0, 0), (0, 0, h / 2), radius, 1.15)
    s.rod("staves", (0, 0, h / 2), (0, 0, h), radius * 1.15, 0.87)
    for share in (0.12, 0.35, 0.65, 0.88)[:: int(r.integers(1, 3))]:
        s.rod("hoops", (0, 0, share * h - 0.05), (0, 0, share * h + 0.05), radius * 1.22)
    return s


def parcel(r: np.random.Generator) -> Solid:
    """A box with a lid and a strap around it."""
    s, x, y, z = Solid(), *r.uniform(0.3, 0.7, 3)
    s.box("crate", (0, 0, 0), (x, y, z))
    s.box("lid", (0, 0, z + 0.05), (x + 0.04, y + 0.04, 0.08))
    s.box("strap", (0, 0, 0.05), (0.07, y + 0.07, z + 0.13))
    return s


def suitcase(r: np.random.Generator) -> Solid:
    """A case on wheels with a handle."""
    s, w, d, h = Solid(), r.uniform(0.35, 0.5), r.uniform(0.15, 0.25), r.uniform(0.5, 0.7)
    s.box("suitcase", (0, 0, h + 0.1), (w, d, h))
    for i in (-1, 1):
        for j in (-1, 1):
            s.ball("wheel", (i * (w - 0.08), j * (d - 0.05), 0.05), 0.08)
        s.box("handle", (i * 0.18, 0, 2 * h + 0.25), (0.035, 0.035, 0.2))
    s.box("handle", (0, 0, 2 * h + 0.45), (0.22, 0.05, 0.05))
    return s


def handbag(r: np.random.Generator) -> Solid:
    """A bag with a strap and a knob as its clasp."""
    s, w, d, h = Solid(), r.uniform(0.4, 0.6), r.uniform(0.15, 0.25), r.uniform(0.3, 0.5)
    s.ring("strap", (0, 0, 2 * h), w * 0.7, 0.05, along((0, 1, 0)))
    s.box("bag", (0, 0, h), (w, d, h))
    s.ball("knob", (0, -d, h * 1.6), 0.08)
    return s


CONTAINERS = {
    f.__name__: f
    for f in (
        pan, saucepan, teapot, mug, bottle, jar, bucket, basket, barrel, parcel, suitcase,
        handbag,
    )
}  # fmt: skip

"""Procedural tools, vessels, vehicles and clothing; z is up."""

from __future__ import annotations

import numpy as np

from .shapes import Solid, along, rotation


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
    s.box("propeller", (length, 0, 0), (0.05, 0.06, r.uniform(0.25, 0.35)), rotation("x", 40))
    return s


def rocket(r: np.random.Generator) -> Solid:
    """An upright fuselage with a tip and fins."""
    s, radius, h = Solid(), r.uniform(0.2, 0.3), r.uniform(1.0, 1.6)
    for angle in np.arange(4) * 90 + 45.0:
        turn = rotation("z", angle)
        s.box("fins", turn @ [radius + 0.1, 0, 0.2], (0.2, 0.04, 0.25), turn)
    s.rod("fuselage", (0, 0, 0.1), (0, 0, h), radius)
    s.rod("tip", (0, 0, h), (0, 0, h + 0.45), radius, 0.1)
    s.ball("window", (0, -radius, h * 0.75), 0.12)
    return s


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


def boat(r: np.random.Generator) -> Solid:
    """Held out: a hull with a mast and a sail."""
    s, length, w = Solid(), r.uniform(0.8, 1.1), r.uniform(0.3, 0.4)
    s.ball("hull", (0, 0, 0.3), (length, w, 0.35))
    s.box(None, (0, 0, 0.65), (length * 1.1, w * 1.1, 0.33))
    s.rod("mast", (0, 0, 0.2), (0, 0, 1.7), 0.05)
    s.box("sail", (-0.32, 0, 1.05), (0.28, 0.035, r.uniform(0.45, 0.6)))
    return s


THINGS = {
    f.__name__: f
    for f in (
        hammer, axe, knife, sword, screwdriver, shovel, broom, brush, pan, saucepan, teapot, mug,
        bottle, jar, bucket, basket, barrel, parcel, suitcase, handbag, shoe, hat, helmet, glasses,
        car, wagon, airplane, rocket, dumbbell, trophy, drum, racket, pencil, book,
    )
}  # fmt: skip

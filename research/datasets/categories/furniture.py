"""Procedural furniture and buildings; z is up, sizes in units of roughly half a metre."""

from __future__ import annotations

import numpy as np

from ..shapes import Solid, along, rotation_about


def _legs(s: Solid, r: np.random.Generator, x: float, y: float, top: float, part="leg") -> None:
    thick, spread, round_ = r.uniform(0.04, 0.1), r.uniform(0, 0.12), r.random() < 0.5
    for i in (-1, 1):
        for j in (-1, 1):
            foot = (i * (x + spread), j * (y + spread), 0.0)
            if round_:
                s.rod(part, foot, (i * x, j * y, top), thick, r.uniform(1, 1.4))
            else:
                s.box(part, (i * x, j * y, top / 2), (thick, thick, top / 2))


def chair(r: np.random.Generator) -> Solid:
    """Four legs, a seat, a back that may lean."""
    s, w, d, h = Solid(), r.uniform(0.4, 0.6), r.uniform(0.4, 0.6), r.uniform(0.7, 1.0)
    _legs(s, r, w - 0.08, d - 0.08, h)
    tall, lean = r.uniform(0.4, 0.7), r.uniform(-15, 0)
    s.box("seat", (0, 0, h), (w, d, r.uniform(0.05, 0.12)))
    s.box(
        "backrest",
        (0, d - 0.05, h + tall),
        (w, r.uniform(0.04, 0.09), tall),
        rotation_about("x", lean),
    )
    return s


def armchair(r: np.random.Generator) -> Solid:
    """A low seat between armrests, before a back."""
    s, w, d, h = Solid(), r.uniform(0.5, 0.7), r.uniform(0.5, 0.65), r.uniform(0.35, 0.55)
    _legs(s, r, w - 0.05, d - 0.05, h)
    arm = r.uniform(0.08, 0.15)
    s.box("seat", (0, 0, h + 0.1), (w, d, 0.15))
    s.box("backrest", (0, d - 0.1, h + 0.6), (w, 0.12, r.uniform(0.45, 0.65)))
    for i in (-1, 1):
        s.box("armrest", (i * w, 0, h + r.uniform(0.3, 0.4)), (arm, d, arm))
        s.box("armrest", (i * w, -d + arm, h + 0.1), (arm, arm, 0.3))
    return s


def sofa(r: np.random.Generator) -> Solid:
    """A long frame with armrests, a back and pillows."""
    s, w, d = Solid(), r.uniform(1.0, 1.5), r.uniform(0.4, 0.6)
    s.box("sofaframe", (0, 0, 0.15), (w, d, 0.15))
    s.box("seat", (0, -0.05, 0.42), (w - 0.1, d - 0.05, 0.12))
    s.box("backrest", (0, d - 0.1, 0.7), (w, 0.13, r.uniform(0.3, 0.45)))
    for i in (-1, 1):
        s.box("armrest", (i * w, 0, 0.45), (0.13, d, r.uniform(0.3, 0.4)))
        if r.random() < 0.7:
            s.ball("pillow", (i * (w - 0.35), 0.1, 0.72), (0.24, 0.13, 0.2))
    return s


def stool(r: np.random.Generator) -> Solid:
    """A round seat on three or four splayed legs."""
    s, h, radius = Solid(), r.uniform(0.7, 1.4), r.uniform(0.3, 0.5)
    n, thick = int(r.integers(3, 5)), r.uniform(0.04, 0.08)
    for angle in np.arange(n) * 2 * np.pi / n + r.uniform(0, 1):
        at = np.array([np.cos(angle), np.sin(angle), 0]) * radius
        s.rod("leg", at * 1.15, at * 0.7 + [0, 0, h], thick)
    s.rod("seat", (0, 0, h - 0.06), (0, 0, h + r.uniform(0.04, 0.12)), radius)
    return s


def bench(r: np.random.Generator) -> Solid:
    """A long seat, two leg frames, perhaps a back of rails."""
    s, w, d, h = Solid(), r.uniform(1.0, 1.6), r.uniform(0.25, 0.4), r.uniform(0.45, 0.6)
    for i in (-1, 1):
        s.box("leg", (i * (w - 0.2), 0, h / 2), (r.uniform(0.05, 0.1), d, h / 2))
    s.box("seat", (0, 0, h), (w, d, 0.06))
    if r.random() < 0.7:
        s.box("backrest", (0, d, h + 0.4), (w, 0.05, 0.15))
        s.box("backrest", (0, d, h + 0.8), (w, 0.05, 0.12))
        for i in (-1, 1):
            s.box("pole", (i * (w - 0.25), d + 0.06, h + 0.4), (0.05, 0.05, 0.5))
    return s


def table(r: np.random.Generator) -> Solid:
    """A square or round top on four legs or on one pole with a base."""
    s, w, d, h = Solid(), r.uniform(0.7, 1.3), r.uniform(0.5, 0.8), r.uniform(0.6, 1.2)
    thick = r.uniform(0.04, 0.1)
    if r.random() < 0.6:
        _legs(s, r, w - 0.15, d - 0.15, h)
        s.box("tabletop", (0, 0, h + thick), (w, d, thick))
    else:
        s.rod("base", (0, 0, 0), (0, 0, 0.1), d * 0.7, 0.8)
        s.rod("pole", (0, 0, 0.1), (0, 0, h), r.uniform(0.06, 0.14))
        s.rod("tabletop", (0, 0, h), (0, 0, h + 2 * thick), d)
    return s


def desk(r: np.random.Generator) -> Solid:
    """A top on legs with a block of drawers on one side."""
    s, w, d, h = Solid(), r.uniform(0.9, 1.3), r.uniform(0.45, 0.65), r.uniform(0.65, 0.85)
    _legs(s, r, w - 0.1, d - 0.1, h)
    s.box("tabletop", (0, 0, h + 0.05), (w, d, 0.06))
    side = r.choice([-1, 1])
    for k in range(2):
        z = h - 0.15 - 0.25 * k
        s.box("drawer", (side * (w - 0.35), 0, z), (0.28, d - 0.05, 0.11))
        s.ball("knob", (side * (w - 0.35), -d, z), 0.05)
    return s


def bed(r: np.random.Generator) -> Solid:
    """A frame with legs, a mattress, a headboard and pillows."""
    s, w, length, h = Solid(), r.uniform(0.5, 1.0), r.uniform(1.0, 1.2), r.uniform(0.2, 0.35)
    _legs(s, r, w - 0.1, length - 0.1, h)
    s.box("bedframe", (0, 0, h + 0.08), (w, length, 0.08))
    s.box("mattress", (0, 0, h + 0.27), (w - 0.05, length - 0.05, r.uniform(0.1, 0.15)))
    s.box("headboard", (0, length, h + 0.4), (w, 0.06, r.uniform(0.35, 0.55)))
    for i in (-1, 1) if w > 0.7 else (0,):
        s.ball("pillow", (i * w / 2, length - 0.25, h + 0.45), (0.3, 0.18, 0.1))
    return s


def lamp(r: np.random.Generator) -> Solid:
    """A base, a pole and a shade that narrows upward."""
    s, h, radius = Solid(), r.uniform(0.8, 1.8), r.uniform(0.25, 0.5)
    s.rod("base", (0, 0, 0), (0, 0, r.uniform(0.05, 0.2)), r.uniform(0.2, 0.4), r.uniform(0.5, 1))
    s.rod("pole", (0, 0, 0.05), (0, 0, h), r.uniform(0.03, 0.06))
    s.tub("shade", (0, 0, h + 0.5), (0, 0, h - 0.1), radius * r.uniform(0.5, 0.9), 1.4, 0.06)
    return s


def bookshelf(r: np.random.Generator) -> Solid:
    """A carcass with shelves and books."""
    s, w, d, h = Solid(), r.uniform(0.5, 0.9), r.uniform(0.15, 0.3), r.uniform(0.8, 1.2)
    n = int(r.integers(2, 5))
    s.box("cabinet", (0, 0, h), (w, d, h))
    s.box(None, (0, -0.1, h), (w - 0.08, d, h - 0.08))
    for k in range(1, n):
        s.box("shelf", (0, 0, 2 * h * k / n), (w - 0.08, d - 0.02, 0.04))
    for k in range(n):
        span = r.uniform(0.2, 0.6) * w
        s.box("pages", (r.uniform(-0.2, 0.2), 0, 2 * h * k / n + 0.22), (span, d * 0.7, 0.16))
    return s


def wardrobe(r: np.random.Generator) -> Solid:
    """A cabinet behind two doors with knobs, on a plinth."""
    s, w, d, h = Solid(), r.uniform(0.4, 0.8), r.uniform(0.25, 0.45), r.uniform(0.5, 1.2)
    s.box("plinth", (0, 0.03, 0.05), (w - 0.05, d - 0.05, 0.06))
    s.box("cabinet", (0, 0, h + 0.1), (w, d, h))
    for i in (-1, 1):
        s.box("door", (i * w / 2, -d - 0.03, h + 0.1), (w / 2 - 0.03, 0.05, h - 0.06))
        s.ball("knob", (i * 0.1, -d - 0.1, h), 0.06)
    return s


def dresser(r: np.random.Generator) -> Solid:
    """A cabinet with rows of drawers, knobs and legs."""
    s, w, d = Solid(), r.uniform(0.5, 0.8), r.uniform(0.25, 0.4)
    n = int(r.integers(2, 5))
    _legs(s, r, w - 0.08, d - 0.08, 0.3)
    s.box("cabinet", (0, 0, 0.3 + 0.2 * n), (w, d, 0.2 * n))
    for k in range(n):
        z = 0.5 + 0.4 * k
        s.box("drawer", (0, -d - 0.02, z), (w - 0.06, 0.05, 0.16))
        s.ball("knob", (0, -d - 0.1, z), 0.06)
    return s


def door(r: np.random.Generator) -> Solid:
    """A panel in a frame with a knob."""
    s, w, h = Solid(), r.uniform(0.4, 0.6), r.uniform(0.9, 1.1)
    for i in (-1, 1):
        s.box("doorframe", (i * (w + 0.06), 0, h), (0.08, 0.12, h + 0.1))
    s.box("doorframe", (0, 0, 2 * h + 0.06), (w + 0.1, 0.12, 0.08))
    s.box("panel", (0, 0, h), (w, 0.06, h))
    for j in (-1, 1):
        s.ball("knob", (r.choice([-1, 1]) * (w - 0.12), j * 0.12, h), 0.08)
    return s


def window(r: np.random.Generator) -> Solid:
    """Panes in a frame above a sill."""
    s, w, h = Solid(), r.uniform(0.5, 0.9), r.uniform(0.5, 0.9)
    s.box("windowframe", (0, 0, h), (w, 0.08, h))
    n = int(r.integers(1, 3))
    for k in range(n):
        half = w / n - 0.08
        x = -w + (2 * k + 1) * w / n
        s.box(None, (x, 0, h), (half, 0.2, h - 0.1))
        s.box("pane", (x, 0, h), (half, 0.03, h - 0.1))
    s.box("sill", (0, -0.1, -0.02), (w + 0.1, 0.22, 0.07))
    return s


def house(r: np.random.Generator) -> Solid:
    """Walls, a roof of two slopes, a chimney, a door and windows."""
    s, w, d, h = Solid(), r.uniform(0.6, 1.0), r.uniform(0.5, 0.8), r.uniform(0.35, 0.6)
    slope = r.uniform(25, 45)
    reach = (d + 0.1) / np.cos(np.radians(slope))
    s.box("chimney", (w * 0.5, d * 0.4, 2 * h + d * 0.6), (0.09, 0.09, d * 0.5))
    s.box("wall", (0, 0, h), (w, d, h))
    for j in (-1, 1):
        z = 2 * h + np.tan(np.radians(slope)) * (d + 0.1) / 2
        turn = rotation_about("x", -j * slope)
        s.box("roof", (0, j * (d + 0.1) / 2, z), (w + 0.1, reach / 2, 0.06), turn)
    s.box("door", (0, -d, h * 0.6), (0.14, 0.06, h * 0.6))
    for i in (-1, 1):
        s.box("window", (i * w * 0.6, -d, h * 1.2), (0.13, 0.06, 0.13))
    return s


def fence(r: np.random.Generator) -> Solid:
    """Posts joined by rails."""
    s, h, n = Solid(), r.uniform(0.5, 0.9), int(r.integers(3, 6))
    for x in np.linspace(-1, 1, n):
        s.box("pole", (x, 0, h / 2), (0.07, 0.07, h / 2 + 0.1))
    for z in np.linspace(0.25, 0.85, int(r.integers(2, 4))) * h:
        s.box("rail", (0, 0, z), (1.1, 0.045, 0.05))
    return s


def clock(r: np.random.Generator) -> Solid:
    """A round case with a dial and two hands."""
    s, radius = Solid(), r.uniform(0.5, 0.8)
    s.rod("clockcase", (0, 0.2, 0.8), (0, -0.1, 0.8), radius)
    s.rod("dial", (0, -0.08, 0.8), (0, -0.16, 0.8), radius * 0.85)
    for length in (0.75, 0.5):
        angle = r.uniform(0, 2 * np.pi)
        tip = np.array([np.cos(angle), 0, np.sin(angle)]) * radius * length + [0, -0.2, 0.8]
        s.rod("hands", (0, -0.2, 0.8), tip, 0.05)
    if r.random() < 0.6:
        s.box("base", (0, 0.05, 0.8 - radius - 0.05), (radius * 0.8, 0.25, 0.1))
    return s


def candlestick(r: np.random.Generator) -> Solid:
    """A candle with a wick in a holder."""
    s, h, radius = Solid(), r.uniform(0.4, 1.2), r.uniform(0.1, 0.3)
    s.rod("holder", (0, 0, 0), (0, 0, 0.1), radius * 1.9, 0.9)
    s.rod("holder", (0, 0, 0.1), (0, 0, 0.35), radius * 1.2)
    s.rod("candle", (0, 0, 0.3), (0, 0, 0.3 + h), radius, r.uniform(0.7, 1))
    s.rod("wick", (0, 0, 0.3 + h), (0, 0, 0.42 + h), 0.035)
    return s


def umbrella(r: np.random.Generator) -> Solid:
    """Held out: a canopy with ribs on a shaft that ends in a hook."""
    s, h, radius = Solid(), r.uniform(1.2, 1.6), r.uniform(0.7, 1.0)
    s.ball("canopy", (0, 0, h - 0.1), (radius, radius, 0.45))
    s.ball(None, (0, 0, h - 0.2), (radius * 0.98, radius * 0.98, 0.42))
    s.box(None, (0, 0, h - 0.6), (radius * 1.1, radius * 1.1, 0.5))
    for angle in np.arange(6) * np.pi / 3:
        out = np.array([np.cos(angle), np.sin(angle), 0])
        s.rod("ribs", (0, 0, h - 0.35), out * radius * 0.6 + [0, 0, h + 0.02], 0.03)
    s.rod("hook", (0, 0, 0.1), (0, 0, h + 0.4), 0.05)
    s.ring("hook", (0.14, 0, 0.1), 0.14, 0.055, along((0, 1, 0)))
    return s


FURNITURE = {
    f.__name__: f
    for f in (
        chair, armchair, sofa, stool, bench, table, desk, bed, lamp, bookshelf, wardrobe, dresser,
        door, window, house, fence, clock, candlestick,
    )
}  # fmt: skip

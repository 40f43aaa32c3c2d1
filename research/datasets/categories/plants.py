"""Procedural plants, food and toys; z is up."""

from __future__ import annotations

import numpy as np

from ..shapes import Solid, along


def potted_plant(r: np.random.Generator) -> Solid:
    """A pot of soil, a trunk, pads of leaves."""
    s, radius, h = Solid(), r.uniform(0.25, 0.45), r.uniform(0.3, 0.5)
    tall = r.uniform(0.4, 1.0)
    for _ in range(int(r.integers(2, 6))):
        at = (*r.uniform(-0.3, 0.3, 2), h + tall + r.uniform(-0.15, 0.25))
        s.ball("leaves", at, r.uniform(0.18, 0.4, 3))
    bend = r.uniform(-0.15, 0.15, 2)
    s.rod("trunk", (0, 0, h * 0.7), (*bend, h + tall * 0.6), r.uniform(0.05, 0.12), 0.8)
    s.rod("trunk", (*bend, h + tall * 0.55), (0, 0, h + tall), 0.06)
    s.tub("pot", (0, 0, 0), (0, 0, h), radius, r.uniform(1, 1.4), 0.08)
    s.rod("soil", (0, 0, 0.07), (0, 0, h * r.uniform(0.75, 0.95)), radius - 0.08, 1.2)
    s.rod("trunk", (0, 0, h * 0.5), (bend[0] * 0.4, bend[1] * 0.4, h + 0.1), 0.08)
    return s


def cactus(r: np.random.Generator) -> Solid:
    """A cactus with arms in a pot of soil."""
    s, radius, h = Solid(), r.uniform(0.3, 0.4), r.uniform(0.3, 0.5)
    tall, girth = r.uniform(0.5, 1.0), r.uniform(0.14, 0.24)
    s.rod("pot", (0, 0, 0), (0, 0, h), radius, 1.2)
    s.rod("soil", (0, 0, h - 0.1), (0, 0, h + 0.04), radius)
    s.rod("cactus", (0, 0, h), (0, 0, h + tall), girth)
    s.ball("cactus", (0, 0, h + tall), girth)
    for i in (-1, 1):
        z = h + tall * r.uniform(0.3, 0.6)
        s.rod("cactus", (0, 0, z), (i * 0.4, 0, z), girth * 0.6)
        s.rod("cactus", (i * 0.4, 0, z), (i * 0.4, 0, z + r.uniform(0.2, 0.4)), girth * 0.6)
    if r.random() < 0.5:
        s.ball("flower", (0, 0, h + tall + girth), 0.12)
    return s


def tree(r: np.random.Generator) -> Solid:
    """A trunk under a crown."""
    s, h = Solid(), r.uniform(0.5, 1.0)
    radius = r.uniform(0.4, 0.7)
    if r.random() < 0.5:
        s.rod("leaves", (0, 0, h), (0, 0, h + r.uniform(0.8, 1.4)), radius, 0.1)
    else:
        for _ in range(4):
            s.ball("leaves", (*r.uniform(-0.3, 0.3, 2), h + r.uniform(0.2, 0.7)), radius * 0.7)
    s.rod("trunk", (0, 0, 0), (0, 0, h + 0.2), r.uniform(0.08, 0.18), 0.8)
    return s


def bouquet(r: np.random.Generator) -> Solid:
    """Flowers with stems and leaves in a vase."""
    s, radius, h = Solid(), r.uniform(0.18, 0.3), r.uniform(0.4, 0.7)
    for _ in range(int(r.integers(2, 5))):
        tip = np.array([*r.uniform(-0.35, 0.35, 2), h + r.uniform(0.4, 0.8)])
        s.rod("stem", (0, 0, h * 0.8), tip, 0.035)
        s.ball("flower", tip, r.uniform(0.1, 0.18))
        s.ball("leaves", tip * 0.6 + [0, 0, h * 0.45], (0.13, 0.13, 0.05))
    s.rod("vase", (0, 0, 0), (0, 0, h), radius, r.uniform(0.7, 1.3))
    return s


def apple(r: np.random.Generator) -> Solid:
    """A fruit with a stem and a leaf."""
    s, a = Solid(), r.uniform(0.45, 0.6)
    s.ball("fruit", (0, 0, a), (a, a, a * r.uniform(0.85, 1.1)))
    s.rod("stem", (0, 0, 1.8 * a), (0.05, 0, 1.8 * a + 0.35), 0.05)
    s.ball("leaves", (0.22, 0, 1.8 * a + 0.22), (0.2, 0.1, 0.05))
    return s


def mushroom(r: np.random.Generator) -> Solid:
    """A cap on a stem."""
    s, h, radius = Solid(), r.uniform(0.5, 0.9), r.uniform(0.4, 0.6)
    s.ball("mushroomcap", (0, 0, h), (radius, radius, r.uniform(0.25, 0.45)))
    s.box(None, (0, 0, h - 0.5), (0.8, 0.8, 0.45))
    s.rod("stem", (0, 0, 0), (0, 0, h), r.uniform(0.12, 0.22), 0.8)
    return s


def layer_cake(r: np.random.Generator) -> Solid:
    """Layers of cake and icing with candles."""
    s, radius, h = Solid(), r.uniform(0.5, 0.7), r.uniform(0.2, 0.35)
    s.rod("cake", (0, 0, 0), (0, 0, h), radius)
    s.rod("icing", (0, 0, h), (0, 0, h + 0.1), radius)
    if r.random() < 0.5:
        s.rod("cake", (0, 0, h + 0.1), (0, 0, 2 * h), radius * 0.7)
        s.rod("icing", (0, 0, 2 * h), (0, 0, 2 * h + 0.1), radius * 0.7)
        h = 2 * h
    for angle in np.arange(4) * np.pi / 2:
        at = np.array([np.cos(angle), np.sin(angle), 0]) * radius * 0.45 + [0, 0, h + 0.08]
        s.rod("candle", at, at + np.array([0, 0, 0.3]), 0.045)
    return s


def ice_cream(r: np.random.Generator) -> Solid:
    """A cone with one to three scoops."""
    s, h, radius = Solid(), r.uniform(0.7, 1.1), r.uniform(0.25, 0.4)
    for k in range(int(r.integers(1, 4))):
        s.ball("scoop", (0, 0, h + radius * (0.5 + 1.3 * k)), radius)
    s.rod("cone", (0, 0, h), (0, 0, 0), radius, 0.15)
    return s


def burger(r: np.random.Generator) -> Solid:
    """A patty and lettuce between two halves of a bun."""
    s, radius = Solid(), r.uniform(0.5, 0.7)
    thick = r.uniform(0.1, 0.2)
    s.rod("bun", (0, 0, 0), (0, 0, 0.2), radius)
    s.ball("bun", (0, 0, 0.35 + thick), (radius, radius, r.uniform(0.3, 0.5)))
    s.box(None, (0, 0, 0.27 + thick / 2), (1.0, 1.0, 0.08 + thick / 2))
    s.rod("patty", (0, 0, 0.2), (0, 0, 0.2 + thick), radius * 0.95)
    s.rod("lettuce", (0, 0, 0.2 + thick), (0, 0, 0.36 + thick), radius * 1.15)
    return s


def lollipop(r: np.random.Generator) -> Solid:
    """A sweet on a stick."""
    s, h, radius = Solid(), r.uniform(0.7, 1.2), r.uniform(0.25, 0.4)
    s.rod("stick", (0, 0, 0), (0, 0, h), 0.05)
    s.ball("sweet", (0, 0, h + radius * 0.7), (radius, r.uniform(0.1, 1) * radius, radius))
    return s


def teddy(r: np.random.Generator) -> Solid:
    """A stuffed toy: torso with head, limbs, ears, nose."""
    s, a = Solid(), r.uniform(0.35, 0.45)
    z = 0.35 + a
    for i in (-1, 1):
        s.ball("limb", (i * a * 0.8, -0.15, 0.25), (0.16, r.uniform(0.2, 0.35), 0.18))
        s.ball("limb", (i * (a + 0.1), 0, z + 0.15), (0.25, 0.13, 0.14))
        s.ball("ear", (i * 0.27, 0, z + a + 0.55), r.uniform(0.11, 0.16))
    s.ball("torso", (0, 0, z), (a, a * 0.85, a * 1.1))
    s.ball("torso", (0, 0, z + a + 0.25), 0.33)
    s.ball("nose", (0, -0.33, z + a + 0.22), 0.1)
    return s


def duck(r: np.random.Generator) -> Solid:
    """A toy duck: torso with head, beak, wings."""
    s, a = Solid(), r.uniform(0.45, 0.6)
    for j in (-1, 1):
        s.ball("wing", (-0.05, j * a * 0.75, 0.45), (0.3, 0.1, 0.18))
    s.ball("torso", (0, 0, 0.4), (a, a * 0.75, 0.4))
    s.ball("torso", (a * 0.6, 0, 0.95), r.uniform(0.26, 0.34))
    s.ball("beak", (a * 0.6 + 0.35, 0, 0.92), (0.18, 0.13, 0.06))
    return s


def snowman(r: np.random.Generator) -> Solid:
    """Two or three balls with a nose, limbs of twigs and a hat."""
    s, a = Solid(), r.uniform(0.4, 0.5)
    for i in (-1, 1):
        s.rod("stick", (0, 0, 2.2 * a), (i * 0.9, 0, 2.8 * a), 0.045)
    s.ball("torso", (0, 0, a), a)
    s.ball("torso", (0, 0, 2.3 * a), a * 0.7)
    s.rod("nose", (0, -a * 0.6, 2.4 * a), (0, -a * 0.6 - 0.35, 2.4 * a), 0.07, 0.3)
    s.rod("brim", (0, 0, 2.85 * a), (0, 0, 2.95 * a), a * 0.75)
    s.rod("hatcrown", (0, 0, 2.9 * a), (0, 0, 3.7 * a), a * 0.45)
    return s


def robot(r: np.random.Generator) -> Solid:
    """A box torso with limbs, a head, an antenna."""
    s, w, h = Solid(), r.uniform(0.3, 0.45), r.uniform(0.35, 0.5)
    s.box("torso", (0, 0, 0.5 + h), (w, 0.25, h))
    s.box("head", (0, 0, 0.75 + 2 * h), (0.25, 0.22, 0.2))
    s.rod("antenna", (0, 0, 0.9 + 2 * h), (0, 0, 1.3 + 2 * h), 0.035)
    for i in (-1, 1):
        s.box("limb", (i * (w + 0.12), 0, 0.5 + h), (0.08, 0.1, h * 0.9))
        s.box("limb", (i * w * 0.55, 0, 0.25), (0.11, 0.12, 0.28))
    return s


def monument(r: np.random.Generator) -> Solid:
    """A statue on a rock or a plinth."""
    s, h = Solid(), r.uniform(0.8, 1.2)
    if r.random() < 0.5:
        s.box("plinth", (0, 0, 0.15), (0.35, 0.35, 0.16))
    else:
        s.ball("rock", (0, 0, 0.1), (0.45, 0.4, 0.25))
    s.rod("statue", (0, 0, 0.25), (0, 0, 0.3 + h), r.uniform(0.15, 0.25), 0.6)
    s.ball("statue", (0, 0, 0.45 + h), 0.17)
    for i in (-1, 1):
        s.rod("statue", (0, 0, h), (i * 0.35, -0.1, h * r.uniform(0.7, 1.2)), 0.06)
    return s


def garden(r: np.random.Generator) -> Solid:
    """Soil with rocks, a tree and flowers."""
    s = Solid()
    s.box("soil", (0, 0, 0.1), (0.9, 0.7, 0.12))
    at = r.uniform(-0.4, 0.4, 2)
    s.ball("leaves", (*at, 1.1), r.uniform(0.25, 0.4, 3))
    s.rod("trunk", (*at, 0.15), (*at, 0.9), r.uniform(0.06, 0.12))
    for _ in range(3):
        s.ball("rock", (*r.uniform(-0.7, 0.7, 2), 0.25), r.uniform(0.1, 0.22, 3))
        x, y = r.uniform(-0.7, 0.7, 2)
        s.rod("stem", (x, y, 0.15), (x, y, 0.45), 0.035)
        s.ball("flower", (x, y, 0.5), 0.1)
    return s


def candy_bowl(r: np.random.Generator) -> Solid:
    """A bowl full of fruit or candy, with rings for its foot."""
    s, radius, h = Solid(), r.uniform(0.4, 0.6), r.uniform(0.25, 0.4)
    s.ring("base", (0, 0, 0), radius * 0.5, 0.06, along((0, 0, 1)))
    inner = "fruit" if r.random() < 0.6 else "sweet"
    for _ in range(5):
        s.ball(inner, (*r.uniform(-0.25, 0.25, 2), h + r.uniform(0, 0.2)), r.uniform(0.13, 0.22))
    s.tub("bowl", (0, 0, 0), (0, 0, h), radius * 0.6, 1.6, 0.08)
    return s


PLANTS = {
    f.__name__: f
    for f in (
        potted_plant, cactus, tree, bouquet, apple, mushroom, layer_cake, ice_cream, burger,
        lollipop, teddy, duck, snowman, robot, monument, garden, candy_bowl,
    )
}  # fmt: skip

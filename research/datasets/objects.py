"""All procedural objects: the named categories, the held-out ones, and composites without sense."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .categories.clothing import CLOTHING
from .categories.containers import CONTAINERS
from .categories.furniture import FURNITURE, umbrella
from .categories.household import HOUSEHOLD
from .categories.plants import PLANTS
from .categories.tools import TOOLS
from .categories.vehicles import VEHICLES, boat
from .parts import part_kinds
from .shapes import MAX_PARTS, Solid, along, pack

Builder = Callable[[np.random.Generator], Solid]
# The order is part of every file of clauses and of every seed: new groups go to the end.
CATEGORIES: dict[str, Builder] = {
    **FURNITURE, **TOOLS, **CONTAINERS, **CLOTHING, **VEHICLES, **HOUSEHOLD, **PLANTS,
}  # fmt: skip
HELD_OUT: dict[str, Builder] = {"boat": boat, "umbrella": umbrella}


class Objects(NamedTuple):
    """Many solids: packed primitives (n, rows, 18), part kinds (n, 6) with -1, categories (n,).

    ``kinds`` indexes ``list(part_kinds())``, ``category`` indexes ``category_names()`` or is -1.
    """

    rows: np.ndarray
    kinds: np.ndarray
    category: np.ndarray


def category_names() -> list[str]:
    """Names of all categories, the held-out ones last."""
    return [*CATEGORIES, *HELD_OUT]


def composite(rng: np.random.Generator) -> Solid:
    """Return a heap of random primitives, each a part of its own: words and shape tell nothing."""
    solid = Solid()
    centre = np.zeros(3)
    for index in range(int(rng.integers(2, MAX_PARTS + 1))):
        half = rng.uniform(0.08, 0.5, 3)
        turn = along(rng.normal(size=3)) if rng.random() < 0.5 else None
        shape = rng.integers(4)
        if shape == 0:
            solid.box(str(index), centre, half, turn)
        elif shape == 1:
            solid.ball(str(index), centre, half, turn)
        elif shape == 2:
            solid.ring(str(index), centre, half[0] + 0.1, half[1] * 0.3 + 0.03, turn)
        else:
            step = rng.normal(size=3) * 0.5
            solid.rod(
                str(index), centre, centre + step, half[0] * 0.6 + 0.03, rng.uniform(0.3, 1.5)
            )
        centre = centre + rng.normal(size=3) * 0.4
    return solid


def make_objects(
    count: int, rng: np.random.Generator, *, names: Sequence[str] | None = None
) -> Objects:
    """Return ``count`` objects of random categories (``names``: those of training by default)."""
    builders = {**CATEGORIES, **HELD_OUT}
    numbers = {name: i for i, name in enumerate(part_kinds())}
    chosen = rng.choice(list(names or CATEGORIES), size=count)
    solids = [builders[name](rng) for name in chosen]
    kinds = np.full((count, MAX_PARTS), -1, dtype=np.int64)
    for row, solid in zip(kinds, solids, strict=True):
        row[: len(solid.parts)] = [numbers[part] for part in solid.parts]
    order = {name: i for i, name in enumerate(category_names())}
    return Objects(pack(solids), kinds, np.array([order[name] for name in chosen]))


def make_composites(count: int, rng: np.random.Generator) -> Objects:
    """Return ``count`` composites; their parts have no kind yet (0): training draws words."""
    solids = [composite(rng) for _ in range(count)]
    kinds = np.full((count, MAX_PARTS), -1, dtype=np.int64)
    for row, solid in zip(kinds, solids, strict=True):
        row[: len(solid.parts)] = 0
    return Objects(pack(solids), kinds, np.full(count, -1))

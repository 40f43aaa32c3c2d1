"""Objects whose parts are called something, and the actor that reads ranges off the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from jaxtyping import Int

from ....fem.mpm.materials import MaterialClass, class_of
from ....fem.table import Band, Material, Span
from ..grammar import spoken_names
from ..objects import category_names, make_objects
from ..parts import part_kinds, spoken
from ..ranges import Named, row_ends
from ..shapes import EMPTY, rasterise
from .proposal import PartRange, Proposal

# Voxels along the longest side, two a cell of the simulation: as many as give at most so many
# particles; bulky things bend no worse on a coarser grid.
VOXELS, MOST_PARTICLES = (40, 32, 24), 5_000
# Share of the parts whose name states their matter ("oak leg"); the others are called "leg".
TOLD = 0.3


@dataclass(frozen=True, eq=False)
class AuditObject:
    """An object of an audit, made again from ``seed`` and ``number``.

    ``parts`` are kinds of parts with what they are called and may be made of; ``part`` is the
    index of every voxel into them, -1 outside.
    """

    seed: int
    number: int
    name: str
    parts: dict[str, Named]
    part: Int[np.ndarray, "x y z"]


Actor = Callable[[AuditObject], Proposal]


def draw_object(seed: int, number: int) -> AuditObject:
    """Object ``number`` of ``seed``: of any category, its parts called by chance."""
    import torch

    rng = np.random.default_rng([seed, number])
    names, kinds = category_names(), list(part_kinds().values())
    drawn = make_objects(1, rng, names=names)
    rows, part = torch.tensor(drawn.rows), np.zeros(0)
    for voxels in VOXELS:
        padded = rasterise(rows, cells=voxels + 2)[0].numpy().astype(np.int64)
        part = np.where(padded == EMPTY, -1, padded)[1:-1, 1:-1, 1:-1]
        if (part >= 0).sum() <= MOST_PARTICLES:
            break
    own = [int(kind) for kind in drawn.kinds[0] if kind >= 0]
    named = {kinds[kind].name: _called(kind, rng) for kind in own}
    return AuditObject(seed, number, spoken(names[drawn.category[0]]), named, part)


def _called(kind: int, rng: np.random.Generator) -> Named:
    """Call a part by a word for it, or by that and its matter."""
    found = list(part_kinds().values())[kind]
    word = str(rng.choice(found.words))
    if rng.random() >= TOLD:
        return Named(word, kind, found.materials)
    row = found.materials[rng.integers(len(found.materials))]
    return Named(f"{spoken_names(row)[0]} {word}", kind, (row,))


def propose_by_table(thing: AuditObject) -> Proposal:
    """Ranges that the plausible rows of every part span, and the order that they keep."""
    parts = {name: _range(named) for name, named in thing.parts.items()}
    return Proposal(parts, order_of({name: part.band for name, part in parts.items()}))


def _range(named: Named) -> PartRange:
    rows = named.materials
    soft, stiff = min(rows, key=lambda row: row.E.min), max(rows, key=lambda row: row.E.max)
    return PartRange(
        band=band_of(rows),
        matter=(MaterialClass(class_of(soft)), MaterialClass(class_of(stiff))),
        text=named.text,
        synonyms=list(part_kinds().values())[named.kind].words,
        told=len(rows) == 1,
    )


def band_of(rows: tuple[Material, ...]) -> Band:
    """Smallest ranges of E [Pa], nu [1] and rho [kg/m^3] that hold those of all rows."""
    low, high = np.array([row_ends(row) for row in rows]).transpose(1, 0, 2)
    return Band(*map(Span, low.min(axis=0).tolist(), high.max(axis=0).tolist()))


def order_of(bands: dict[str, Band]) -> tuple[str, ...]:
    """Constraints between parts whose ranges of E or rho do not overlap: ">=" where they touch."""
    lines = []
    for field in ("E", "rho"):
        for a, b in permutations(bands, 2):
            low, high = getattr(bands[a], field).min, getattr(bands[b], field).max
            if low >= high:
                lines.append(f"{a}.{field} {'>' if low > high else '>='} {b}.{field}")
    return tuple(lines)

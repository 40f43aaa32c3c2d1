"""Parts divided, and clauses matched to them, by how surely each clause speaks of a cell.

A part that is one piece for the modeller may be several for the speaker ("the legs are oak, the
seat is foam" of a chair in one piece): it is then divided by the clauses. Parts that are one thing
several times, as the legs of a table, are one for a predictor.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .grid import PartVoxels
from .text.clauses import Clause
from .text.parts import EXPORTED, part_name_words, places, stem

SMOOTH = 3  # cells: the shares of the clauses are averaged over cubes of this edge
SPECK = 0.01  # of a part's cells: a smaller piece is given to its surroundings
_LEAST = 1e-6  # of a share, for its logarithm
# Parts of one name are one thing where the largest has so many times the volume of the smallest at
# most: "leg_1" and "leg_2", but not the top and a leg that are both called "Cylinder".
SIZES = 2.0
# What modelling programs call a thing before anyone names it.
NAMELESS = EXPORTED | frozenset(
    "object part mesh shape body cube cylinder sphere plane circle cone torus".split()
)


class Partition(NamedTuple):
    """Pieces, for each the part it is of, and the clause that speaks of it, if any."""

    parts: PartVoxels
    parents: tuple[int, ...]
    owners: tuple[int | None, ...]


def match_clauses(
    parts: PartVoxels,
    left_open: Sequence[int],
    shares: Float[np.ndarray, "nx ny nz k"],
    unbound: Sequence[int],
) -> tuple[int | None, ...]:
    """Find the clause that speaks of each open part, None for none.

    ``shares`` say how surely each clause speaks of a cell, the last one that none does. Each of the
    ``unbound`` clauses, which no name binds, has one part at least, so that all fit best together.
    """
    from scipy.optimize import linear_sum_assignment

    none = shares.shape[-1] - 1
    mean = np.array([shares[parts.part == i].mean(axis=0) for i in left_open])
    owner = mean.argmax(axis=1)
    rows, columns = linear_sum_assignment(-np.log(mean[:, list(unbound)] + _LEAST))
    owner[rows] = np.array(unbound, dtype=int)[columns]
    chosen = dict(zip(left_open, owner.tolist(), strict=True))
    return tuple(
        None if chosen.get(i, none) == none else chosen[i] for i in range(len(parts.part_names))
    )


def partition(
    parts: PartVoxels,
    left_open: Sequence[int],
    shares: Float[np.ndarray, "nx ny nz k"],
    clauses: Sequence[Clause],
) -> Partition:
    """Divide open parts by the clauses that speak of their cells; ``shares`` as above."""
    from scipy.ndimage import distance_transform_edt, uniform_filter
    from scipy.ndimage import label as connect

    none = len(clauses)
    label, names, labels = parts.part.copy(), list(parts.part_names), list(parts.labels)
    parents = list(range(len(names)))
    owners: list[int | None] = [None] * len(names)
    for i in left_open:
        cells = parts.part == i
        if not cells.any():
            continue
        # The clause of each of the part's cells, without noise: specks go to their surroundings.
        smooth = np.where(cells[..., None], shares, 0.0)
        smooth = uniform_filter(smooth, SMOOTH, mode="constant", axes=(0, 1, 2))
        owner = np.where(cells, smooth.argmax(axis=-1), -1)
        speck = np.zeros_like(cells)
        for k in np.unique(owner[cells]):
            piece, _ = connect(owner == k, structure=np.ones((3, 3, 3)))
            speck |= (piece > 0) & (np.bincount(piece.ravel()) < SPECK * cells.sum())[piece]
        if speck.any() and not speck[cells].all():
            nearest = distance_transform_edt(
                ~(cells & ~speck), return_distances=False, return_indices=True
            )
            owner = np.where(speck, owner[tuple(nearest)], owner)
        owner = owner[cells]
        # What nothing speaks of keeps the name; without it every piece is named by its clause.
        kept, *others = sorted(np.unique(owner), key=lambda k: (k != none, -(owner == k).sum()))
        if kept != none:
            owners[i] = int(kept)
            if others:
                names[i] = piece_name(parts.part_names[i], clauses[kept], names)
        for k in others:
            label[tuple(axis[owner == k] for axis in np.nonzero(cells))] = len(names)
            names.append(piece_name(parts.part_names[i], clauses[k], names))
            labels.append(parts.labels[i])
            parents.append(i)
            owners.append(int(k))
    pieces = PartVoxels(parts.grid, label, tuple(names), tuple(labels))
    return Partition(pieces, tuple(parents), tuple(owners))


def piece_name(part: str, clause: Clause, taken: Sequence[str]) -> str:
    """Name of the piece of a part that a clause speaks of, unlike those that are taken."""
    spoken = clause.parts or map(stem, (clause.phrase or clause.text).split())
    name = f"{part} {' '.join(spoken)}"
    options = (name, *(f"{name} {i}" for i in range(2, len(taken) + 3)))
    return next(option for option in options if option not in taken)


def alike(
    parts: PartVoxels, among: Iterable[int], said: Sequence[object] | None = None
) -> tuple[int, ...]:
    """For each part the first one that is the same thing, itself where none is or not ``among``.

    What is ``said`` of each part, if given, must be the same too.

    Two are the same where all words for them are, but for numbers and places ("leg_fl", "leg_br"),
    and their sizes are near; where no word names them, where they are of one shape.
    """
    first, seen, volumes = list(range(len(parts.part_names))), list[int](), parts.volumes
    # Words of a name, and of the other labels, that tell more than a number, a letter, a place or
    # what a program wrote
    names = []
    for labels in parts.part_labels:
        name, *others = (
            tuple(
                word for word in part_name_words(label)
                if len(word) > 1 and word.isalpha() and word not in places() | NAMELESS
            )
            for label in labels
        )  # fmt: skip
        names.append((name, frozenset(word for label in others for word in label)))
    kinds = list(zip(names, said or [None] * len(names), strict=True))
    for i in among:
        for k in seen:
            small, large = sorted((volumes[k], volumes[i]))
            near = bool(names[i][0]) and large <= SIZES * small
            if kinds[k] == kinds[i] and (parts.shapes[k] == parts.shapes[i] or near):
                first[i] = k
                break
        seen += [i] * (first[i] == i)
    return tuple(first)


def merged(parts: PartVoxels, first: Sequence[int]) -> PartVoxels:
    """Parts with the cells of each in that of its ``first``; the others, now empty, stay."""
    if list(first) == sorted(set(first)):
        return parts
    label = np.append(first, -1)[parts.part]  # -1, outside, is the last
    return replace(parts, part=label)

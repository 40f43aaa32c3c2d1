"""The answer to a sentence: words where they settle a part, the network for all others.

A part that is one piece for the modeller may be several for the speaker ("the legs are oak, the
seat is foam" of a chair in one piece): the network then divides it by the clauses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..fem.errors import UsageError
from ..fem.scene.materials import FIELDS, Material, MaterialTable, MaterialValue
from .asset import UpAxis
from .field import MaterialField
from .film.predictor import Appearance, FilmPredictor, Found
from .language import words
from .language.binding import of_pieces
from .language.clauses import Clause
from .normalisation import DEFAULT
from .prediction import Binding, PartChoice, fill
from .retrieval.predictor import RetrievalPredictor
from .voxels import PartVoxels

SMOOTH = 3  # cells: the shares of the clauses are averaged over cubes of this edge
_LEAST = 1e-6  # of a share, for its logarithm
SPECK = 0.01  # of a part's cells: a smaller piece is given to its surroundings


class Answer(NamedTuple):
    """The material of every part; ``parents`` are the given parts that they are, or pieces of.

    ``unheard`` are clauses that name a material and were found to speak of nothing.
    """

    parts: PartVoxels
    parents: tuple[int, ...]
    field: MaterialField
    choices: list[PartChoice]
    unheard: tuple[str, ...] = ()


def answer(
    parts: PartVoxels,
    text: str,
    *,
    overrides: Mapping[str, str] | None = None,
    materials: Mapping[str, str] | None = None,
    alpha: float | None = None,
    part_volumes: Sequence[float] | None = None,
    up: UpAxis = "z",
    look: Callable[[], Appearance] | None = None,
    film: FilmPredictor | None = None,
) -> Answer:
    """Return the material of every part.

    Parameters
    ----------
    overrides, materials, alpha, part_volumes
        As ``RetrievalPredictor.choose`` takes them.
    up
        The axis that points up.
    look
        Gives what is seen of the cells; called only where words leave a part open.
    film
        The network; None is words and the table alone.

    Raises
    ------
    UsageError
        Where a part or a material is unknown, or ``alpha`` is to move what the network finds.
    """
    retrieval = RetrievalPredictor()
    choices = retrieval.choose(
        parts.part_labels, text, overrides=overrides, materials=materials, alpha=alpha,
        part_volumes=part_volumes,
    )  # fmt: skip
    there = set(np.unique(parts.part))
    left_open = [i for i, choice in enumerate(choices) if not choice.told and i in there]
    clauses = retrieval.clauses(text)
    if film is None or not left_open:
        field = fill(parts, choices, alpha=alpha)
        everyone = tuple(range(len(choices)))
        return Answer(parts, everyone, field, choices, _unheard(clauses, choices))
    if alpha is not None:
        raise UsageError(
            f"--alpha moves a material within its range, and no word names one for part "
            f"{parts.part_names[left_open[0]]!r}: name it, or use --predictor retrieval"
        )
    found = film.look(parts, text, up=up, appearance=look() if look else None)
    if of_pieces(found.clauses, choices):
        pieces, parents, owners = divide(parts, left_open, found)
    else:
        pieces, parents = parts, tuple(range(len(choices)))
        owners = match(parts, left_open, found, retrieval.homeless(parts.part_labels, text))
    decided = [
        replace(choices[parent], part=name)
        if parent not in left_open
        else _choose(retrieval, found, name, pieces.part == i, owner)
        for i, (name, parent, owner) in enumerate(
            zip(pieces.part_names, parents, owners, strict=True)
        )
    ]
    field = _field(pieces, decided, found)
    return Answer(pieces, parents, field, decided, _unheard(clauses, decided))


def match(
    parts: PartVoxels, left_open: Sequence[int], found: Found, homeless: Sequence[int]
) -> tuple[int | None, ...]:
    """Find the clause that speaks of each open part, None for none.

    Each of the ``homeless`` clauses has one part at least, so that all fit best together.
    """
    from scipy.optimize import linear_sum_assignment

    none = len(found.clauses)
    shares = np.array([found.shares[parts.part == i].mean(axis=0) for i in left_open])
    owner = shares.argmax(axis=1)
    rows, columns = linear_sum_assignment(-np.log(shares[:, list(homeless)] + _LEAST))
    owner[rows] = np.array(homeless, dtype=int)[columns]
    chosen = dict(zip(left_open, owner.tolist(), strict=True))
    return tuple(
        None if chosen.get(i, none) == none else chosen[i] for i in range(len(parts.part_names))
    )


def divide(
    parts: PartVoxels, left_open: Sequence[int], found: Found
) -> tuple[PartVoxels, tuple[int, ...], tuple[int | None, ...]]:
    """Divide open parts by the clauses that speak of their cells.

    Returns the pieces, for each the part it is of, and the clause that speaks of it, if any.
    """
    none = len(found.clauses)
    label, names, labels = parts.part.copy(), list(parts.part_names), list(parts.labels)
    parents = list(range(len(names)))
    owners: list[int | None] = [None] * len(names)
    for i in left_open:
        cells = parts.part == i
        owner = _owners(found.shares, cells)
        if not len(owner):
            continue
        # What nothing speaks of keeps the name; without it every piece is named by its clause.
        kept, *others = sorted(np.unique(owner), key=lambda k: (k != none, -(owner == k).sum()))
        if kept != none:
            owners[i] = int(kept)
            if others:
                names[i] = _piece(parts.part_names[i], found.clauses[kept], names)
        for k in others:
            label[tuple(axis[owner == k] for axis in np.nonzero(cells))] = len(names)
            names.append(_piece(parts.part_names[i], found.clauses[k], names))
            labels.append(parts.labels[i])
            parents.append(i)
            owners.append(int(k))
    pieces = PartVoxels(parts.grid, label, tuple(names), tuple(labels))
    return pieces, tuple(parents), tuple(owners)


def _owners(shares: Float[np.ndarray, "x y z k"], cells: np.ndarray) -> Int[np.ndarray, "n"]:
    """Clause of each of a part's cells, without noise."""
    from scipy.ndimage import distance_transform_edt, label, uniform_filter

    within = cells[..., None]
    smooth = uniform_filter(np.where(within, shares, 0.0), SMOOTH, mode="constant", axes=(0, 1, 2))
    owner = np.where(cells, smooth.argmax(axis=-1), -1)
    fewest = SPECK * cells.sum()
    speck = np.zeros_like(cells)
    for k in np.unique(owner[cells]):
        piece, _ = label(owner == k, structure=np.ones((3, 3, 3)))  # type: ignore
        speck |= (piece > 0) & (np.bincount(piece.ravel()) < fewest)[piece]
    if speck.any() and not speck[cells].all():
        nearest = distance_transform_edt(
            ~(cells & ~speck), return_distances=False, return_indices=True
        )
        owner = np.where(speck, owner[tuple(nearest)], owner)  # type: ignore
    return owner[cells]


def _choose(
    retrieval: RetrievalPredictor, found: Found, part: str, cells: np.ndarray, owner: int | None
) -> PartChoice:
    """Choose for a piece what its clause names, else the row nearest to what the network finds."""
    clause = None if owner is None else found.clauses[owner]
    share = float(found.shares[cells][:, -1 if owner is None else owner].mean())
    said = None if clause is None else clause.text
    binding = Binding(said, share, int(cells.sum()), float(found.spread[cells].mean()))
    why = f"network: {'nothing said' if said is None else repr(said)}, {share:.0%} sure"
    if clause is not None and clause.material:
        choice = retrieval.of_clause(part, clause, why)
        return replace(choice, weight=share, told=False, binding=binding)
    mean = found.values[cells].mean(axis=0)
    value = MaterialValue(*(float(x) for x in DEFAULT.physical(mean)))
    row = _nearest(retrieval.table, mean)
    return PartChoice(part, row, value, share, 0.5, why, False, binding, learned=True)


def _nearest(table: MaterialTable, value: Float[np.ndarray, "3"]) -> Material:
    rows = np.array([DEFAULT.normalise(*row.value()) for row in table])
    return table.rows[int(np.square(rows - value).sum(axis=1).argmin())]


def _unheard(clauses: Sequence[Clause], choices: Sequence[PartChoice]) -> tuple[str, ...]:
    why = "\n".join(choice.why for choice in choices).lower()
    named = (c for c in clauses if c.material and not set(c.parts) & words.REST)
    return tuple(clause.text for clause in named if clause.text.lower() not in why)


def _field(parts: PartVoxels, choices: Sequence[PartChoice], found: Found) -> MaterialField:
    """Return the choices' values, and the network's own cell by cell where it decided alone."""
    field = fill(parts, choices)
    learned = np.isin(parts.part, [i for i, choice in enumerate(choices) if choice.learned])
    values = DEFAULT.physical(found.values)
    own = {
        name: np.where(learned, value, getattr(field, name))
        for name, value in zip(FIELDS, values, strict=True)
    }
    return replace(field, ranges=None if learned.any() else field.ranges, **own)


def _piece(part: str, clause: Clause, taken: Sequence[str]) -> str:
    """Name of the piece of a part that a clause speaks of, unlike those that are taken."""
    name = f"{part} {' '.join(clause.parts) or clause.material or clause.text}"
    options = (name, *(f"{name} {i}" for i in range(2, len(taken) + 3)))
    return next(option for option in options if option not in taken)

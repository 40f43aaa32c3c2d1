"""What looks say of clauses about matter: "the metal is zinc", "walnut and brass"."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.materials import MaterialTable
from ..hearing.clauses import HeardClause
from ..hearing.kinds import KINDS, kind_of
from ..normalisation import Normalisation
from .kinds import KindsByLooks
from .looks import measure

# Of the log ratios so much is believed, and so much is added to that of the part that fits a kind
# best, as what is spoken of is there. Fitted on either source of training, the log loss on the
# other is .53; of .3 and 1 of the ratios .56 and .56, of an addition of 0, 2 and 5 .59, .59 and
# .98; a guess has .82.
_BELIEVED, _SPOKEN = 0.6, 1.0
_NOTHING = 1e-9  # of a share that is divided
_ALIKE = 1e-3  # looks that differ by less are one: a quarter of a step of eight bits


def matters(clauses: Sequence[HeardClause]) -> Int[np.ndarray, "clauses"]:
    """For each clause that speaks of matter alone its kind, as an index into ``KINDS``, else -1."""
    return np.array([_matter(clause) for clause in clauses], dtype=int)


def _matter(clause: HeardClause) -> int:
    if any(kind_of(part) is None for part in clause.parts):
        return -1
    kind = kind_of(clause.phrase) or kind_of(clause.written)
    return -1 if kind is None else KINDS.index(kind)


def by_looks(
    shares: Float[np.ndarray, "n columns"],
    kinds: Int[np.ndarray, "clauses"],
    cells: Int[np.ndarray, "n 3"],
    looks: Float[np.ndarray, "n look"],
    piece: Int[np.ndarray, "n"],
    *,
    parts: bool,
) -> Float[np.ndarray, "n columns"]:
    """Return shares with what clauses about matter have of a cell dealt out anew among their kinds.

    By how much likelier each kind is by the looks of the piece. A network's own shares decide
    within a kind, and for clauses about parts and for none: of kinds of matter it knew no more in
    objects that it had not seen than a guess does (the card of its weights).

    Parameters
    ----------
    shares
        How surely each clause speaks of each cell, and in a last column that none does.
    kinds
        As ``matters`` gives them.
    cells, looks, piece
        As ``looks.measure`` takes them.
    parts
        Whether pieces are parts that somebody made: then each kind that is spoken of is likely to
        have one. Of pieces of one look some are shades, and the same rule bound fewer cells.
    """
    from scipy.special import softmax

    mine = np.flatnonzero(kinds >= 0)
    spoken, of_kind = np.unique(kinds[mine], return_inverse=True)
    # A thing of one look, as a file without colours, tells nothing; nor does one piece.
    if len(spoken) < 2 or not piece.any() or np.ptp(looks, axis=0).max() < _ALIKE:
        return shares
    ratio = _BELIEVED * KindsByLooks.load().log_ratio(measure(cells, looks, piece))[:, spoken]
    own = shares[:, mine].clip(min=_NOTHING)
    of_each = own @ np.eye(len(spoken))[of_kind]
    if parts:
        ratio = ratio + _SPOKEN * _somewhere(ratio)
    dealt = softmax(ratio, axis=1)[piece]
    out = shares.copy()
    out[:, mine] = (own * (dealt / of_each)[:, of_kind]) * shares[:, mine].sum(
        axis=1, keepdims=True
    )
    return out


def _somewhere(ratio: Float[np.ndarray, "pieces kinds"]) -> Float[np.ndarray, "pieces kinds"]:
    """One where a piece is to be of a kind so that each kind has one, at the least loss, else 0."""
    from scipy.optimize import linear_sum_assignment

    kept = np.zeros_like(ratio)
    if len(ratio) >= ratio.shape[1]:
        kept[linear_sum_assignment(ratio.max(axis=1, keepdims=True) - ratio)] = 1.0
    return kept


def told_values(
    clauses: Sequence[HeardClause], table: MaterialTable, normalisation: Normalisation
) -> Float[np.ndarray, "clauses 3"]:
    """Normalised values of the material that each clause names, NaN where it names none."""
    nothing = np.full(3, np.nan)
    return np.array(
        [
            normalisation.normalise(*table.exact(clause.material).value())
            if clause.material
            else nothing
            for clause in clauses
        ]
    ).reshape(-1, 3)


def moved(
    values: Float[np.ndarray, "n 3"],
    gained: Float[np.ndarray, "n columns"],
    told: Float[np.ndarray, "clauses 3"],
) -> Float[np.ndarray, "n 3"]:
    """Return values after clauses ``gained`` shares of each cell: each brings what it tells.

    ``gained`` has one column more than ``told`` has rows, for no clause.
    """
    known = np.isfinite(told[:, 0])
    gained = gained[:, :-1][:, known]
    return values + gained @ told[known] - gained.sum(axis=1, keepdims=True) * values

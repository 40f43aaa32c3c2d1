"""What looks say of clauses about matter: "the metal is zinc", "walnut and brass"."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ..fem.errors import InputError
from ..fem.note import Note
from ..fem.table import MaterialTable
from .appearance.surface import to_linear
from .field import Normalisation
from .text.clauses import Clause
from .text.parts import KINDS, kind_of

# Of the log ratios so much is believed, and so much is added to that of the part that fits a kind
# best, as what is spoken of is there. Fitted on either source of training, the log loss on the
# other is .53; of .3 and 1 of the ratios .56 and .56, of an addition of 0, 2 and 5 .59, .59 and
# .98; a guess has .82.
_BELIEVED, _SPOKEN = 0.6, 1.0
_NOTHING = 1e-9  # of a share that is divided
_ALIKE = 1e-3  # looks that differ by less are one: a quarter of a step of eight bits


def matters(clauses: Sequence[Clause]) -> Int[np.ndarray, "clauses"]:
    """For each clause that speaks of matter alone its kind, as an index into ``KINDS``, else -1."""
    kinds = [
        None
        if any(kind_of(part) is None for part in clause.parts)
        else kind_of(clause.phrase) or kind_of(clause.text)
        for clause in clauses
    ]
    return np.array([-1 if kind is None else KINDS.index(kind) for kind in kinds], dtype=int)


def by_appearance(
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

    shares: How surely each clause speaks of each cell, and in a last column that none does.
    kinds: As ``matters`` gives them.
    cells, looks, piece: As ``looks.measure`` takes them.
    parts: Whether pieces are parts that somebody made: then each kind that is spoken of is likely
        to have one. Of pieces of one look some are shades, and the same rule bound fewer cells.
    """
    from scipy.special import softmax

    mine = np.flatnonzero(kinds >= 0)
    spoken, of_kind = np.unique(kinds[mine], return_inverse=True)
    # A thing of one look, as a file without colours, tells nothing; nor does one piece.
    if len(spoken) < 2 or not piece.any() or np.ptp(looks, axis=0).max() < _ALIKE:
        return shares
    ratio = (
        _BELIEVED * CategoriesByAppearance.load().log_ratio(measure(cells, looks, piece))[:, spoken]
    )
    own = shares[:, mine].clip(min=_NOTHING)
    of_each = own @ np.eye(len(spoken))[of_kind]
    if parts:
        # One where a piece is to be of a kind so that each kind has one, at the least loss, else
        # 0
        from scipy.optimize import linear_sum_assignment

        kept = np.zeros_like(ratio)
        if len(ratio) >= ratio.shape[1]:
            kept[linear_sum_assignment(ratio.max(axis=1, keepdims=True) - ratio)] = 1.0
        ratio = ratio + _SPOKEN * kept
    dealt = softmax(ratio, axis=1)[piece]
    out = shares.copy()
    out[:, mine] = (own * (dealt / of_each)[:, of_kind]) * shares[:, mine].sum(
        axis=1, keepdims=True
    )
    return out


def typed_values(
    clauses: Sequence[Clause], table: MaterialTable, normalisation: Normalisation
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


# How well a piece's looks fit each kind of matter: logistic regression on what is measured.

SHIPPED = Path(__file__).parent / "weights" / "matter.json"
# Of an answer, one in so many is wrong whatever the regression says: names of slots mislead too.
_MISLED = 0.01
_EQUAL = 1e-6  # means that differ by less do so by round-off


@dataclass(frozen=True, eq=False)
class Regression:
    """Multinomial logistic regression of standardised features (n, F) on ``KINDS``.

    ``frequency`` is how often each kind was met.
    """

    mean: Float[np.ndarray, "features"]
    deviation: Float[np.ndarray, "features"]
    weight: Float[np.ndarray, "features kinds"]
    bias: Float[np.ndarray, "kinds"]
    frequency: Float[np.ndarray, "kinds"]

    def log_ratio(self, features: Float[np.ndarray, "n features"]) -> Float[np.ndarray, "n kinds"]:
        """Log of how much likelier each kind is by these looks than it was without them."""
        from scipy.special import log_softmax

        log = log_softmax((features - self.mean) / self.deviation @ self.weight + self.bias, axis=1)
        return np.log(np.exp(log) + _MISLED) - np.log(self.frequency + _MISLED)


@dataclass(frozen=True)
class CategoriesByAppearance:
    """Regressions for things with a finish and opacities, and for those of plain colours."""

    finished: Regression
    plain: Regression

    @classmethod
    @lru_cache(maxsize=2)
    def load(cls, path: Path = SHIPPED) -> CategoriesByAppearance:
        """Return the shipped ones, or those of a file."""
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            if found["features"] != list(FEATURES) or found["kinds"] != list(KINDS):
                raise ValueError(Note("matter.other_features"))
            parts = (
                {k: np.array(v) for k, v in found[name].items()} for name in ("finished", "plain")
            )
            return cls(*(Regression(**part) for part in parts))
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise InputError("matter.hold_kinds", path=path, error=error) from error

    def log_ratio(self, features: Float[np.ndarray, "n features"]) -> Float[np.ndarray, "n kinds"]:
        """As ``Regression.log_ratio``; all of one opacity and finish say nothing by them."""
        if np.ptp(features[:, PLAIN:], axis=0).max() > _EQUAL or features[0, PLAIN] < 1 - _EQUAL:
            return self.finished.log_ratio(features)
        return self.plain.log_ratio(features[:, :PLAIN])


# What is measured of a piece's cells: colour, opacity, finish, and its form in the whole.

# Of a cell: red, green, blue and opacity in [0, 1], then ``surface_colour.Finish``.
LOOK = 7
# Of a piece. The seven of opacity and finish, which a scan lacks, are the last.
FEATURES = (
    "L", "a", "b", "chroma", "a of chroma", "b of chroma", "L deviation", "a deviation",
    "b deviation", "share", "log share", "log thickness", "log greatest thickness", "log pieces",
    "log variance 1", "log variance 2", "log variance 3", "height", "lowest", "highest",
    "width", "depth", "tallness", "log fill", "opacity", "opacity deviation", "metallic",
    "reflectance", "roughness",
)  # fmt: skip
PLAIN = 24
_GREY = 20.0  # of chroma: below, a hue says little
_CONNECTED = np.ones((3, 3, 3))
# sRGB to XYZ under D65, IEC 61966-2-1, over the white point.
_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175],
     [0.0193339, 0.119192, 0.9503041]]
) / np.array([[0.95047], [1.0], [1.08883]])  # fmt: skip


def lab(rgb: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """CIE L*, a*, b* of sRGB colours in [0, 1] (CIE 15:2004)."""
    t = to_linear(np.clip(rgb, 0.0, 1.0)) @ _XYZ.T
    f = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    x, y, z = f.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


def measure(
    cells: Int[np.ndarray, "n 3"], looks: Float[np.ndarray, "n look"], piece: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "pieces features"]:
    """Return ``FEATURES`` of every piece; of lengths, over the longest side of the whole.

    cells: Indices of a thing's cells on an upright grid.
    looks: ``LOOK`` numbers of each.
    piece: The piece of each, from 0, none empty.
    """
    from scipy.ndimage import distance_transform_edt, label

    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    sides = high - low
    longest = sides.max()
    colours = lab(looks[:, :3])
    rows = []
    for k in range(int(piece.max()) + 1):
        mine = piece == k
        seen = looks[mine, 3:].astype(np.float64)
        # Fraction, thickness, pieces, extents and place of the piece in its whole
        own = cells[mine]
        first, last = own.min(axis=0), own.max(axis=0) + 1
        box = np.pad(np.zeros(last - first, dtype=bool), 1)
        box[tuple((own - first + 1).T)] = True
        depth = np.asarray(distance_transform_edt(box))[box]
        _, pieces = label(box, structure=_CONNECTED)
        spread = (own - own.mean(axis=0)) / longest
        # 1e-5: of a sheet one cell thick a variance is nothing; (1/64)^2 / 12 is 2e-5.
        variance = np.linalg.eigvalsh(spread.T @ spread / len(own) + 1e-5 * np.eye(3))[::-1]
        fraction = len(own) / len(cells)
        heights = (np.array([own[:, 2].mean(), first[2], last[2]]) - low[2]) / sides[2]
        form = [
            fraction, np.log(fraction), np.log(depth.mean() / longest),
            np.log(depth.max() / longest), np.log(pieces), *np.log(variance), *heights,
            *(sides / longest), np.log(len(own) / np.prod(last - first)),
        ]  # fmt: skip
        mean = colours[mine].mean(axis=0)
        chroma = float(np.hypot(*mean[1:]))
        hue = mean[1:] / max(chroma, _GREY)
        colour = [*mean, chroma, *hue, *colours[mine].std(axis=0)]
        rows.append([*colour, *form, seen[:, 0].mean(), seen[:, 0].std(),
                     *seen[:, 1:].mean(axis=0)])  # fmt: skip
    return np.array(rows)


# Pieces of one look: the cells of a thing in one piece, grouped by colour, opacity and finish.

# Looks nearer than this are one, in units of CIE L*a*b*: some four times what eyes just tell apart.
# Of 5, 10, 15, 20 and 30 it bound most cells of the training sources (.73, .75, .73, .74, .73).
NEAR = 10.0
STEP = 4.0  # of a histogram, in the same units: a linkage of all cells would take their square
SPECK = 0.01  # of the cells: a smaller piece is given to the look that is nearest
MOST = 12  # pieces
_BINS = 1500  # at most, the fullest ones
# What opacity, metal, reflectance and roughness count, each from 0 to 1, in units of L*a*b*.
_WEIGHTS = np.array([50.0, 30.0, 30.0, 15.0])


def by_look(
    looks: Float[np.ndarray, "n look"],
    *,
    most: int = MOST,
    speck: float = SPECK,
    near: float = NEAR,
) -> Int[np.ndarray, "n"]:
    """Return the piece of every cell, from 0, none empty; at most so many, none a ``speck``.

    Quick shift (Vedaldi & Soatto 2008) on a histogram of looks: each bin goes where the nearest
    denser one goes, a bin that has none as ``near`` stays and is a piece.
    """
    from scipy.spatial.distance import cdist

    seen = np.concatenate([lab(looks[:, :3]), looks[:, 3:] * _WEIGHTS], axis=1)
    _, of_bin, count = np.unique(
        np.round(seen / STEP).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    of_bin = of_bin.ravel()
    means = np.stack([np.bincount(of_bin, column) / count for column in seen.T], axis=1)
    full = np.argsort(-count, kind="stable")[:_BINS]
    places, number = means[full], count[full]
    square = cdist(places, places, "sqeuclidean")
    density = np.exp(-square / (2 * (near / 2) ** 2)) @ number
    order = np.argsort(-density, kind="stable")
    root = np.arange(len(places))  # for each bin the one of greatest density that it climbs to
    for i, at in enumerate(order[1:], start=1):
        denser = order[:i]
        nearest = denser[square[at, denser].argmin()]
        if square[at, nearest] <= near**2:
            root[at] = root[nearest]
    size = np.bincount(root, count[full], minlength=len(full))
    large = np.argsort(-size, kind="stable")[:most]
    large = large[(size[large] >= speck * len(looks)) | (np.arange(len(large)) == 0)]
    piece = cdist(means, means[full][large], "sqeuclidean").argmin(axis=1)
    for i, at in enumerate(large):
        piece[full[root == at]] = i
    return np.unique(piece[of_bin], return_inverse=True)[1].ravel()

"""What a clause says word by word: the table's material, and how stiff, heavy or brittle.

Sentence embeddings hardly tell "very stiff" from "soft" (their cosine is .93), so a clause's
embedding is joined by a few channels read off a closed list of plain English words. They are hints
to the network, which still hears the whole sentence and learns with the hints taken away.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from ...fem.scene.materials import MaterialTable, load_table
from ..normalisation import DEFAULT, Normalisation
from .degrees import BEND, BRITTLE, FLOAT, HEAVY, LIGHT, MODERATE, SINK, SOFT, STIFF, STRONGER
from .levels import Level, material_at_level
from .statement import Reader, as_usual
from .vocabulary import vocabulary_of

CHANNELS = (
    "material", "E", "nu", "rho", "stiffness", "stiffness score", "weight", "weight score",
    "brittle", "floats", "sinks", "strong", "middle",
)  # fmt: skip
# On the scale where an embedding's numbers have unit variance: louder than any one of them.
LOUDNESS = 2.0
REMEMBERED = 1024  # clauses that were read: more than any one object has
# Scores of an adjective as it stands, strengthened, and in the middle of the range.
_PLAIN, _STRONG, _MIDDLE = 0.5, 1.0, 0.1


def _stems(text: str) -> frozenset[str]:
    return frozenset(text.split())


_NOT = _stems("not never cannot no without impossible resist resists resistant barely hardly")
_WEIGHT = _stems("weight weighs weigh density lift carry")
_STIFFNESS = _stems("stiffness firmness rigidity hardness softness flexibility")
_LITTLE = _stems("low little minimal less nothing hardly easy easily lower least")
_MUCH = _stems("high much lot more great ton hard large higher most tons")
_NEAR = 3  # words before an adjective that may negate it
# Scores of an adjective, and the share of a material's own range that it means.
_SCORES, _SHARES = (-1.0, -0.5, -_MIDDLE, _MIDDLE, 0.5, 1.0), (0.04, 0.25, 0.5, 0.5, 0.75, 0.96)
_BRITTLE_SHARE = 0.85


class Lexicon:
    """Channels of clauses, by the words of a material table; values as ``normalisation`` has them.

    ``read`` gives the ``Statement`` of a clause; it remembers what it has read.
    """

    def __init__(
        self, table: MaterialTable | None = None, *, normalisation: Normalisation = DEFAULT
    ) -> None:
        self.table = table or load_table()
        self.normalisation = normalisation
        self.read = lru_cache(maxsize=REMEMBERED)(Reader(vocabulary_of(self.table)))

    def channels(self, text: str) -> Float[np.ndarray, "channels"]:
        """Return the ``CHANNELS`` of one clause, each about in [-1, 1], 0 where it is silent."""
        words = re.findall(r"[a-z]+", as_usual(text))
        stiffness, weight = _stiffness(words), _weight(words)
        water = _water(words)
        return np.array([
            *self._material(text),
            stiffness is not None, stiffness or 0.0, weight is not None, weight or 0.0,
            bool(BRITTLE & set(words)), water > 0, water < 0,
            bool(STRONGER & set(words)), bool(MODERATE & set(words)),
        ], dtype=np.float32)  # fmt: skip

    def _material(self, text: str) -> tuple[float, float, float, float]:
        """Whether the clause names a material, and its normalised value, as stiff as it says."""
        said = self.read(text)
        if said.material is None:
            return (0.0, 0.0, 0.0, 0.0)
        stiffness, weight = _share(_stiffness(said.manner)), _share(_weight(said.manner))
        if stiffness is None and BRITTLE & set(said.manner):
            stiffness = _BRITTLE_SHARE
        value = material_at_level(self.table.exact(said.material), Level(stiffness, weight))
        E, nu, rho = self.normalisation.normalise(*value).tolist()
        return (1.0, E, nu, rho)


def _share(score: float | None) -> float | None:
    """Share of a range [0, 1] that a score means."""
    return None if score is None else float(np.interp(score, _SCORES, _SHARES))


def _sign(words: Sequence[str], low: frozenset[str], high: frozenset[str]) -> list[int]:
    """Signs of the adjectives in ``low`` (-1) and ``high`` (1), turned round where negated."""
    out = []
    for at, word in enumerate(words):
        hard_to = word == "hard" and words[at + 1 : at + 2] == ["to"]
        if word in low or (word in high and not hard_to):
            negated = _NOT & set(words[max(0, at - _NEAR) : at])
            out.append((1 if word in high else -1) * (-1 if negated else 1))
    return out


def _score(words: Sequence[str], signs: Sequence[int]) -> float | None:
    """Score of what was said, None for nothing; words of both signs meet in the middle."""
    said = set(words)
    if not signs:
        return None
    if min(signs) < max(signs):
        return 0.0
    if said & MODERATE and "than" not in said:
        return _MIDDLE * signs[0]
    compared = {"as", "like"} & set(words[-3:-1]) or {"as", "can"} <= said
    strong = said & STRONGER or compared
    return (_STRONG if strong else _PLAIN) * signs[0]


def _stiffness(words: Sequence[str]) -> float | None:
    """Score from -1 (as soft as can be) to 1 (never bends)."""
    signs = _sign(words, SOFT, STIFF)
    said = set(words)
    if said & BEND:
        hard = said & _NOT or "hard" in said
        signs = [1 if hard else -1]
    if "shape" in said:
        signs = [1]
    if not signs and said & _STIFFNESS:
        signs = [-1, 1] if said & MODERATE else [-1 if said & (_LITTLE | _NOT) else 1]
    return _score(words, signs)


def _weight(words: Sequence[str]) -> float | None:
    """Score from -1 (weighs next to nothing) to 1 (weighs a ton)."""
    said = set(words)
    if "water" in said or "own" in said:  # "sags under its own weight"
        return None
    signs = _sign(words, LIGHT, HEAVY)
    if not signs and said & _WEIGHT:
        few, many = bool(said & _LITTLE), bool(said & _MUCH)
        signs = [-1] if few else [1] if many else [-1, 1] if said & MODERATE else []
    if {"than", "air"} <= said:
        signs = [-1]
    return _score(words, signs)


def _water(words: Sequence[str]) -> int:
    """1 for what floats, -1 for what sinks, 0 where nothing is said of it."""
    said = set(words)
    negated = -1 if said & _NOT or "unable" in said else 1
    if said & FLOAT or "surface" in said:
        return negated
    if said & SINK or "bottom" in said:
        return -negated
    if "water" in said:
        lighter = said & LIGHT or "less" in said or "top" in said
        return 1 if lighter else -1
    return 0


@lru_cache(maxsize=4)
def default_lexicon(normalisation: Normalisation = DEFAULT) -> Lexicon:
    """Return the lexicon of the package's own table."""
    return Lexicon(normalisation=normalisation)


def with_lexicon(
    embedding: Float[np.ndarray, "n dim"], texts: Sequence[str], *, lexicon: Lexicon | None = None
) -> Float[np.ndarray, "n wider"]:
    """Unit embeddings joined by a lexicon's channels, shape (n, dim + channels), float32."""
    if not len(texts):
        return np.zeros((0, embedding.shape[1] + len(CHANNELS)), dtype=np.float32)
    lexicon = lexicon or default_lexicon()
    hints = np.stack([lexicon.channels(text) for text in texts])
    loud = LOUDNESS / np.sqrt(embedding.shape[1])
    return np.concatenate([embedding, loud * hints], axis=1).astype(np.float32)

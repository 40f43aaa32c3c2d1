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

from ..fem.table import MaterialTable, load_table
from .normalisation import DEFAULT
from .text import parse
from .vocabulary import Vocabulary

CHANNELS = (
    "material", "E", "nu", "rho", "stiffness", "stiffness score", "weight", "weight score",
    "brittle", "floats", "sinks", "strong", "middle",
)  # fmt: skip
# On the scale where an embedding's numbers have unit variance: louder than any one of them.
LOUDNESS = 2.0
# Scores of an adjective as it stands, strengthened, and in the middle of the range.
_PLAIN, _STRONG, _MIDDLE = 0.5, 1.0, 0.1


def _stems(text: str) -> frozenset[str]:
    return frozenset(text.split())


SOFT = _stems(
    "soft softer softish squishy squashy squeezable plush flexible bendy pliable pliant floppy "
    "supple elastic springy limp yielding cushiony compliant deformable spongy stretchy "
    "flabby tender mushy malleable bouncy rubbery weak slack doughy"
)
STIFF = _stems(
    "stiff stiffer rigid firm hard harder inflexible unyielding sturdy tough solid robust strong "
    "unbending stout taut steely hardened rocklike"
)
LIGHT = _stems("light lighter lightweight airy weightless feathery porous hollow fluffy")
HEAVY = _stems("heavy heavier dense denser weighty hefty burdensome ponderous massive leaden")
BEND = _stems(
    "bend bends bending bent flex flexes deform deforms squeeze squeezed compress press pressed "
    "sag sags give gives yield yields dent dents collapse collapses stretch stretches fold folds"
)
BRITTLE = _stems(
    "brittle fragile break breaks broken breakable shatter shatters crack cracks cracked cracking "
    "snap snaps splinter splinters fracture fractures chip chips crumbly crumble crumbles delicate "
    "crisp frail"
)
FLOAT = _stems("float floats floating afloat buoyant bob bobs unsinkable drift drifts swim swims")
SINK = _stems("sink sinks sinking plunge plunges submerge submerges")
STRONGER = _stems(
    "very extremely super ultra incredibly exceptionally really remarkably utterly extraordinarily "
    "totally completely absolutely perfectly immensely tremendously massively enormously "
    "exceedingly amazingly surprisingly highly hugely terribly so never cannot impossible "
    "slightest own air ton lead jelly feather almost minimal nothing anything all too "
    "collapse collapses"
)
MODERATE = _stems(
    "medium moderate moderately average averagely typical normal normally usual ordinary common "
    "intermediate middling middle halfway neither standard balanced between"
)
_NOT = _stems("not never cannot no without impossible resist resists resistant barely hardly")
_WEIGHT = _stems("weight weighs weigh density lift carry")
_STIFFNESS = _stems("stiffness firmness rigidity hardness softness flexibility")
_LITTLE = _stems("low little minimal less nothing hardly easy easily lower least")
_MUCH = _stems("high much lot more great ton hard large higher most tons")
# Nothing is made of what it is compared with: "soft as wool", "sinks like a stone", "rock hard".
_COMPARISON = re.compile(
    r"\b(?:as|like) (?:an? )?[a-z]+\b|\b[a-z]+ (?=(?:hard|soft|light|heavy)\b)"
)
_NEAR = 3  # words before an adjective that may negate it


# "rock hard" is very hard, and no rock.
_IDIOM = re.compile(r"\b(?:rock(?= (?:hard|solid))|feather(?= light))")


def as_usual(text: str) -> str:
    """Return the clause in lower case, with the idioms that hide a degree said plainly."""
    return _IDIOM.sub("very", text.lower())


class Lexicon:
    """Channels of clauses, by the words of a material table."""

    def __init__(self, table: MaterialTable | None = None) -> None:
        self.table = table or load_table()
        self.vocabulary = Vocabulary(self.table.phrases)

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
        """Whether the clause names a material, and its normalised value."""
        plain = _COMPARISON.sub(" ", as_usual(text))
        named = next((c.material for c in parse(plain, self.vocabulary) if c.material), None)
        if named is None:
            return (0.0, 0.0, 0.0, 0.0)
        E, nu, rho = DEFAULT.normalise(*self.table.exact(named).value()).tolist()
        return (1.0, E, nu, rho)


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


@lru_cache(maxsize=1)
def _default() -> Lexicon:
    return Lexicon()


def with_lexicon(
    embedding: Float[np.ndarray, "n dim"], texts: Sequence[str]
) -> Float[np.ndarray, "n wider"]:
    """Unit embeddings joined by the lexicon's channels, shape (n, dim + channels), float32."""
    if not len(texts):
        return np.zeros((0, embedding.shape[1] + len(CHANNELS)), dtype=np.float32)
    hints = np.stack([_default().channels(text) for text in texts])
    loud = LOUDNESS / np.sqrt(embedding.shape[1])
    return np.concatenate([embedding, loud * hints], axis=1).astype(np.float32)

"""Which clause of a sentence speaks of which part of an asset."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from . import words
from .clauses import HeardClause
from .vocabulary import Vocabulary, name_words, stem

# Strength of a match between a clause's noun and a part: its head word ("oak_seat" is a seat), any
# word of its name, a word of its other labels, a synonym in either, a word within a word.
HEAD, NAME, LABEL, SYNONYM, LABEL_SYNONYM, INSIDE = 3.5, 3.0, 2.0, 1.5, 1.2, 1.1
EXACT = LABEL  # a noun that some part carries itself is not looked for among synonyms
FRAME = 0.8  # "frame" for the legs of a chair, when nothing else is called so
_SHORTEST_INSIDE = 4  # letters: "rest" in "armrest", but not "arm" in "charm"
# In the assignment of clauses that no word binds, against a cosine of 0 .. .6 between words:
# steel goes to what the asset calls metal, and not to what it calls plastic.
SAME_KIND, OTHER_KIND = 0.5, -0.2
MAIN = 1.0  # of two clauses for one part, the frame's
VOLUME, NAME_ORDER = 0.05, 1e-6  # between equals, the first clause takes the largest part


@dataclass(frozen=True)
class NamedPart:
    """A part and its words: ``name`` first, then node, group and material names."""

    name: str
    labels: tuple[str, ...]
    name_words: tuple[str, ...]
    label_words: frozenset[str]
    material: str | None  # phrase of the table in its labels
    material_label: str  # the label that holds it
    volume: float

    @classmethod
    def of(cls, labels: Sequence[str], vocabulary: Vocabulary, volume: float) -> NamedPart:
        """Read the words of a part; a material's name counts before the part's own."""
        name, *others = labels
        found = ((label, vocabulary.in_name(label)) for label in (*others, name))
        label, material = next((pair for pair in found if pair[1]), ("", None))
        label_words = frozenset(word for other in others for word in name_words(other))
        return cls(
            name, tuple(others), tuple(name_words(name)), label_words, material, label, volume
        )

    @property
    def spoken(self) -> str:
        """Its name as words to embed ("bed frame" for "BedFrame_01"), or "object".

        What it is comes last and is no filler: a "soup can" is no soup.
        """
        own = [word for word in self.name_words if word not in words.EXPORTED]
        told = [word for word in own[:-1] if word not in words.FILLERS] + own[-1:]
        return " ".join(told) or "object"


def _strength(noun: str, part: NamedPart) -> float:
    """Strength of one noun for one part, 0 if it says nothing of it."""
    own = part.name_words
    related = frozenset().union(*(group for group in words.SYNONYMS if noun in group))
    inside = (
        noun in word or word in noun
        for word in own
        if min(len(noun), len(word)) >= _SHORTEST_INSIDE
    )
    if noun in own:
        return HEAD if own[-1] == noun else NAME
    if noun in part.label_words:
        return LABEL
    if related & set(own):
        return SYNONYM
    if related & part.label_words:
        return LABEL_SYNONYM
    if any(inside):
        return INSIDE
    is_frame = noun in words.STRUCTURE and words.FRAME_PARTS & {*own, *part.label_words}
    return FRAME if is_frame else 0.0


def nouns_of(clause: HeardClause) -> tuple[str, ...]:
    """Part words of a clause; of "soil" alone the material is the part."""
    return clause.parts or tuple(map(stem, clause.phrase.split()))


def overlap(
    clauses: Sequence[HeardClause], parts: Sequence[NamedPart]
) -> Float[np.ndarray, "clauses parts"]:
    """Word overlap of every clause with every part, summed over the clause's nouns."""
    many = len({clause.material for clause in clauses if clause.material}) > 1
    score = np.zeros((len(clauses), len(parts)))
    for k, clause in enumerate(clauses):
        for noun in nouns_of(clause):
            if noun in words.REST or (noun in words.OBJECTS and not many):
                continue  # "oak chair" speaks of the whole chair
            strength = np.array([_strength(noun, part) for part in parts])
            for tier in (EXACT, FRAME + 1e-9):  # the best kind of match that the noun has
                if strength.max() >= tier:
                    strength[strength < tier] = 0
            score[k] += strength
    return score


def bind(score: Float[np.ndarray, "clauses parts"]) -> list[int | None]:
    """HeardClause of each part by word overlap, None where no word matches; the first of equals."""
    if not score.size:
        return [None] * score.shape[1]
    return [int(np.argmax(column)) if column.max() > 0 else None for column in score.T]


def of_pieces(clauses: Sequence[HeardClause], parts: Sequence) -> bool:
    """Whether a text speaks of more parts than the asset has, and so of pieces of them."""
    return len(clauses) > len(parts)


def unbound_clauses(
    clauses: Sequence[HeardClause], score: Float[np.ndarray, "clauses parts"]
) -> list[int]:
    """Clauses about parts that no part of the asset is called after: legs of a chair in one piece.

    An unknown word that stands alone names the object: "a steel bracket".
    """
    every = words.OBJECTS | words.REST | words.DETERMINERS
    lost = [
        k
        for k, clause in enumerate(clauses)
        if (clause.material or clause.level) and set(clause.parts) - every and not score[k].any()
    ]
    alone = sum(bool(clause.material) for clause in clauses) <= 1
    return [] if len(lost) == 1 and alone and is_whole(clauses[lost[0]]) else lost


def is_whole(clause: HeardClause) -> bool:
    """Whether a clause speaks of the object ("oak cube") and of no part that people know."""
    known = frozenset().union(*words.SYNONYMS) | words.STRUCTURE
    return not clause.parts or not set(clause.parts) & known


def allocate(
    clauses: Sequence[HeardClause],
    parts: Sequence[NamedPart],
    *,
    similarity: Callable[[list[str], list[str]], np.ndarray],
    category: Callable[[str], str],
) -> list[int | None]:
    """Give each clause one part that no word bound, so that all fit best together.

    ``similarity`` is the cosine of two lists of texts, ``category`` the kind of a material phrase.
    Returns the clause of each part, None for the parts that are left over.
    """
    from scipy.optimize import linear_sum_assignment

    bound: list[int | None] = [None] * len(parts)
    if not clauses or not parts:
        return bound
    nouns = [" ".join(clause.parts) or clause.text for clause in clauses]
    score = similarity(nouns, [part.spoken for part in parts]).astype(np.float64)
    total = sum(part.volume for part in parts) or 1.0
    by_name = sorted(range(len(parts)), key=lambda i: parts[i].name)
    for k, clause in enumerate(clauses):
        first = (len(clauses) - k) / len(clauses)
        score[k] += MAIN * bool(set(clause.parts) & words.STRUCTURE)
        for rank, i in enumerate(by_name):
            score[k, i] += _kinship(clause, parts[i], category)
            score[k, i] += first * (VOLUME * parts[i].volume / total - NAME_ORDER * rank)
    for k, i in zip(*linear_sum_assignment(score, maximize=True), strict=True):
        bound[i] = int(k)
    return bound


def _kinship(clause: HeardClause, part: NamedPart, category: Callable[[str], str]) -> float:
    """Tell how well a clause fits the material that the asset itself names."""
    if not part.material:
        return 0.0
    kind = category(part.material)
    usual = [by_kind for nouns, by_kind in words.USUAL.items() if nouns & set(clause.parts)]
    same = clause.material is not None and kind == category(clause.material)
    return (SAME_KIND if same else OTHER_KIND) + max((k.get(kind, 0.0) for k in usual), default=0.0)

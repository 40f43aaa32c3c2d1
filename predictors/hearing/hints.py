"""Clauses in plain words: "the seat gives way at the slightest touch" becomes "... is very soft".

What the lexicon reads for sure it says again in the words that training used most, so that a way
of speaking that nobody thought of means the same as the usual one. What it does not understand, and
all that names a material by its adjective ("soft rubber"), stays as it was said.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.scene.materials import MaterialTable
from ..encoders.protocol import TextEncoder
from ..normalisation import DEFAULT, Normalisation
from .binding import NamedPart, nouns_of, of_pieces, overlap, unbound_clauses
from .clauses import HeardClause, HeardSentence
from .degrees import ADJECTIVES, BEND, BRITTLE, FLOAT, MODERATE, SINK, SOMEWHAT, STRONGER
from .kinds import kind_of
from .lexicon import CHANNELS, Lexicon, default_lexicon, with_lexicon
from .statement import as_usual
from .vocabulary import vocabulary_of

# Score of a level at most, and its words: as a predicate, and before a noun.
_STIFFNESS = (
    (-0.75, "very soft", "very soft"),
    (-0.25, "soft", "soft"),
    (0.25, "of medium stiffness", "medium firm"),
    (0.75, "stiff", "stiff"),
    (1.0, "very stiff", "very stiff"),
)
_WEIGHT = (
    (-0.75, "very light", "very light"),
    (-0.25, "light", "light"),
    (0.25, "of average weight", "medium heavy"),
    (0.75, "heavy", "heavy"),
    (1.0, "very heavy", "very heavy"),
)
_COPULAS = frozenset("is are be was were been".split())
# Verbs that begin a statement without a copula: "gives way", "has a low density", "cannot float".
_VERBS = frozenset(
    "does do cannot can will would might never barely has have keeps keep stays stay goes go gives "
    "give resists resist weighs weigh drops drop falls fall rises rise settles settle pops pop "
    "might cracks".split()
) | (BEND | BRITTLE | FLOAT | SINK) - frozenset(
    "press dent stretch fold bend chip brittle fragile broken breakable crumbly delicate crisp "
    "frail afloat buoyant unsinkable".split()
)
_DEGREES = STRONGER | MODERATE | SOMEWHAT


class PlainWords:
    """Says clauses again, as far as a lexicon understands them."""

    def __init__(self, lexicon: Lexicon) -> None:
        self.lexicon = lexicon

    def __call__(self, text: str) -> str:
        """Return the clause in plain words, or as it is."""
        level, said = self._level(text), self.lexicon.read(text)
        if level is None or said.material is not None:  # the lexicon knows the material's value
            return text
        plain = self._again(re.findall(r"[\w'-]+|[^\w\s]", as_usual(text)), *level)
        # A clause that no longer speaks of the same part was misunderstood.
        return plain if plain and self.lexicon.read(plain).subject == said.subject else text

    def _again(self, words: list[str], predicate: str, attribute: str | None) -> str | None:
        at = _predicate(words)
        if at is not None:
            verb = predicate.startswith(("floats", "sinks"))
            subject = words[:at]
            plural = subject and subject[-1] in ("are", "were")
            if subject and subject[-1] in _COPULAS:
                subject = subject[:-1]
            link = [] if verb else ["are" if plural else "is"]
            return " ".join([*subject, *link, predicate])
        span = _attribute(words)
        if span is None or attribute is None:
            return None
        return " ".join([*words[: span[0]], attribute, *words[span[1] :]])

    def _level(self, text: str) -> tuple[str, str | None] | None:
        """Return the plain words for what is said, if just one thing is."""
        channels = self.lexicon.channels(text).tolist()
        hints: dict[str, float] = dict(zip(CHANNELS, channels, strict=True))
        if hints["floats"] or hints["sinks"]:
            return ("floats on water", None) if hints["floats"] else ("sinks in water", None)
        if hints["brittle"]:
            return "brittle", "brittle"
        if bool(hints["stiffness"]) == bool(hints["weight"]):
            return None
        kind = "stiffness" if hints["stiffness"] else "weight"
        score = hints[f"{kind} score"]
        if hints["middle"] and score < 0:
            return None  # "moderately light" is light rather than of average weight
        levels = _STIFFNESS if kind == "stiffness" else _WEIGHT
        return next((long, short) for top, long, short in levels if score <= top)


def _predicate(words: list[str]) -> int | None:
    """Where the statement begins that ends the clause: after a copula, or with a verb."""
    for at, word in enumerate(words):
        if at and word in _VERBS:
            return at
        if at and word in _COPULAS:
            return at + 1
    return None


def _attribute(words: list[str]) -> tuple[int, int] | None:
    """Span of degree and adjectives before a noun."""
    first = next((at for at, word in enumerate(words) if word in ADJECTIVES), None)
    if first is None or first + 1 >= len(words):
        return None
    end = first + 1
    while end + 1 < len(words) and words[end] in ADJECTIVES | {"and", "but"}:
        end += 1
    start = first
    while start and words[start - 1] in _DEGREES | {"not"}:
        start -= 1
    return start, end


UNSAID = "object"  # is embedded for a clause that names no part
# How far names are to be trusted, on the scale of training: a word in common, or only a likeness.
SHARED_WORD, LIKE_WORD = 1.0, 0.5
SAME_MATTER = 2.0  # "the metal is iron" of a part that the asset calls chrome: as a word of a label


class HintedEncoder:
    """A text encoder that hears clauses in plain words: sentence, the lexicon's hints, subject.

    Of the sentences, ``plain`` out of two are said in plain words first: all at run time, half in
    training, which is to hear every way of speaking too. The values of materials are hints in the
    ranges of ``normalisation``.
    """

    def __init__(
        self, encoder: TextEncoder, *, plain: int = 2, normalisation: Normalisation = DEFAULT
    ) -> None:
        self.encoder, self.plain = encoder, plain
        self.lexicon = default_lexicon(normalisation)
        self.plainly = PlainWords(self.lexicon)

    def text(self, sentences: Sequence[str]) -> Float[np.ndarray, "n dim"]:
        """Embedding of each sentence, its hints, and of its subject: (n, dim + channels + dim)."""
        said = [self.plainly(t) if i % 2 < self.plain else t for i, t in enumerate(sentences)]
        subjects = [self.subject(text) for text in said]
        distinct = {text: at for at, text in enumerate(dict.fromkeys(subjects))}
        if not said:
            dim = 2 * self.encoder.text([UNSAID]).shape[1] + len(CHANNELS)
            return np.zeros((0, dim), dtype=np.float32)
        spoken_of = self.encoder.text(list(distinct))[[distinct[text] for text in subjects]]
        heard = with_lexicon(self.encoder.text(said), said, lexicon=self.lexicon)
        return np.concatenate([heard, spoken_of], axis=1)

    def subject(self, text: str) -> str:
        """Words for what a clause speaks of; see ``subject``."""
        return subject(text, lexicon=self.lexicon)


def subject(text: str, *, lexicon: Lexicon | None = None) -> str:
    """Words for what a clause speaks of: of the part, else of its material, else of anything."""
    said = (lexicon or default_lexicon()).read(text)
    return said.subject or said.material or UNSAID


class Heard(NamedTuple):
    """What a network is told of a sentence and of the names of an asset's parts.

    Parameters
    ----------
    clauses
        Those that say something.
    vectors, names, whole
        Embeddings of the clauses (n, d), of the parts' own names (parts, d), of the text (d,).
    named
        Whether a part's name says anything, for each part.
    subjects
        What each clause speaks of, in words.
    fits, trust
        How well each part's name fits each clause (n, parts), and how far that is to be trusted.
    of_pieces
        Whether the text speaks of more parts than there are.
    unbound
        Clauses about parts that no part is called after.
    spoken
        Whether there is a text at all.
    """

    clauses: Sequence[HeardClause]
    vectors: np.ndarray
    names: np.ndarray
    whole: np.ndarray
    named: tuple[bool, ...]
    subjects: tuple[str, ...]
    fits: np.ndarray
    trust: float
    of_pieces: bool
    unbound: tuple[int, ...]
    spoken: bool


def hear(
    sentence: HeardSentence,
    labels: Sequence[Sequence[str]],
    table: MaterialTable,
    encoder: HintedEncoder,
) -> Heard:
    """Return all that a network is told in words, of parts with these ``labels``."""
    clauses, vocabulary = sentence.stated, vocabulary_of(table)
    parts = [NamedPart.of(words, vocabulary, 0.0) for words in labels]
    spoken = [own_name(part) for part in parts]
    said = [clause.written for clause in clauses]
    vectors = encoder.text([*said, *spoken, sentence.text or UNSAID])
    fits, trust = np.zeros((0, len(parts))), 0.0
    if clauses:
        fits, trust = name_evidence(clauses, parts, encoder.encoder)
    return Heard(
        clauses,
        vectors[: len(said)],
        vectors[len(said) : -1],
        vectors[-1],
        tuple(map(bool, spoken)),
        tuple(encoder.subject(clause) for clause in said),
        fits,
        trust,
        of_pieces(clauses, parts),
        tuple(unbound_clauses(clauses, overlap(clauses, parts))),
        bool(sentence.text.strip()),
    )


def own_name(part: NamedPart) -> str:
    """Words of a part with the material its labels tell, "" where they tell nothing."""
    word = "" if part.spoken == "object" else part.spoken
    material = part.material or ""
    return word if material in word else f"{word} {material}".strip()


def name_evidence(
    clauses: Sequence[HeardClause], named: Sequence[NamedPart], encoder: TextEncoder
) -> tuple[Float[np.ndarray, "clauses parts"], float]:
    """How well each part's own name fits each clause, and how far that is to be trusted."""
    score = np.clip(overlap(clauses, named), 0, 3)
    score = np.where(score > 0, score, SAME_MATTER * _same_matter(clauses, named))
    if score.any():
        return score, SHARED_WORD
    if of_pieces(clauses, named):  # their part's name is like one clause, and they are not
        return np.zeros_like(score), 0.0
    nouns = encoder.text([" ".join(c.parts) or c.text for c in clauses])
    names = encoder.text([own_name(part) for part in named])
    return nouns @ names.T, LIKE_WORD


def _same_matter(clauses: Sequence[HeardClause], named: Sequence[NamedPart]) -> np.ndarray:
    """Whether a clause speaks of the kind of matter that a part's names tell (clauses, parts)."""
    asked = [{kind_of(noun) for noun in nouns_of(clause)} for clause in clauses]
    own = [kind_of(" ".join((part.name, *part.labels))) for part in named]
    return np.array([[kind is not None and kind in kinds for kind in own] for kinds in asked])

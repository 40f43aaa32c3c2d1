"""What a network is given of a text: plain words, hints beside them, and which part is meant.

A sentence embedding hardly tells "very stiff" from "soft" (their cosine is .93), and an unusual way
of speaking from the usual one. So each clause of the reader is read once more by closed word lists:
``Reader`` tells the part from the material, ``Lexicon`` scores stiffness, weight and the like as
channels that are joined to the embedding, and ``PlainWords`` rewrites the clause in the words that
training used most. ``HintedEncoder`` makes vectors of all that; ``hear`` adds how well the names of
the asset's parts fit each clause. The word lists are ``text/data/network.toml``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.table import MaterialTable, load_table
from ..encoders import TextEncoder
from ..field import DEFAULT, Normalisation
from ..resolve.resolve import material_at
from ..text.clauses import Clause, Sentence
from ..text.parts import (
    FRAME_PARTS,
    LISTS,
    OBJECTS,
    REST,
    STRUCTURE,
    SYNONYMS,
    TOKEN,
    NamedPart,
    Vocabulary,
    kind_of,
    known_words,
    own_name,
    stem,
    vocabulary_of,
    words_of,
)

# What the network is told of a part that floats or sinks.
IN_WATER = {"floats": "floats on water", "sinks": "sinks in water"}
SOFT, STIFF, LIGHT, HEAVY, BEND, BRITTLE, FLOAT, SINK, STRONGER, MODERATE, SOMEWHAT = (
    frozenset(words.split()) for words in LISTS["manner"].values()
)
BREAKS, JOINTS = words_of("roles", "breaks"), words_of("roles", "joints")
(
    ADVERBS, ADJECTIVES, _COPULA, _IDLE, _ALL, _LIKE, _COMPARED, _NOT, _LITTLE, _MUCH, _OF_WEIGHT,
    _OF_STIFFNESS, _COPULAS, _VERBS,
) = (frozenset(words.split()) for words in LISTS["clause"].values())  # fmt: skip
MANNER = ADJECTIVES | ADVERBS | SOMEWHAT
LINKS, DETERMINERS = words_of("roles", "links"), words_of("roles", "determiners")
# One clause, whose end is known: the words that remain when the material, how it is, and the small
# words are taken away are those for the part. They bind a clause to voxels, whatever it says.

# "rock hard" is very hard, and no rock.
_IDIOM = re.compile(r"\b(?:rock(?= (?:hard|solid))|feather(?= light))")


def as_usual(text: str) -> str:
    """Return the clause in lower case, with the idioms that hide a degree said plainly."""
    return _IDIOM.sub("very", text.lower())


class Statement(NamedTuple):
    """What a clause speaks of ("" where it does not tell), its material, and how that is."""

    subject: str
    material: str | None
    manner: tuple[str, ...]


Span = tuple[int, int]  # first word, and the one after the last


class Reader:
    """Reads single clauses by the words of a material table."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary
        self._parts = Vocabulary(known_words())

    def __call__(self, text: str) -> Statement:
        """Read a clause."""
        raw = TOKEN.findall(as_usual(text))
        stems = [stem(word) for word in raw]
        # Phrases of the table outside longer words for parts, and words that are compared with
        spans, left_out, at = list[Span](), set[int](), 0
        while at < len(raw):
            part, phrase = self._parts.match(stems, at), self.vocabulary.match(stems, at)
            if part and part[1] > (phrase[1] if phrase else 0):
                at += part[1]
                continue
            end = at + (phrase[1] if phrase else 1)
            if phrase:
                before = [word for word in raw[max(0, at - 2) : at] if word not in ("a", "an")]
                hard = end < len(raw) and raw[end] in _COMPARED  # "wool soft"; "steel hard shell"
                like = bool(before) and before[-1] in _LIKE  # "soft as wool"
                if like or (hard and not self._parts.match(stems, end)):
                    left_out |= set(range(at, end))
                else:
                    spans.append((at, end))
            at = end
        chosen, subject = self._choose(raw, stems, spans)
        material, manner = None, tuple[str, ...]()
        if chosen is not None:
            first = chosen[0]
            while first and raw[first - 1] in MANNER | MODERATE:
                first -= 1
            phrase = self.vocabulary.match(stems, chosen[0])
            material = phrase[0] if phrase else None
            left_out |= set(range(first, chosen[1]))
            manner = tuple(raw[first : chosen[0]])
        kept = [i for i in subject if i not in left_out and not _idle(raw[i], stems[i])]
        said = " ".join("everything" if stems[i] in _ALL else stems[i] for i in kept)
        return Statement(said, material, manner)

    def _is_part(self, stems: list[str], span: Span) -> bool:
        """Whether the span is a word for a part too: "soil", "boulder"."""
        found = self._parts.match(stems, span[0])
        return found is not None and found[1] == span[1] - span[0]

    def _choose(
        self, raw: list[str], stems: list[str], spans: list[Span]
    ) -> tuple[Span | None, range]:
        """Span of the material, if any, and the range of the words for the subject."""
        n = len(raw)
        inside = {i for a, b in spans for i in range(a, b)}
        content = [i for i in range(n) if i in inside or not _idle(raw[i], stems[i])]
        cut = raw.index("for") if "for" in raw else 0
        before = [span for span in spans if span[1] <= cut]
        if before:  # "oak for the legs"
            return before[-1], range(cut + 1, n)
        links = (i for i in range(n) if raw[i] in _COPULA and i not in inside)
        link = next((i for i in links if content and content[0] < i), None)
        if link is None and not spans:
            return None, range(n)
        if link is None:  # a phrase without a verb: "oak legs", "legs oak", "very soft leather"
            first, last = spans[0], spans[-1]
            others = [i for i in content if not first[0] <= i < first[1]]
            part_first = self._is_part(stems, first)
            if not others and part_first and any(word in MANNER for word in raw[: first[0]]):
                return None, range(n)  # "very heavy soil"
            ends = last[1] == n and part_first and not self._is_part(stems, last)
            return (last if raw[0] == "make" or ends else first), range(n)
        after = [span for span in spans if span[0] > link]
        if after:
            return after[0], range(link)
        # "the oak seat is heavy", but "the boulder and the soil are heavy"
        first = next((span for span in spans if span[1] <= link), None)
        head = first and any(first[1] <= i < link for i in content)
        joined = first and raw[first[1]] in ("and", ",")
        return (first if head and not joined else None), range(link)


def _idle(word: str, stem: str) -> bool:
    return (word in _IDLE or stem in _IDLE or not word[0].isalnum()) and stem not in _ALL


# What a clause says word by word: the table's material, and how stiff, heavy or brittle. These are
# hints to the network, which still has the whole sentence and learns with the hints taken away.

CHANNELS = (
    "material", "E", "nu", "rho", "stiffness", "stiffness score", "weight", "weight score",
    "brittle", "floats", "sinks", "strong", "middle",
)  # fmt: skip
# On the scale where an embedding's numbers have unit variance: louder than any one of them.
LOUDNESS = 2.0
REMEMBERED = 1024  # clauses that were read: more than any one object has
# Scores of an adjective as it stands, strengthened, and in the middle of the range.
_PLAIN, _STRONG, _MIDDLE = 0.5, 1.0, 0.1
_NEAR = 3  # words before an adjective that may negate it
# Scores of an adjective, and the place in a material's own range that it means.
_SCORES, _PLACES = (-1.0, -0.5, -_MIDDLE, _MIDDLE, 0.5, 1.0), (0.04, 0.25, 0.5, 0.5, 0.75, 0.96)
_BRITTLE_PLACE = 0.85


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
        read, value = self.read(text), (0.0, 0.0, 0.0)
        if read.material is not None:  # its normalised value, as stiff and heavy as it says
            place, density = (
                None if score is None else float(np.interp(score, _SCORES, _PLACES))
                for score in (_stiffness(read.manner), _weight(read.manner))
            )
            if place is None and BRITTLE & set(read.manner):
                place = _BRITTLE_PLACE
            row = self.table.exact(read.material)
            at_place = material_at(row, stiffness=place, density=density)
            value = self.normalisation.normalise(*at_place).tolist()
        stiffness, weight, water = _stiffness(words), _weight(words), _water(words)
        return np.array([
            read.material is not None, *value,
            stiffness is not None, stiffness or 0.0, weight is not None, weight or 0.0,
            bool(BRITTLE & set(words)), water > 0, water < 0,
            bool(STRONGER & set(words)), bool(MODERATE & set(words)),
        ], dtype=np.float32)  # fmt: skip


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
    present = set(words)
    if not signs:
        return None
    if min(signs) < max(signs):
        return 0.0
    if present & MODERATE and "than" not in present:
        return _MIDDLE * signs[0]
    compared = {"as", "like"} & set(words[-3:-1]) or {"as", "can"} <= present
    strong = present & STRONGER or compared
    return (_STRONG if strong else _PLAIN) * signs[0]


def _stiffness(words: Sequence[str]) -> float | None:
    """Score from -1 (as soft as can be) to 1 (never bends)."""
    signs = _sign(words, SOFT, STIFF)
    present = set(words)
    if present & BEND:
        hard = present & _NOT or "hard" in present
        signs = [1 if hard else -1]
    if "shape" in present:
        signs = [1]
    if not signs and present & _OF_STIFFNESS:
        signs = [-1, 1] if present & MODERATE else [-1 if present & (_LITTLE | _NOT) else 1]
    return _score(words, signs)


def _weight(words: Sequence[str]) -> float | None:
    """Score from -1 (weighs next to nothing) to 1 (weighs a ton)."""
    present = set(words)
    if "water" in present or "own" in present:  # "sags under its own weight"
        return None
    signs = _sign(words, LIGHT, HEAVY)
    if not signs and present & _OF_WEIGHT:
        few, many = bool(present & _LITTLE), bool(present & _MUCH)
        signs = [-1] if few else [1] if many else [-1, 1] if present & MODERATE else []
    if {"than", "air"} <= present:
        signs = [-1]
    return _score(words, signs)


def _water(words: Sequence[str]) -> int:
    """1 for what floats, -1 for what sinks, 0 where nothing is said of it."""
    present = set(words)
    negated = -1 if present & _NOT or "unable" in present else 1
    if present & FLOAT or "surface" in present:
        return negated
    if present & SINK or "bottom" in present:
        return -negated
    if "water" in present:
        lighter = present & LIGHT or "less" in present or "top" in present
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


# Clauses in plain words: "the seat gives way at the slightest touch" becomes "... is very soft", so
# that a way of speaking that nobody thought of means the same as the usual one. What the lexicon
# does not understand, and all that names a material by its adjective ("soft rubber"), stays.

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


class PlainWords:
    """Says clauses again, as far as a lexicon understands them."""

    def __init__(self, lexicon: Lexicon) -> None:
        self.lexicon = lexicon

    def __call__(self, text: str) -> str:
        """Return the clause in plain words, or as it is."""
        level, read = self._level(text), self.lexicon.read(text)
        if level is None or read.material is not None:  # the lexicon knows the material's value
            return text
        plain = _rewritten(re.findall(r"[\w'-]+|[^\w\s]", as_usual(text)), *level)
        # A clause that no longer speaks of the same part was misunderstood.
        return plain if plain and self.lexicon.read(plain).subject == read.subject else text

    def _level(self, text: str) -> tuple[str, str | None] | None:
        """Return the plain words for what is said of a part, if just one thing is."""
        channels = self.lexicon.channels(text).tolist()
        hints: dict[str, float] = dict(zip(CHANNELS, channels, strict=True))
        if hints["floats"] or hints["sinks"]:
            return (IN_WATER["floats" if hints["floats"] else "sinks"], None)
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


def _rewritten(words: list[str], predicate: str, attribute: str | None) -> str | None:
    """The clause with what it says as a ``predicate``, or as the ``attribute`` of its noun."""
    # The statement begins after a copula, or with a verb.
    begins = (
        at + (word not in _VERBS)
        for at, word in enumerate(words)
        if at and (word in _VERBS or word in _COPULAS)
    )
    at = next(begins, None)
    if at is not None:
        subject = words[:at]
        plural = subject and subject[-1] in ("are", "were")
        if subject and subject[-1] in _COPULAS:
            subject = subject[:-1]
        verb = predicate.startswith(("floats", "sinks"))
        link = [] if verb else ["are" if plural else "is"]
        return " ".join([*subject, *link, predicate])
    # Else degree and adjectives stand before a noun.
    first = next((at for at, word in enumerate(words) if word in ADJECTIVES), None)
    if attribute is None or first is None or first + 1 >= len(words):
        return None
    end = first + 1
    while end + 1 < len(words) and words[end] in ADJECTIVES | {"and", "but"}:
        end += 1
    while first and words[first - 1] in STRONGER | MODERATE | SOMEWHAT | {"not"}:
        first -= 1
    return " ".join([*words[:first], attribute, *words[end:]])


UNSAID = "object"  # is embedded for a clause that names no part


class HintedEncoder:
    """A text encoder of clauses in plain words: sentence, the lexicon's hints, subject.

    Of the sentences, ``plain`` out of two are first rewritten: all at run time, half in
    training, which is to meet every way of speaking too. The values of materials are hints in the
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
        plain = [self.plainly(t) if i % 2 < self.plain else t for i, t in enumerate(sentences)]
        subjects = [subject(text, lexicon=self.lexicon) for text in plain]
        distinct = {text: at for at, text in enumerate(dict.fromkeys(subjects))}
        if not plain:
            dim = 2 * self.encoder.text([UNSAID]).shape[1] + len(CHANNELS)
            return np.zeros((0, dim), dtype=np.float32)
        subject_vectors = self.encoder.text(list(distinct))[[distinct[text] for text in subjects]]
        clause_vectors = with_lexicon(self.encoder.text(plain), plain, lexicon=self.lexicon)
        return np.concatenate([clause_vectors, subject_vectors], axis=1)


def subject(text: str, *, lexicon: Lexicon | None = None) -> str:
    """Words for what a clause speaks of: of the part, else of its material, else of anything."""
    clause = (lexicon or default_lexicon()).read(text)
    return clause.subject or clause.material or UNSAID


# Which clause of a sentence speaks of which part of an asset.

# Strength of a match between a clause's noun and a part: its head word ("oak_seat" is a seat), any
# word of its name, a word of its other labels, a synonym in either, a word within a word.
HEAD, NAME, LABEL, SYNONYM, LABEL_SYNONYM, INSIDE = 3.5, 3.0, 2.0, 1.5, 1.2, 1.1
EXACT = LABEL  # a noun that some part carries itself is not looked for among synonyms
FRAME = 0.8  # "frame" for the legs of a chair, when nothing else is called so
_SHORTEST_INSIDE = 4  # letters: "rest" in "armrest", but not "arm" in "charm"


def _strength(noun: str, part: NamedPart) -> float:
    """Strength of one noun for one part, 0 if it says nothing of it."""
    own = part.name_words
    related = frozenset().union(*(group for group in SYNONYMS if noun in group))
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
    is_frame = noun in STRUCTURE and FRAME_PARTS & {*own, *part.label_words}
    return FRAME if is_frame else 0.0


def nouns_of(clause: Clause) -> tuple[str, ...]:
    """Part words of a clause; of "soil" alone the material is the part."""
    return clause.parts or tuple(map(stem, clause.phrase.split()))


def overlap(
    clauses: Sequence[Clause], parts: Sequence[NamedPart]
) -> Float[np.ndarray, "clauses parts"]:
    """Word overlap of every clause with every part, summed over the clause's nouns."""
    many = len({clause.material for clause in clauses if clause.material}) > 1
    score = np.zeros((len(clauses), len(parts)))
    for k, clause in enumerate(clauses):
        for noun in nouns_of(clause):
            if noun in REST or (noun in OBJECTS and not many):
                continue  # "oak chair" speaks of the whole chair
            strength = np.array([_strength(noun, part) for part in parts])
            for tier in (EXACT, FRAME + 1e-9):  # the best kind of match that the noun has
                if strength.max() >= tier:
                    strength[strength < tier] = 0
            score[k] += strength
    return score


def of_pieces(clauses: Sequence[Clause], parts: Sequence) -> bool:
    """Whether a text speaks of more parts than the asset has, and so of pieces of them."""
    return len(clauses) > len(parts)


def unbound_clauses(
    clauses: Sequence[Clause], score: Float[np.ndarray, "clauses parts"]
) -> list[int]:
    """Clauses about parts that no part of the asset is called after: legs of a chair in one piece.

    An unknown word that stands alone names the object: "a steel bracket".
    """
    every = OBJECTS | REST | DETERMINERS
    lost = [
        k
        for k, clause in enumerate(clauses)
        if (clause.material or clause.level) and set(clause.parts) - every and not score[k].any()
    ]
    alone = sum(bool(clause.material) for clause in clauses) <= 1
    # Of one clause about the object ("oak cube") no word is one for a part that people know.
    parts = frozenset().union(STRUCTURE, *SYNONYMS)
    return [] if len(lost) == 1 and alone and not set(clauses[lost[0]].parts) & parts else lost


# All of it for the parts of one asset.

SAME_MATTER = 2.0  # "the metal is iron" of a part that the asset calls chrome: as a word of a label
# How far names are to be trusted, on the scale of training: a word in common, or only a likeness.
SHARED_WORD, LIKE_WORD = 1.0, 0.5


class EncodedText(NamedTuple):
    """What a network is told of a sentence and of the names of an asset's parts.

    clauses: Those that say something.
    vectors, names, whole: Embeddings of the clauses (n, d), of the parts' own names (parts, d), of
        the text (d,).
    named: Whether a part's name says anything, for each part.
    subjects: What each clause speaks of, in words.
    fits, trust: How well each part's name fits each clause (n, parts), and how far that is to be
        trusted.
    of_pieces: Whether the text speaks of more parts than there are, and calls them otherwise.
    unbound: Clauses about parts that no part is called after.
    spoken: Whether there is a text at all.
    """

    clauses: Sequence[Clause]
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
    sentence: Sentence,
    labels: Sequence[Sequence[str]],
    table: MaterialTable,
    encoder: HintedEncoder,
) -> EncodedText:
    """Return all that a network is told in words, of parts with these ``labels``."""
    clauses, vocabulary = sentence.stated, vocabulary_of(table)
    parts = [NamedPart.of(words, vocabulary, 0.0) for words in labels]
    names = [own_name(part) for part in parts]
    texts = [clause.text for clause in clauses]
    vectors = encoder.text([*texts, *names, sentence.text or UNSAID])
    fits, trust = np.zeros((0, len(parts))), 0.0
    if clauses:
        fits, trust = name_evidence(clauses, parts, encoder.encoder)
    lost = tuple(unbound_clauses(clauses, overlap(clauses, parts)))
    return EncodedText(
        clauses,
        vectors[: len(texts)],
        vectors[len(texts) : -1],
        vectors[-1],
        tuple(map(bool, names)),
        tuple(subject(clause, lexicon=encoder.lexicon) for clause in texts),
        fits,
        trust,
        of_pieces(clauses, parts) and (len(parts) == 1 or len(lost) > 1),
        lost,
        bool(sentence.text.strip()),
    )


def name_evidence(
    clauses: Sequence[Clause], named: Sequence[NamedPart], encoder: TextEncoder
) -> tuple[Float[np.ndarray, "clauses parts"], float]:
    """How well each part's own name fits each clause, and how far that is to be trusted."""
    score = np.clip(overlap(clauses, named), 0, 3)
    asked = [{kind_of(noun) for noun in nouns_of(clause)} for clause in clauses]
    own = [kind_of(" ".join((part.name, *part.labels))) for part in named]
    score = np.where(
        score > 0,
        score,
        SAME_MATTER
        * np.array([[kind is not None and kind in kinds for kind in own] for kinds in asked]),
    )
    if score.any():
        return score, SHARED_WORD
    if of_pieces(clauses, named):  # their part's name is like one clause, and they are not
        return np.zeros_like(score), 0.0
    nouns = encoder.text([" ".join(c.parts) or c.told for c in clauses])
    names = encoder.text([own_name(part) for part in named])
    return nouns @ names.T, LIKE_WORD

"""Clauses in plain words: "the seat gives way at the slightest touch" becomes "... is very soft".

What the lexicon reads for sure it says again in the words that training used most, so that a way
of speaking that nobody thought of means the same as the usual one. What it does not understand, and
all that names a material by its adjective ("soft rubber"), stays as it was said.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.table import NU_CAP, Material, MaterialTable, MaterialValue, load_table
from ..encoders.registry import TextEncoder
from ..field import DEFAULT, Normalisation
from .clauses import Clause, Sentence

# Words by what they say of a thing: how stiff or heavy it is, how it breaks, how much so.
#
# Plain English word lists, closed: the lexicon scores them, and the reader of statements and the
# speaker of plain words tell them from the words for parts and materials.

SOFT = frozenset(
    "soft softer softish squishy squashy squeezable plush flexible bendy pliable pliant floppy "
    "supple elastic springy limp yielding cushiony compliant deformable spongy stretchy "
    "flabby tender mushy malleable bouncy rubbery weak slack doughy".split()
)
STIFF = frozenset(
    "stiff stiffer rigid firm hard harder inflexible unyielding sturdy tough solid robust strong "
    "unbending stout taut steely hardened rocklike".split()
)
LIGHT = frozenset("light lighter lightweight airy weightless feathery porous hollow fluffy".split())
HEAVY = frozenset(
    "heavy heavier dense denser weighty hefty burdensome ponderous massive leaden".split()
)
BEND = frozenset(
    "bend bends bending bent flex flexes deform deforms squeeze squeezed compress press pressed "
    "sag sags give gives yield yields dent dents collapse collapses stretch stretches fold "
    "folds".split()
)
BRITTLE = frozenset(
    "brittle fragile break breaks broken breakable shatter shatters crack cracks cracked cracking "
    "snap snaps splinter splinters fracture fractures chip chips crumbly crumble crumbles delicate "
    "crisp frail".split()
)
FLOAT = frozenset(
    "float floats floating afloat buoyant bob bobs unsinkable drift drifts swim swims".split()
)
SINK = frozenset("sink sinks sinking plunge plunges submerge submerges".split())
STRONGER = frozenset(
    "very extremely super ultra incredibly exceptionally really remarkably utterly extraordinarily "
    "totally completely absolutely perfectly immensely tremendously massively enormously "
    "exceedingly amazingly surprisingly highly hugely terribly so never cannot impossible "
    "slightest own air ton lead jelly feather almost minimal nothing anything all too "
    "collapse collapses".split()
)
MODERATE = frozenset(
    "medium moderate moderately average averagely typical normal normally usual ordinary common "
    "intermediate middling middle halfway neither standard balanced between".split()
)
SOMEWHAT = frozenset("fairly quite rather somewhat pretty reasonably".split())
ADVERBS = frozenset(word for word in STRONGER if word.endswith("ly")) | frozenset(
    "very super ultra so almost moderately averagely normally medium not easily quick prone".split()
)
ADJECTIVES = (
    SOFT
    | STIFF
    | LIGHT
    | HEAVY
    | frozenset("brittle fragile breakable crumbly delicate crisp frail buoyant unsinkable".split())
)
MANNER = ADJECTIVES | ADVERBS | SOMEWHAT


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
    nouns = encoder.text([" ".join(c.parts) or c.text for c in clauses])
    names = encoder.text([own_name(part) for part in named])
    return nouns @ names.T, LIKE_WORD


# Word lists of the text understanding: small, closed sets, by their role in a sentence.
#
# All words are stems as ``vocabulary.stem`` makes them (singular, lower case).

# Between clauses. "and" and "," may also continue a list of parts ("oak legs and back").
BREAKS = frozenset(". ; while whereas but then except".split())
JOINTS = frozenset(
    ", and & + plus with has have having featuring whose on over atop under beneath for "
    "hold holding support supporting".split()
)
# Between a part and its material: "legs are oak", "cushion of foam", "seat upholstered in vinyl".
LINKS = frozenset(
    "is are be was were being = made make built of from in out crafted constructed carved cast "
    "forged moulded molded filled stuffed padded upholstered covered wrapped lined consist "
    "consisting".split()
)
PARTICIPLES = frozenset("filled stuffed padded upholstered covered wrapped lined made".split())
DETERMINERS = frozenset(
    "the a an it its their thi these those each every both all my your our one two three four five "
    "six seven eight nine ten twelve some".split()
)
NEGATIONS = frozenset("not no non without instead than".split())
# Words that say nothing of a part or a material: how it looks, how big it is, how much.
FILLERS = frozenset(
    "x use using very really quite extremely rather somewhat slightly so too also entirely "
    "completely fully "
    "mostly mainly only just which that who to by at as them there can will should "
    "red green blue yellow black white grey gray brown pink purple dark bright pale beige "
    "old new modern antique vintage rustic classic small big large huge tiny tall short long wide "
    "thick thin round square flat narrow high low nice beautiful elegant simple solid hollow whole "
    "entire polished brushed painted matte shiny glossy smooth rough comfortable comfy cheap "
    "expensive strong weak real genuine natural artificial fake".split()
)
# Everything the sentence did not name.
REST = frozenset("everything else rest other remaining remainder anything".split())
# Names of whole objects: "oak chair" does not speak of one part among several.
OBJECTS = frozenset(
    "chair stool armchair sofa couch bench table desk lamp bed cupboard cabinet wardrobe shelf "
    "plant bonsai tree ball cube box sphere toy object thing item piece model asset furniture "
    "car vehicle house bicycle bottle mug cup vase hammer knife tool shoe boot "
    "duck bear statue sculpture part component".split()
)
# The load-bearing whole: such a clause also takes the parts that nothing else claims.
STRUCTURE = frozenset("frame structure body skeleton chassi framework carcass main".split())

# How stiff or dense; the table's own adjectives for each level, tried in this order.
LEVELS = {
    "soft": "soft softer squishy squashy squeezable plush flexible bendy pliable floppy supple "
    "elastic springy",
    "stiff": "stiff stiffer rigid firm hard inflexible unyielding sturdy",
    "dense": "dense heavy",
    "light": "light lightweight",
}
LEVEL_OF = {word: level for level, words in LEVELS.items() for word in words.split()}
ALIAS_OF_LEVEL = {
    "soft": ("soft", "flexible"),
    "stiff": ("firm", "stiff", "hard", "rigid"),
    "dense": ("dense", "heavy"),
    "light": ("light", "lightweight"),
}
# Where in [min, max] of E (log) an adjective points when the family has no row of its own for it.
ALPHA_OF_LEVEL = {"soft": 0.1, "stiff": 0.9}

# Nouns that only repeat the family of the material before them: "oak wood", "ABS plastic".
FAMILIES = frozenset(
    "wood wooden metal plastic fabric cloth textile rubber glass ceramic stone paper alloy".split()
)
# Parts that people call by each other's names.
SYNONYMS = [
    frozenset(group.split())
    for group in (
        "leg foot feet",
        "seat cushion sitting seating pad seatpad",
        "back backrest backboard",
        "top tabletop desktop tabletop worktop countertop slab plate",
        "handle grip knob haft hilt",
        "leaf foliage crown canopy frond leafage greenery",
        "pot planter vase flowerpot container",
        "trunk stem stalk",
        "soil earth dirt ground",
        "shade lampshade",
        "wheel tire tyre caster castor",
        "base foot stand pedestal plinth",
        "pole rod post column shaft stand",
        "arm armrest",
        "door panel leaf",
        "lid cover cap",
        "frame structure skeleton chassi framework body",
        "mattress matress",
        "pillow cushion",
        "head blade",
    )
]
# What a frame usually is when no part is called so: used only where no better word matched.
FRAME_PARTS = frozenset(
    "leg base stand support structure back arm armrest backrest rail rung "
    "stretcher crossbar".split()
)

# What such parts are usually made of, by category: tells parts apart that only a material names.
USUAL = {
    (STRUCTURE | {"leg", "foot", "base", "pole"}): {
        "metal": 0.5, "wood": 0.4, "plastic": 0.2,
    },
    frozenset("seat cushion pillow mattress back pad".split()): {
        "fabric and leather": 0.5, "soft foam": 0.5, "wood": 0.2,
    },
}  # fmt: skip
# Words in names that exporters write: they say nothing of the part.
EXPORTED = frozenset(
    "mat material texture default mesh node group geometry geom sweethome d color colour lambert "
    "phong blinn surface polygon mtl none root scene instance".split()
)

# Material words of other languages in names of asset parts -> a name in the table.
FOREIGN = {
    word: name
    for name, words in {
        "wood": "legno bois holz madera madeira hout drewno tre trä",
        "oak": "rovere chene chêne eiche roble eik",
        "pine": "pino kiefer",
        "beech": "faggio hetre hêtre buche",
        "walnut": "noce noyer nussbaum nogal",
        "steel": "acciaio acier stahl acero aço staal",
        "metal": "metallo métal metall metaal metallico metalic metalique",
        "iron": "ferro eisen hierro ijzer",
        "cast iron": "ghisa fonte gusseisen",
        "aluminium": "alluminio aluminio",
        "brass": "ottone laiton messing laton latón",
        "copper": "rame cuivre kupfer cobre",
        "chrome": "cromo chrom cromato",
        "glass": "vetro verre glas vidrio vidro szklo",
        "mirror": "specchio miroir spiegel espejo",
        "fabric": "tessuto tissu stoff tejido tecido tela toile stof",
        "cotton": "cotone coton baumwolle algodon algodón",
        "wool": "lana laine wolle",
        "plastic": "plastica plastique plastik kunststoff plastico plástico",
        "leather": "cuoio pelle cuir leder cuero couro",
        "rubber": "gomma caoutchouc gummi caucho goma borracha",
        "foam": "schiuma mousse schaum schaumstoff espuma",
        "ceramic": "ceramica céramique ceramique keramik cerámica",
        "porcelain": "porcellana porcelaine porzellan porcelana",
        "marble": "marmo marbre marmor mármol marmol",
        "stone": "pietra pierre stein piedra pedra",
        "concrete": "calcestruzzo beton béton hormigon hormigón cemento",
        "paper": "carta papier papel",
        "cardboard": "cartone karton",
        "soil": "terra terre erde tierra",
        "leaf": "foglia foglie feuille feuilles blatt hoja hojas",
        "wicker": "vimini osier weide mimbre",
        "plaster": "gesso platre plâtre gips yeso",
    }.items()
    for word in words.split()
}


# What one clause speaks of and what it is made of: "very soft rubber for the grip".
#
# ``parser.parse`` cuts a sentence into clauses and must guess where each ends; here the end is
# known, so the words that remain when the material, how it is, and the small words are taken away
# are those for the part. They bind a clause to voxels whatever it says of them.

# A statement begins: "legs are", "whose rim must be", "it consists of", "the seat gives way".
_COPULA = (
    LINKS
    | frozenset(": must should formed consists cannot can will would might never barely".split())
    | frozenset(
        "does do has have keeps keep stays stay goes go resists resist weighs weigh drops drop "
        "falls fall rises rise settles settle pops pop squeezes".split()
    )
    | ((BEND | BRITTLE | FLOAT | SINK) - ADJECTIVES)
    - frozenset("press dent stretch fold bend chip broken afloat".split())
)
_IDLE = (
    DETERMINERS
    | JOINTS
    | FILLERS
    | LINKS
    | BREAKS
    | MANNER
    | MODERATE
    | frozenset("this these use below around on which whose must should it be where".split())
)
_ALL = frozenset("everything all rest other remaining remainder anything else".split())
_LIKE = frozenset("as like than".split())
_COMPARED = frozenset("hard soft light heavy".split())  # "steel hard": hard, and no steel


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
        spans, compared = self._materials(raw, stems)
        chosen, subject = self._choose(raw, stems, spans)
        if chosen is None:
            return Statement(_join(raw, stems, subject, compared), None, ())
        first = chosen[0]
        while first and raw[first - 1] in MANNER | MODERATE:
            first -= 1
        found = self.vocabulary.match(stems, chosen[0])
        material = found[0] if found else None
        without = compared | set(range(first, chosen[1]))
        manner = tuple(raw[first : chosen[0]])
        return Statement(_join(raw, stems, subject, without), material, manner)

    def _materials(self, raw: list[str], stems: list[str]) -> tuple[list[Span], set[int]]:
        """Spans of the table's phrases outside longer words for parts; words compared with."""
        spans, compared, at = [], set(), 0
        while at < len(raw):
            part, found = self._parts.match(stems, at), self.vocabulary.match(stems, at)
            if part and part[1] > (found[1] if found else 0):
                at += part[1]
                continue
            end = at + (found[1] if found else 1)
            if found and self._is_compared(raw, stems, at, end):
                compared |= set(range(at, end))
            elif found:
                spans.append((at, end))
            at = end
        return spans, compared

    def _is_compared(self, raw: list[str], stems: list[str], at: int, end: int) -> bool:
        """Tell "soft as wool" and "wool soft": nothing is made of it."""
        before = [word for word in raw[max(0, at - 2) : at] if word not in ("a", "an")]
        if before and before[-1] in _LIKE:
            return True
        hard = end < len(raw) and raw[end] in _COMPARED
        return hard and not self._parts.match(stems, end)  # "steel hard shell": a part

    def _is_part(self, stems: list[str], span: Span) -> bool:
        """Whether the span is a word for a part too: "soil", "boulder"."""
        found = self._parts.match(stems, span[0])
        return found is not None and found[1] == span[1] - span[0]

    def _choose(self, raw: list[str], stems: list[str], spans: list[Span]):
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
        if link is None:
            return self._attribute(raw, stems, spans, content), range(n)
        after = [span for span in spans if span[0] > link]
        if after:
            return after[0], range(link)
        # "the oak seat is heavy", but "the boulder and the soil are heavy"
        first = next((span for span in spans if span[1] <= link), None)
        head = first and any(first[1] <= i < link for i in content)
        joined = first and raw[first[1]] in ("and", ",")
        return (first if head and not joined else None), range(link)

    def _attribute(self, raw, stems, spans: list[Span], content: list[int]) -> Span | None:
        """Material of a phrase without a verb: "oak legs", "legs oak", "very soft leather"."""
        if not spans:
            return None
        first, last = spans[0], spans[-1]
        others = [i for i in content if not first[0] <= i < first[1]]
        how = any(word in MANNER for word in raw[: first[0]])
        if not others and how and self._is_part(stems, first):
            return None  # "very heavy soil"
        ends = last[1] == len(raw) and self._is_part(stems, first)
        if raw[0] == "make" or (ends and not self._is_part(stems, last)):
            return last
        return first


def _idle(word: str, stem: str) -> bool:
    return (word in _IDLE or stem in _IDLE or not word[0].isalnum()) and stem not in _ALL


def _join(raw: Sequence[str], stems: Sequence[str], where: range, without) -> str:
    kept = [i for i in where if i not in without and not _idle(raw[i], stems[i])]
    return " ".join("everything" if stems[i] in _ALL else stems[i] for i in kept)


# Which clause of a sentence speaks of which part of an asset.

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
        own = [word for word in self.name_words if word not in EXPORTED]
        told = [word for word in own[:-1] if word not in FILLERS] + own[-1:]
        return " ".join(told) or "object"


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
            if noun in REST or (noun in OBJECTS and not many):
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
    every = OBJECTS | REST | DETERMINERS
    lost = [
        k
        for k, clause in enumerate(clauses)
        if (clause.material or clause.level) and set(clause.parts) - every and not score[k].any()
    ]
    alone = sum(bool(clause.material) for clause in clauses) <= 1
    return [] if len(lost) == 1 and alone and is_whole(clauses[lost[0]]) else lost


def is_whole(clause: HeardClause) -> bool:
    """Whether a clause speaks of the object ("oak cube") and of no part that people know."""
    known = frozenset().union(*SYNONYMS) | STRUCTURE
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
        score[k] += MAIN * bool(set(clause.parts) & STRUCTURE)
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
    usual = [by_kind for nouns, by_kind in USUAL.items() if nouns & set(clause.parts)]
    same = clause.material is not None and kind == category(clause.material)
    return (SAME_KIND if same else OTHER_KIND) + max((k.get(kind, 0.0) for k in usual), default=0.0)


# What a sentence says: its clauses, each a material or a level of some parts.

# AutoPhyX 3.3: "This is a [object name]." leaves every part at the mean of its range.
_TEMPLATE = re.compile(r"((this|it) is |an image of )?an? [\w -]{1,40}\.?", re.IGNORECASE)


@dataclass(frozen=True)
class HeardClause:
    """One statement of a sentence.

    Parameters
    ----------
    text
        Its words, without those that say nothing.
    material
        A name of the table's row that it names, or None.
    parts
        Stems of the words for the parts it speaks of, in order.
    level
        "soft", "stiff", "dense" or "light" where an adjective says so.
    written
        All words from its first to its last as they were written: "extremely" is no filler for a
        network. ``text`` where its words stand apart in the sentence.
    phrase
        The words that name the row, which the table need not have: "PP". "" without a material.
    """

    text: str
    material: str | None = None
    parts: tuple[str, ...] = ()
    level: str | None = None
    written: str = field(default="", compare=False)
    phrase: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not self.written:
            object.__setattr__(self, "written", self.text)
        if not self.phrase:
            object.__setattr__(self, "phrase", self.material or "")

    @classmethod
    def of(cls, clause: Clause) -> HeardClause:
        """Return a clause as a network hears it: its telling words, stems of its subject."""
        raw = re.findall(r"[\w'-]+", clause.text)
        text = " ".join(word for word in raw if word.lower() not in FILLERS)
        parts = tuple(stem(word) for name in clause.subject.names for word in name)
        if clause.subject.scope == "rest":
            parts = ("everything",)
        degrees = ((clause.stiffness, "soft", "stiff"), (clause.density, "light", "dense"))
        levels = [low if n < 3 else high for n, low, high in degrees if n is not None and n != 3]
        return cls(
            text or clause.text, clause.material, parts,
            next(iter(levels), None), clause.text, clause.phrase,
        )  # fmt: skip


class HeardSentence(NamedTuple):
    """A text, read once: every later stage takes its clauses and not its characters."""

    text: str
    clauses: tuple[HeardClause, ...]

    @classmethod
    def of(cls, sentence: Sentence) -> HeardSentence:
        """Return a sentence as a network hears it: without words that nobody understood."""
        known = (c for c in sentence.clauses if c.material or not c.unknown)
        return cls(sentence.text, tuple(HeardClause.of(clause) for clause in known))

    @property
    def stated(self) -> tuple[HeardClause, ...]:
        """Its clauses; none where it only says what the object is."""
        says = any(clause.material or clause.level for clause in self.clauses)
        return self.clauses if says or not _TEMPLATE.fullmatch(self.text.strip()) else ()


# What a clause says word by word: the table's material, and how stiff, heavy or brittle.
#
# Sentence embeddings hardly tell "very stiff" from "soft" (their cosine is .93), so a clause's
# embedding is joined by a few channels read off a closed list of plain English words. They are
# hints to the network, which still hears the whole sentence and learns with the hints taken away.

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
_LEXICON_WEIGHT = _stems("weight weighs weigh density lift carry")
_LEXICON_STIFFNESS = _stems("stiffness firmness rigidity hardness softness flexibility")
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
    if not signs and said & _LEXICON_STIFFNESS:
        signs = [-1, 1] if said & MODERATE else [-1 if said & (_LITTLE | _NOT) else 1]
    return _score(words, signs)


def _weight(words: Sequence[str]) -> float | None:
    """Score from -1 (weighs next to nothing) to 1 (weighs a ton)."""
    said = set(words)
    if "water" in said or "own" in said:  # "sags under its own weight"
        return None
    signs = _sign(words, LIGHT, HEAVY)
    if not signs and said & _LEXICON_WEIGHT:
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


# Levels of stiffness and weight, and what they make of a material.


class Level(NamedTuple):
    """What a level asks for: shares of the ranges of E and rho (log) and nu, None where silent.

    ``floats`` puts rho below that of water (True) or above it (False).
    """

    stiffness: float | None = None
    density: float | None = None
    nu: float | None = None
    floats: bool | None = None


# Place in the logarithmic range of a row, from "very soft" to "very stiff": halves of its halves,
# and nearly its ends.
SHARES = (0.04, 0.25, 0.5, 0.75, 0.96)

LEVELS_LEVELS: dict[str, Level] = {
    **{
        said: Level(stiffness=share)
        for said, share in zip(
            ("very soft", "soft", "medium", "stiff", "very stiff"), SHARES, strict=True
        )
    },
    "brittle": Level(stiffness=0.85, nu=0.1),
    **{
        said: Level(density=share)
        for said, share in zip(
            ("very light", "light", "average weight", "dense", "very dense"), SHARES, strict=True
        )
    },
    "floats": Level(floats=True),
    "sinks": Level(floats=False),
}


def material_at_level(row: Material, level: Level) -> MaterialValue:
    """Return E [Pa], nu [1], rho [kg/m^3] of a row, E and rho moved within its own ranges."""
    value = row.value(0.5 if level.stiffness is None else level.stiffness)
    share = 0.5 if level.density is None else level.density
    return value._replace(rho=row.rho.min ** (1 - share) * row.rho.max**share)


# Kinds of material by the words in a name of an asset: "blackMetal_02", "madera oscura".

# Whole words, and stems that also count inside a word ("whiteplastic"); the first kind that matches
# is taken, so that "fiberglass" is plastic and "glass_frame_metal" is metal's, not glass's.
_WORDS = {
    "rubber": "rubber tire tires tyre tyres tread goma",
    "leather": "leather cuir cuero skai",
    "ceramic": "ceramic ceramica porcelain tile tiles loza enamel",
    "stone": "stone stones marble granite concrete rock brick bricks cement pietra piedra",
    "paper": "paper cardboard papel carton book books",
    "plant": "leaf leaves grass flower flowers petal plant cactus foliage hoja hojas petalred",
    "plastic": "plastic plastics plastico plast plastique lastic vinyl pvc acrylic nylon fiberglass"
    " polyester melamine",
    "metal": "metal metall metalic metallic metalico chrome cromo aluminum aluminium alu alumain"
    " steel stainless inox acier acero iron brass gold silver argent copper bronze zinc wire tin",
    "glass": "glass vidro vidrio cristal crystal mirror verre windshield window pane lens espejo",
    "wood": "wood wooden madera fusta bois legno holz oak pine walnut teak teck bamboo cherry"
    " maple mahogany birch beech wenge venge ash parquet plywood redwood rattan"
    " trunk branch branches",
    "fabric": "fabric textile textil tela telas cloth cotton wool curtain curtains towel toalla"
    " felt carpet rug pillow cushion coixi mattress matress linen canvas velvet blanket shirt pants"
    " sheet tissu tejido",
}
_INSIDE = {
    "rubber": ("rubber",),
    "leather": ("leather",),
    "plastic": ("plastic", "fiberglass"),
    "metal": ("metal", "chrome", "alumin"),
    "glass": ("glass",),
    "wood": ("wood",),
    "fabric": ("fabric", "textile"),
}
KINDS = tuple(_WORDS)
_KIND_OF = {word: kind for kind, words in _WORDS.items() for word in words.split()}
_CHAFF = frozenset(
    "jpg jpeg png tga texture textured tex map mat material generic sweethome".split()
)


def bare_words(name: str) -> list[str]:
    """Lower-case words of a name, without digits, file suffixes and the like."""
    spaced = re.sub(r"(?<=[a-zà-ÿ])(?=[A-ZÀ-Ý])", " ", name)
    words = re.findall(r"[^\W\d_]+", spaced.lower())
    return [word for word in words if len(word) > 1 and word not in _CHAFF]


def kind_of(name: str) -> str | None:
    """Kind of material that a name speaks of, or None."""
    words = bare_words(name)
    found = {_KIND_OF[word] for word in words if word in _KIND_OF}
    if not found:
        found = {k for k, stems in _INSIDE.items() for s in stems if any(s in w for w in words)}
    return next((kind for kind in KINDS if kind in found), None)


# The words of the material table, found in sentences and in the names of an asset's parts.

TOKEN = re.compile(r"[^\W_]+|[.;,&+=:\n]")
_IRREGULAR = {"leaves": "leaf", "feet": "foot", "shelves": "shelf", "knives": "knife"}


def stem(word: str) -> str:
    """Return the singular, lower-case form of an English word."""
    word = word.lower()
    if word in _IRREGULAR:
        return _IRREGULAR[word]
    if len(word) > 4 and word.endswith("ies"):
        return word[:-3] + "y"
    if len(word) > 4 and word.endswith(("ches", "shes", "sses", "xes")):
        return word[:-2]
    if len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is")):
        return word[:-1]
    return word


def name_words(name: str) -> list[str]:
    """Stems of the words in a part, node or material name: camelCase, digits and _ divide them."""
    spaced = re.sub(r"(?<=[^\W\d_A-Z])(?=[A-Z])", " ", name)
    return [stem(word) for word in re.findall(r"[^\W\d_]+", spaced)]


class Vocabulary:
    """The material phrases to look for; the longest match wins."""

    def __init__(self, phrases: Iterable[str]) -> None:
        self._phrase: dict[tuple[str, ...], str] = {}
        for phrase in phrases:  # of singular and plural, the first
            self._phrase.setdefault(tuple(map(stem, TOKEN.findall(phrase.lower()))), phrase)
        self._foreign = {stem(word): name for word, name in FOREIGN.items()}
        self._longest = max(map(len, self._phrase), default=0)

    def match(self, stems: Sequence[str], at: int) -> tuple[str, int] | None:
        """Longest phrase that starts at ``stems[at]``, and its number of tokens."""
        for length in range(min(self._longest, len(stems) - at), 0, -1):
            phrase = self._phrase.get(tuple(stems[at : at + length]))
            if phrase is not None:
                return phrase, length
        return None

    def in_name(self, name: str) -> str | None:
        """The longest material phrase in an asset's name ("Metal_Chrome", "legno_scuro")."""
        stems = name_words(name)
        found = [match for at in range(len(stems)) if (match := self.match(stems, at))]
        if found:
            # "Wood_Oak" is oak: of equals, the word that is no family's.
            return max(found, key=lambda match: (match[1], match[0] not in FAMILIES))[0]
        return next((self._foreign[word] for word in stems if word in self._foreign), None)


@lru_cache(maxsize=4)
def vocabulary_of(table: MaterialTable) -> Vocabulary:
    """Return the phrases of a table."""
    return Vocabulary(table.phrases)


# What parts and whole things are called, and what parts may be made of.

# Part: its words | the materials it may plausibly have, as phrases of the table.
_PARTS = """
leg: leg, legs, chair legs | oak, pine, steel, aluminium, plastic
seat: seat, seating | foam, leather, plywood, fabric, plastic, oak
backrest: back, backrest | oak, plastic, fabric, leather, foam, wicker
armrest: armrest, armrests, arm | oak, foam, steel, leather, plastic
tabletop: top, tabletop, table top | oak, glass, marble, mdf, steel
drawer: drawer, drawers | oak, mdf, plywood, plastic
mattress: mattress | foam, memory foam, latex foam, firm foam
bedframe: bed frame, bedstead | pine, oak, steel, mdf
sofaframe: sofa frame, frame | pine, oak, plywood, steel
headboard: headboard | oak, fabric, leather, mdf
pillow: pillow, cushion, pillows | polyester fibre fill, foam, memory foam, cotton
base: base, stand, lamp base | steel, brass, marble, ceramic, plastic
pole: pole, rod, post, posts | steel, aluminium, brass, oak
shade: shade, lampshade | fabric, paper, glass, plastic
shelf: shelf, shelves | pine, mdf, glass, steel
cabinet: cabinet, carcass, casing | mdf, oak, plywood, steel
door: door, doors | oak, glass, mdf, steel
knob: knob, knobs | brass, ceramic, plastic, steel
pot: pot, planter, flowerpot | ceramic, terracotta, plastic, concrete
soil: soil, earth, ground | soil, sand, gravel, clay, moss
trunk: trunk, tree trunk | living trunk, green wood, bamboo, plastic
leaves: leaves, foliage, crown | leaf, grass, silk, plastic, paper
cactus: cactus, plant | cactus, plastic, felt
flower: flower, blossom, petals | petal, silk, paper, plastic
stem: stem, stalk | green wood, grass, plastic
vase: vase, jar | glass, ceramic, porcelain, plastic
mug: mug, cup | ceramic, porcelain, glass, steel, plastic
handle: handle, grip | oak, plastic, steel, rubber, leather
bottle: bottle, flask | glass, pet, steel, aluminium, hdpe
cap: cap, stopper | plastic, cork, aluminium, rubber
lid: lid, cover | glass, steel, plastic, ceramic
pan: pan, skillet | cast iron, aluminium, steel, copper
kettle: kettle, teapot | steel, ceramic, glass, copper
spout: spout, nozzle | steel, ceramic, plastic
head: head, hammer head | steel, cast iron, rubber, wood
blade: blade | steel, stainless steel, ceramic, plastic, titanium
bristles: bristles, brush hairs | nylon, straw, wool
sole: sole, soles | rubber, eva, leather, cork
upper: upper, shoe upper | leather, fabric, nylon fabric, suede
laces: laces, shoelaces | cotton, nylon fabric, rope
bag: bag, pouch | leather, canvas, nylon fabric, cotton
strap: strap, straps, belt | leather, nylon fabric, cotton
carbody: car body, bodywork, chassis | steel, aluminium, plastic, carbon fibre, pine
wheel: wheel, wheels, tyres | rubber, plastic, wood, steel
window: windows, windscreen | glass, acrylic, polycarbonate
fuselage: fuselage, airframe | aluminium, carbon fibre, plastic, balsa
wing: wing, wings | aluminium, carbon fibre, balsa, plastic
propeller: propeller, rotor | oak, plastic, aluminium, carbon fibre
torso: torso, belly, body | plush, cotton, rubber, plastic, wood
limb: limbs, paws | plush, cotton, rubber, plastic, wood
ear: ears, ear | plush, felt, plastic
nose: nose, snout | plastic, felt, rubber, carrot
beak: beak, bill | rubber, plastic, wood
weights: weights, weight plates, discs | cast iron, steel, rubber, concrete
bar: bar, crossbar | steel, aluminium, cast iron
candle: candle, candles | wax, beeswax
holder: holder, candlestick | brass, silver, glass, ceramic
wick: wick | cotton, rope
cake: cake, cake layer | cake, bread, butter
icing: icing, frosting, topping | butter, sugar, chocolate
cone: cone, waffle cone | biscuit, paper
scoop: scoop, ice cream | snow, butter, gelatin
bun: bun, bread roll | bread, cake, sponge
patty: patty, filling | meat, cheese, mushroom
lettuce: lettuce, salad leaf | leaf, tissue paper
fruit: fruit, apple flesh | apple, tomato, wax, plastic
mushroomcap: mushroom cap | mushroom, plastic, ceramic
bookcover: book cover, binding | leather, cardboard, fabric
pages: pages, page block | paper, book
crate: crate, box | cardboard, pine, plastic, steel
staves: staves, barrel wood | oak, pine, plastic
hoops: hoops, metal bands, rings | steel, iron, brass, rope
bucket: bucket, pail | steel, plastic, zinc, wood
bowl: bowl, dish | gold, silver, brass, glass, wood
plinth: plinth, pedestal | marble, oak, plastic
clockcase: clock case, housing | oak, plastic, brass
dial: dial, clock face | paper, ceramic, plastic, steel
hands: hands, pointers | steel, brass, plastic
drumshell: drum shell, shell | maple, steel, acrylic
membrane: membrane, drumhead | pet, leather
hoopframe: racket frame, rim | carbon fibre, aluminium, ash
strings: strings, netting | nylon, silk, steel
guard: guard, crossguard | brass, steel, wood
shank: shank | steel, stainless steel
pencilshaft: pencil shaft, casing wood | cedar, basswood, plastic
tip: tip, point | graphite, steel, wax
eraser: eraser, eraser end | rubber, soft rubber
sweet: candy, sweet | hard candy, gelatin, chocolate
stick: stick | paper, wood, plastic
panel: panel, door panel | oak, mdf, steel, glass
doorframe: door frame, jamb | pine, steel, plastic
pane: pane, window pane | glass, acrylic, polycarbonate
sill: sill, window sill | marble, oak, pvc, concrete
windowframe: window frame, sash | pvc, aluminium, pine
wall: wall, walls | brick, concrete, wood, limestone
roof: roof, roofing | slate, clay, straw, steel
chimney: chimney, smokestack | brick, concrete, steel
rail: rail, rails, railing | oak, steel, aluminium, bamboo
fins: fins, fin | aluminium, plastic, plywood, rubber
antenna: antenna, aerial | steel, copper, plastic
lining: lining, padding | foam, eva, eps, felt
helmet: helmet, hard shell | polycarbonate, abs, carbon fibre, steel
basket: basket, trug | wicker, straw, plastic, steel wire
brim: brim, hat brim | felt, straw, leather
hatcrown: hat crown, hat top | felt, straw, wool
suitcase: suitcase, luggage | polycarbonate, aluminium, leather, canvas
lens: lens, lenses | glass, polycarbonate, acrylic
spectacles: spectacle frame, glasses frame | acetal, titanium, wood, steel
rock: rock, boulder | granite, limestone, sandstone, foam
statue: statue, figure | bronze, marble, plaster, wood
"""
# Whole things that people know, in the order of the training's categories.
CATEGORY_NAMES = tuple(
    "chair armchair sofa stool bench table desk bed lamp bookshelf wardrobe dresser door window "
    "house fence clock candlestick hammer axe knife sword screwdriver shovel broom brush pan "
    "saucepan teapot mug bottle jar bucket basket barrel parcel suitcase handbag shoe hat "
    "helmet glasses car wagon airplane rocket dumbbell trophy drum racket pencil book "
    "potted_plant cactus tree bouquet apple mushroom layer_cake ice_cream burger lollipop teddy "
    "duck snowman robot monument garden candy_bowl".split()
)
# Parts of the two categories that training never sees, with words that nothing else uses.
_HELD_OUT_PARTS = """
hull: hull, boat hull | oak, gfrp, aluminium, plastic
mast: mast, spar | spruce, aluminium, carbon fibre
sail: sail, sailcloth | canvas, nylon fabric, cotton
canopy: canopy, umbrella cloth | nylon fabric, silk, paper, cotton
hook: hook, crook | bamboo, plastic, steel
ribs: ribs, stretchers | steel, gfrp, bamboo
"""


@dataclass(frozen=True)
class PartKind:
    """A kind of part: its words and the rows of the table it may plausibly be made of."""

    name: str
    words: tuple[str, ...]
    materials: tuple[Material, ...]
    held_out: bool = False

    def value(
        self, *, stiffness: float = 0.5, density: float = 0.5, nu: float = 0.5
    ) -> MaterialValue:
        """Return E [Pa], nu [1], rho [kg/m^3] at shares of the range that its materials span.

        E and rho move in log space; one half everywhere is the mean that unmentioned parts get.
        """
        E_low, E_high = (f(m.E[i] for m in self.materials) for i, f in enumerate((min, max)))
        rho_low, rho_high = (f(m.rho[i] for m in self.materials) for i, f in enumerate((min, max)))
        nus = [m.value().nu for m in self.materials]
        poisson = max(0.0, min(nus) + nu * (max(nus) - min(nus)))
        return MaterialValue(
            E_low ** (1 - stiffness) * E_high**stiffness,
            min(poisson, NU_CAP),
            rho_low ** (1 - density) * rho_high**density,
        )

    @property
    def rho_range(self) -> tuple[float, float]:
        """Lowest and highest density [kg/m^3] of its materials."""
        return min(m.rho.min for m in self.materials), max(m.rho.max for m in self.materials)


def _read(text: str, held_out: bool) -> dict[str, PartKind]:
    table = load_table()
    kinds = {}
    for line in text.strip().splitlines():
        name, rest = line.split(":", 1)
        words, materials = (
            tuple(item.strip() for item in side.split(",")) for side in rest.split("|")
        )
        rows = tuple(table.exact(material) for material in materials)
        kinds[name] = PartKind(name, words, rows, held_out)
    return kinds


@lru_cache(maxsize=1)
def part_kinds() -> dict[str, PartKind]:
    """Every kind of part by name; the held-out ones last."""
    return {**_read(_PARTS, False), **_read(_HELD_OUT_PARTS, True)}


def spoken(category: str) -> str:
    """Return the name of a category as people say it: "potted plant"."""
    return category.replace("_", " ")


@lru_cache(maxsize=1)
def known_words() -> tuple[str, ...]:
    """Words for parts and whole things, but for those that only tests of the network speak of."""
    kinds = [kind for kind in part_kinds().values() if not kind.held_out]
    return (*(word for kind in kinds for word in kind.words), *map(spoken, CATEGORY_NAMES))

"""What the words about one part settle: a row of the table, or what is known without one.

In this order: the material that is named; what the asset's own name says; a kind of matter; how
stiff or heavy it is said to be; what lies nearest in meaning. Numbers win over all of them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import get_args

from ...fem.note import Note
from ...fem.table import FIELDS, Material, MaterialTable, MaterialValue, Span, key, load_contents
from ..prediction import PartChoice
from ..text.clauses import Clause, Degree, names_object
from ..text.hearing import SHARES, EncodedClause, NamedPart
from ..text.lexicon import words
from ..text.numerals import Measure, Quantity
from .numbers import as_stated, may_have, rubber_of, with_numbers
from .similarity import RowKernel

# What an everyday part is made of if neither the text nor its name says more.
COMMON = "wood steel plastic glass ceramic fabric leather rubber stone paper".split()
ALSO_COMMON = ("foam", "soft foam", "concrete", "felt")  # where a level or a kind is said
_SPOKEN_DEGREE: dict[Degree, tuple[str, ...]] = {
    1: ("soft", "flexible", "very soft"), 2: ("soft", "flexible"), 3: (),
    4: ("hard", "rigid", "stiff"), 5: ("hard", "rigid", "stiff"),
}  # fmt: skip
_HEARD_DEGREE: dict[str | None, Degree] = {"soft": 2, "stiff": 4}  # of what a network hears


@dataclass(frozen=True)
class PartStatement:
    """All that the clauses say of one part, the most specific first.

    clauses: The clauses that speak of it.
    borrowed: Whether they speak of all parts, of what nothing else names, or of a part that the
        asset does not have and that this one is taken for.
    whole: Whether they speak of the object: the asset's own word for a part says more.
    open: Whether a predictor that sees the shape may know better, since the text names parts that
        the asset does not have.
    override: The text of an option that is about this part alone.
    spoken: Whether the text has a word of the part's name.
    """

    clauses: tuple[Clause, ...] = ()
    borrowed: bool = False
    whole: bool = False
    open: bool = False
    override: str = ""
    spoken: bool = False

    @property
    def naming(self) -> Clause | None:
        """The clause that names a material."""
        return next((clause for clause in self.clauses if clause.material), None)

    @property
    def unknown(self) -> Clause | None:
        """The clause that names something unknown, where none names a material."""
        found = next((clause for clause in self.clauses if clause.unknown), None)
        return None if self.naming else found

    def first(self, name: str):
        """Return the first of the clauses' fields of this name that says something."""
        return next((getattr(c, name) for c in self.clauses if getattr(c, name)), None)

    @property
    def kind(self) -> str | None:
        """The kind of matter that is said without a name."""
        bare = (c.kind for c in self.clauses if c.kind and not c.material)
        return next(bare, None)

    def all(self, name: str) -> tuple:
        """Return what all clauses have in a field of this name."""
        return tuple(item for clause in self.clauses for item in getattr(clause, name))

    @property
    def numbers(self) -> tuple[Quantity, ...]:
        """Numbers of each measure that are said of the most specific subject that has any."""
        of: dict[Measure, tuple] = {}
        return tuple(
            number for clause in self.clauses for number in clause.numbers
            if of.setdefault(number.measure, clause.subject.names) == clause.subject.names
        )  # fmt: skip

    @property
    def deciding(self) -> Clause | None:
        """The clause that says most: it names, or else says anything of the matter."""
        saying = (clause for clause in self.clauses if clause.says_matter)
        return self.naming or next(saying, None)


class Decider:
    """Decides one part at a time; keeps the table's embeddings."""

    def __init__(self, table: MaterialTable, kernel: RowKernel) -> None:
        self.table, self.kernel = table, kernel

    def prepare(self, parts: Sequence[NamedPart], statements: Sequence[PartStatement]) -> None:
        """Embed in one go what is asked of the parts that no word of the table names."""
        unnamed = (
            (part, words)
            for part, words in zip(parts, statements, strict=True)
            if words.naming is None and not part.material
        )
        self.kernel.embed([_query(part, words) for part, words in unnamed])

    def decide(
        self, part: NamedPart, statement: PartStatement, *, alpha: float | None, volume: float
    ) -> tuple[PartChoice, tuple[str, ...]]:
        """Return the choice for a part of which so much is said, and what to warn of.

        ``volume`` [m^3] is that of all parts of which the same is said.
        """
        choice = self._row_of(part, statement)
        if statement.override:
            choice = replace(choice, why=f"override: {statement.override!r}", settled=True)
        # E and rho where they are said to be: in the row's range, or absolutely
        stiffness, density = statement.first("stiffness"), statement.first("density")
        if (
            statement.naming
            and choice.row.name != self.table.exact(statement.naming.material or "").name
        ):
            stiffness = None  # "soft foam" is a row of its own
        value = value_at(
            choice.row, stiffness=stiffness, density=density, character=statement.all("character"),
            absolute=statement.naming is None and choice.guessed,
        )  # fmt: skip
        place = PLACE[stiffness] if stiffness else 0.5
        if alpha is not None:
            place, value = alpha, value._replace(E=choice.row.value(alpha).E)
        choice = replace(choice, value=value, alpha=place)
        value, derivation, warnings, exact = with_numbers(
            part.name, choice.row, choice.value, statement.numbers,
            blend=statement.first("blend"), volume=volume, named=statement.naming is not None,
        )  # fmt: skip
        choice = replace(choice, value=value, derivation=derivation, exact=exact)
        if derivation and not statement.open:
            choice = replace(choice, settled=True)
        if {*FIELDS} <= {number.measure for number in statement.numbers}:
            choice = as_stated(choice)
        # Sentences about what was said of a part and could not be taken as it stands
        notes = []
        named = dict.fromkeys(clause.material for clause in statement.clauses if clause.material)
        first, *others = named or [""]
        if others:
            notes.append(
                Note(
                    "decision.part_text",
                    name=part.name,
                    map=" and ".join(map(repr, named)),
                    first=first,
                    map_2=", ".join(map(repr, others)),
                )
            )
        notes += [
            f"part {part.name!r}: {doubt}" for doubt in dict.fromkeys(statement.all("doubts"))
        ]
        return replace(choice, unknown=statement.unknown), (*notes, *warnings)

    def of_clause(self, part: str, clause: EncodedClause, why: str) -> PartChoice:
        """Choose for a part what a clause names, a predictor having found the part for it."""
        degree, named = _HEARD_DEGREE.get(clause.level), self.table.exact(clause.material or "")
        row = self._named(clause.phrase, named.name, degree)
        stiffness = degree if row is named else None
        value = value_at(row, stiffness=stiffness, density=None, absolute=False)
        return PartChoice(part, row, value, 1.0, PLACE[stiffness or 3], why)

    def _row_of(self, part: NamedPart, statement: PartStatement) -> PartChoice:
        """Choose the row, at the middle of its ranges."""
        naming, deciding = statement.naming, statement.deciding
        contents = load_contents().phrases.get(part.spoken)
        if contents and not part.material and (statement.whole or not statement.clauses):
            return _choice(part, contents, f"name: {part.name!r}")
        label = self.table.exact(part.material) if part.material else None
        if naming is not None and not self.keeps_name(part, statement):
            material = naming.material or ""
            row = self._named(naming.phrase or material, material, statement.first("stiffness"))
            why = (
                f"whole sentence: {naming.text!r}"
                if statement.borrowed
                else f"text: {naming.text!r}"
            )
            choice = _choice(part, row, why, clause=naming, settled=not statement.open)
            # "The chair is beech": so are its legs.
            of_object = statement.whole and not statement.spoken and names_object(naming)
            doubts = _kind_taken(part, statement, row)
            return replace(choice, borrowed=statement.borrowed and not of_object, doubts=doubts)
        # Called after what it holds: a butter dish is not of butter.
        containers, own = words()["containers"], part.name_words
        if (
            label and part.material_label == part.name and len(own) > 1
            and label.category in containers["matter"] and own[-1] in containers["words"]
        ):  # fmt: skip
            bare = " ".join(part.name_words[-1:])
            part, label = replace(part, name_words=(bare,), material=None), None
        ruled_out = label and (
            {label.name, label.category} & set(statement.all("excluded"))
            or statement.kind not in (None, label.category)
            or not behaves(label, statement.all("character"))
        )
        if label and not ruled_out:
            why = f"name: {part.material_label!r}"
            doubts = _kind_taken(part, statement, label)
            if statement.whole and naming and naming.material != label.name:
                wins = Note("decision.name_wins", name=label.name, material=naming.material)
                doubts = (*doubts, f"part {part.name!r}: {wins}")
            known = statement.unknown is None
            return _choice(part, label, why, clause=deciding, settled=known, doubts=doubts)
        coating = statement.first("coating")
        if coating and key(coating) in self.table.phrases and not label:
            row = self.table.exact(coating)
            doubt = Note("decision.part_only", name=part.name, name_2=row.name)
            return _choice(
                part, row, Note("decision.covers", coating=coating), guessed=True, doubts=(doubt,)
            )
        if deciding is None or statement.unknown is not None:
            # Choose the row nearest in meaning to the part's name; the common ones if all are far
            query = _query(part, statement)
            common = {self.table.exact(word).name for word in COMMON}
            near = self.kernel.nearest(query, common=common)
            return _choice(
                part, near.row, f"nearest to {query!r}", weight=near.share, clause=deciding,
                settled=near.meaningful and not (statement.open or statement.unknown), guessed=True,
            )  # fmt: skip
        return self._among(part, statement, deciding)

    def keeps_name(self, part: NamedPart, statement: PartStatement) -> bool:
        """Whether a part's own name says more of it than what is said of the whole.

        "Beech", said of the whole, is against an ash_leg, and not against a glass_top.
        """
        if not (statement.whole and statement.naming):
            return False
        if not part.material:
            return part.spoken in load_contents().phrases
        named, label = (
            self.table.exact(statement.naming.material or ""),
            self.table.exact(part.material),
        )
        return named is label or named.category != label.category

    def _named(self, words: str, material: str, degree: Degree | None) -> Material:
        """Return the row that words name, or its soft or hard relative where one is said."""
        for adjective in _SPOKEN_DEGREE[degree] if degree else ():
            row = self.table.phrases.get(f"{adjective} {words}".lower())
            if row is not None:
                return row
        return self.table.exact(material)

    def _among(self, part: NamedPart, statement: PartStatement, deciding: Clause) -> PartChoice:
        """Choose the row nearest in meaning of those that can be as is said, without a name."""
        rows = rows_at(
            self.kernel.rows,
            stiffness=statement.first("stiffness"), density=statement.first("density"),
            character=statement.all("character"), excluded=statement.all("excluded"),
        )  # fmt: skip
        fitting = [row for row in rows if statement.kind in (None, row.category)]
        rows = fitting or self.kernel.rows
        rubber = None if statement.kind else rubber_of(self.table.rows, statement.numbers)
        if rubber is not None:
            return _choice(part, rubber, deciding.text, clause=deciding, guessed=True)
        rows = [row for row in rows if may_have(row, statement.numbers)] or rows
        usual = {self.table.exact(word).name for word in (*COMMON, *ALSO_COMMON)}
        names = {row.name for row in rows}
        common = names & usual or names
        near = self.kernel.nearest(_query(part, statement), among=names, common=common)
        doubt = Note(
            "decision.part_material", name=part.name, text=deciding.text, name_2=near.row.name
        )
        return _choice(
            part, near.row, Note("decision.nearest_meaning", text=deciding.text), clause=deciding,
            weight=near.share, guessed=True, settled=not statement.open,
            doubts=() if fitting else (doubt,),
        )  # fmt: skip


def _query(part: NamedPart, statement: PartStatement) -> str:
    """Words to compare with the table's: what a part is called, and what is said of it."""
    if statement.unknown is None and statement.deciding is not None:
        return f"{part.spoken} {statement.deciding.text}".strip()
    first = next(iter(statement.clauses), None)
    text = first.text if first and not (first.unknown or first.filling) else ""
    return f"{part.spoken} {text}".strip()


def _choice(
    part: NamedPart,
    row: Material,
    why: str,
    *,
    clause: Clause | None = None,
    weight: float = 1.0,
    settled: bool = True,
    guessed: bool = False,
    doubts: tuple[str, ...] = (),
) -> PartChoice:
    return PartChoice(
        part.name, row, row.value(), weight, 0.5, why, settled=settled, clause=clause,
        guessed=guessed, doubts=doubts,
    )  # fmt: skip


def _kind_taken(part: NamedPart, statement: PartStatement, row: Material) -> tuple[str, ...]:
    """That a row stands for a kind of matter; generic rows span theirs."""
    naming = statement.naming
    if naming and naming.kind and "generic" not in row.name:
        kind = Note("decision.kind_matter", phrase=naming.phrase)
        return (Note("decision.part_taken", name=part.name, value=kind, name_2=row.name),)
    return ()


# What "soft" or "heavy" mean where no material is named: bands of E and rho, and rows in them.

# E [Pa] by degree. After the chart of E and rho of Ashby, Materials Selection in Mechanical
# Design, fig. 4.3: gels and the softest foams; soft foams and the softest rubbers; rubbers,
# leather, corks, flexible polymers; polymers, woods, glass, concrete; metals and ceramics.
STIFFNESS: dict[Degree, Span] = {
    1: Span(1e3, 1e5),
    2: Span(1e4, 1e6),
    3: Span(1e6, 1e9),
    4: Span(1e9, 1e11),
    5: Span(5e10, 6e11),
}
# rho [kg/m^3] by degree, the same chart: foams; cork, balsa and woods that float well; woods and
# polymers; glass, stone and light metals; heavy metals.
DENSITY: dict[Degree, Span] = {
    1: Span(5, 150),
    2: Span(50, 700),
    3: Span(500, 1500),
    4: Span(1500, 9000),
    5: Span(7000, 20000),
}
# What is said to be flexible, floppy or pliable: rubbers, fabrics, films, and thin stiffer matter.
FLEXIBLE = Span(1e5, 1e8)
NEARLY = 1.5  # as light as the lightest that is as stiff: aluminium beside carbon fibre
# Place of a degree in the logarithmic range of E or rho of a row that is named.
PLACE: dict[Degree, float] = dict(zip(get_args(Degree), SHARES, strict=True))
WATER = 1000.0  # [kg/m^3]
# Words for behaviour -> the categories that behave so, by what each is known for (Ashby, fig. 4.7:
# fracture toughness; elastomers return what they take up).
BEHAVING: dict[str, frozenset[str]] = {
    "brittle": frozenset({"glass-ceramic", "stone"}),
    "tough": frozenset({"metal", "composite", "plastic"}),
    "bouncy": frozenset({"elastomer"}),
}


def behaves(row: Material, character: Iterable[str]) -> bool:
    """Whether a row is known to behave as all these words say; unknown words hold for all."""
    for word in character:
        if word == "floats" and row.rho.min >= WATER:
            return False
        if word == "sinks" and row.rho.max <= WATER:
            return False
        if word in BEHAVING and row.category not in BEHAVING[word]:
            return False
    return True


def rows_at(
    rows: Iterable[Material],
    *,
    stiffness: Degree | None,
    density: Degree | None,
    character: Collection[str] = (),
    excluded: Collection[str] = (),
) -> list[Material]:
    """Rows that can be as stiff and heavy, and behave, as said; less what is ruled out.

    Where no matter is both, as "very stiff and very light", the stiff ones that come nearest.
    """
    left = [
        row
        for row in rows
        if not {row.name, row.category} & set(excluded) and behaves(row, character)
    ]
    E, rho = stiffness_band(stiffness, character), DENSITY.get(density) if density else None
    if E is not None:  # the middle half, in logarithms: what is meant, not what is just possible
        quarter = (E.max / E.min) ** 0.25
        E = Span(E.min * quarter, E.max / quarter)
    stiff = [row for row in left if E is None or max(row.E.min, E.min) <= min(row.E.max, E.max)]
    if rho is None or not stiff:
        return stiff
    apart = {
        row.name: max(0.0, math.log(rho.min / row.rho.max), math.log(row.rho.min / rho.max))
        for row in stiff
    }
    least = min(apart.values())
    return [row for row in stiff if apart[row.name] <= least + math.log(NEARLY)]


def stiffness_band(stiffness: Degree | None, character: Collection[str]) -> Span | None:
    """E [Pa] that a degree means: what is flexible is thin or rubbery, not always soft."""
    if stiffness is None:
        return None
    return FLEXIBLE if "flexible" in character and stiffness < 3 else STIFFNESS[stiffness]


def value_at(
    row: Material,
    *,
    stiffness: Degree | None,
    density: Degree | None,
    character: Collection[str] = (),
    absolute: bool,
) -> MaterialValue:
    """Value of a row at degrees: within its range, or as near to the ``absolute`` bands' middle."""
    value = row.value(0.5)
    band = stiffness_band(stiffness, character)
    if stiffness is not None and band is not None:
        value = value._replace(E=_near(row.E, band) if absolute else _placed(row.E, stiffness))
    if density is not None:
        near = _near(row.rho, DENSITY[density])
        value = value._replace(rho=near if absolute else _placed(row.rho, density))
    return value


def _near(span: Span, band: Span) -> float:
    """Return what of a range lies nearest to the middle of a band."""
    return min(span.max, max(span.min, math.sqrt(band.min * band.max)))


def _placed(span: Span, degree: Degree) -> float:
    return span.min ** (1 - PLACE[degree]) * span.max ** PLACE[degree]

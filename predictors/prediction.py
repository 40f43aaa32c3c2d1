"""What a predictor gives: the material of every part, why, and the field that follows from it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..fem.mpm.materials import class_of
from ..fem.note import Note
from ..fem.table import FIELDS, Material, MaterialValue
from .field import MaterialField, Ranges
from .grid import PartVoxels

if TYPE_CHECKING:  # the reader takes a while to load
    from .text.clauses import Clause, Sentence

# Weight below which a material is a guess: a word that names it gives 1, the nearest of about 200
# rows without one gives .1 to .25.
GUESS = 0.3
# Of the volume of real things in one piece, what a division by clauses about kinds of matter gave
# the right one: `evaluate --split merged`, the card of the FiLM network.
DIVIDED = 0.55
# A modulus or a density in a clause: told where it is of no part.
_STATED = re.compile(r"\d ?(?:[kMG]Pa|psi|[kM]si|k?N/mm|k?g/(?:m|cm|dm|l)|g/cc)|\bE ?=")


class Binding(NamedTuple):
    """What a network understood of one part: the clause that took most of it, and how surely.

    ``share`` of the part's cells follow the clause (None: the text does not speak of them);
    ``spread`` is the mean deviation of log10 E between views of the object from several sides;
    ``certainty`` is how often such an answer is right, where that was measured, else None.
    """

    clause: str | None
    share: float
    voxels: int
    spread: float
    certainty: float | None = None


@dataclass(frozen=True)
class PartChoice:
    """The material of one part, and why.

    part: Name of the part.
    row: The row of the table, or the one nearest to what the network found.
    value: E [Pa], nu [1], rho [kg/m^3] at ``alpha``.
    weight: 1 for a word that names it, else its share in the kernel.
    alpha: Place of E in the row's range, from soft (0) to stiff (1), in log space.
    why: The clause or the label that decided.
    settled: Whether words settle it: the text's for this part or for all, an option's, or the
        asset's.
    clause: The clause that names the material, if one does.
    borrowed: Whether that clause speaks of no part, so that this one takes it for want of its own.
    binding: What was understood of the part, where a network decided.
    network: Name of the network whose own the values are; "" for those of the row.
    derivation: How the values follow from what was said, where they are not the row's own.
    guessed: Whether nothing names the material: what is nearest in meaning was taken.
    matter: Class of matter that a network found, in small letters; "" for that of the row.
    unknown: The clause that names something unknown for the part, where none names a material.
    doubts: Sentences about how this row came to be taken.
    draws: Other plausible materials that a network drew, in the order of their seeds.
    exact: Which of E, nu and rho were stated in numbers.
    """

    part: str
    row: Material
    value: MaterialValue
    weight: float
    alpha: float
    why: str
    settled: bool = True
    clause: Clause | None = None
    borrowed: bool = False
    binding: Binding | None = None
    network: str = ""
    derivation: tuple[str, ...] = ()
    guessed: bool = False
    unknown: Clause | None = None
    doubts: tuple[str, ...] = ()
    matter: str = ""
    draws: tuple[MaterialValue, ...] = ()
    exact: tuple[str, ...] = ()

    @property
    def understood(self) -> bool:
        """Whether what the text says of the part was understood."""
        return self.unknown is None

    @property
    def by_words(self) -> bool:
        """Whether words say how stiff or heavy it is, and its values follow them, not a name."""
        said = self.clause if self.settled else None
        return said is not None and bool(said.stiffness or said.density or said.comparisons)

    @property
    def is_cellular(self) -> bool:
        """Whether it is cells of its row, as a print or a foam is: lighter than any such matter."""
        kinds = {getattr(line, "kind", "") for line in self.derivation}
        return not kinds.isdisjoint(
            f"numbers.{k}" for k in ("infill_pa", "void", "hollow", "cells")
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about the row that was taken, whoever took it."""
        if self.unknown is None:
            return self.doubts
        near = ", ".join(map(repr, self.unknown.nearest)) or "none"
        unread = Note("prediction.material_known", unknown=self.unknown.unknown, near=near)
        taken = Note("prediction.taken_more", material=self.material)
        return (f"part {self.part!r}: {unread}; {taken}", *self.doubts)

    @property
    def matter_class(self) -> str:
        """Class of the material point method, in small letters."""
        return self.matter or class_of(self.row).name.lower()

    @property
    def elsewhere(self) -> bool:
        """Whether its clause names parts, and none of them is this one."""
        return bool(self.borrowed and self.clause and self.clause.subject.scope == "parts")

    @property
    def material(self) -> str:
        """Name of the row in the table, "like" it for values of a network's own."""
        return f"like {self.row.name}" if self.network else self.row.name

    @property
    def source(self) -> str:
        """Where the numbers come from."""
        return f"{self.network} network" if self.network else self.row.source


class Numbered(NamedTuple):
    """Regions of like look: the number of every cell (nx, ny, nz), from 1, the largest first.

    0 is outside; ``colours`` (regions, 3) are their means, sRGB in [0, 1].
    """

    number: np.ndarray
    colours: np.ndarray


@dataclass(frozen=True, eq=False)
class Prediction:
    """The material of every part, and of every cell.

    parts: The given parts, or their pieces where clauses divide them.
    parents: For each of ``parts``, the index of the given part that it is, or is a piece of.
    field: E [Pa], nu [1], rho [kg/m^3] of every cell.
    choices: The material of each of ``parts``.
    unbound: Clauses that say something of parts and were found to speak of none.
    warnings: What of the words was not understood, or not taken as it stands.
    regions: Those that the parts were cut into, where they were.
    """

    parts: PartVoxels
    parents: tuple[int, ...]
    field: MaterialField
    choices: tuple[PartChoice, ...]
    unbound: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    regions: Numbered | None = None

    @classmethod
    def of(
        cls,
        parts: PartVoxels,
        choices: Sequence[PartChoice],
        sentence: Sentence,
        *,
        alpha: float | None = None,
    ) -> Prediction:
        """Return the choices for the given parts as they are, with the field of their values."""
        field = field_of(parts, choices, alpha=alpha)
        unbound = unbound_by(choices, sentence.clauses)
        return cls(parts, tuple(range(len(choices))), field, tuple(choices), unbound)

    def with_choices(self, choices: Mapping[int, PartChoice]) -> Prediction:
        """Return the same with other materials for some of the parts, by number."""
        chosen = tuple(choices.get(i, choice) for i, choice in enumerate(self.choices))
        field = field_of(self.parts, chosen, alpha=self.field.alpha)
        other = np.isin(self.parts.part, list(choices), invert=True)
        kept = {k: np.where(other, getattr(self.field, k), getattr(field, k)) for k in FIELDS}
        return replace(self, choices=chosen, field=replace(field, **kept))

    def doubts(self) -> Iterator[str]:
        """Sentences about what was guessed rather than known."""
        from .text.parts import parts_called

        yield from self.warnings
        # What is taken, and whether it is nu alone -> the parts that have it
        guesses: dict[tuple[str, str, bool], list[str]] = {}
        looked_up = (c for c in self.choices if not (c.borrowed or c.binding))
        own = {id(choice.clause): choice.clause.text for choice in looked_up if choice.clause}
        clauses = {
            id(choice.clause): choice.clause for choice in self.choices if choice.clause
        }.values()
        for choice in self.choices:
            unsaid = choice.network and choice.binding and choice.binding.clause is None
            unsaid = unsaid or any(  # "everything is plastic except the legs"
                choice.binding and choice.binding.clause == clause.text
                and parts_called(name, [[choice.part]])
                for clause in clauses for name in clause.subject.exceptions
            )  # fmt: skip
            foreign = choice.borrowed and id(choice.clause) in own
            # A network may give a part what is said of another by its name.
            foreign |= choice.binding is not None and choice.binding.clause in own.values()
            say = Note("prediction.say_text", part=choice.part)
            yield from choice.warnings
            guess = choice.guessed or choice.weight < GUESS or unsaid or foreign
            values = {"part": choice.part, "material": choice.material, "say": say}
            said = choice.clause.text if choice.clause else ""
            if choice.elsewhere and len(self.choices) > 1:
                if choice.part.lower() in said.lower():
                    continue  # "a round of brie" of a part "brie"
                yield Note("prediction.part_called", said=said, **values)
            elif choice.understood and guess and choice.by_words:
                values = {"part": choice.part, "material": choice.material, "said": said}
                yield Note("prediction.by_words", **values)
            elif choice.understood and guess:
                taken = Note("prediction.guessed") if choice.network else "taken as"
                stated = {"E", "rho"} <= {*choice.exact}
                guesses.setdefault((taken, choice.material, stated), []).append(choice.part)
        for (taken, material, stated), of in guesses.items():
            parts = f"part{'s' * (len(of) > 1)} {', '.join(map(repr, of))}"
            say = Note("prediction.say_text", part=of[0])
            values = {"parts": parts, "taken": taken, "material": material, "say": say}
            yield Note("prediction.nu_of" if stated else "prediction.nothing_names", **values)
        pieces_of = Counter(self.parents)
        for parent in sorted(i for i, count in pieces_of.items() if count > 1):
            of = [i for i, p in enumerate(self.parents) if p == parent]
            names = ", ".join(repr(self.parts.part_names[i]) for i in of)
            own = [b.certainty for i in of if (b := self.choices[i].binding) and b.certainty]
            yield Note("prediction.part_asset", pieces=names, divided=own[0] if own else DIVIDED)
        # What is said of no part may be of those that have no words of their own
        loose = [c for c in self.choices if not c.clause or c.borrowed or c.guessed or c.binding]
        for clause in self.unbound:
            if loose:
                parts = ", ".join(repr(choice.part) for choice in loose)
                yield Note("prediction.part_found", clause=clause, parts=parts)
            else:
                stated = Note("prediction.numbers_idle", clause=clause)
                idle = Note("prediction.part_idle", clause=clause)
                yield stated if _STATED.search(clause) else idle

    def for_each(self, parts: PartVoxels, first: Sequence[int]) -> Prediction:
        """Give each part the answer, and the pieces, of the ``first`` part that it is like."""
        if list(first) == sorted(set(first)):
            return self
        of_piece = self.parts.part
        label = np.full_like(of_piece, -1)
        pieces = [np.unique(of_piece[parts.part == i]).tolist() or [k] for i, k in enumerate(first)]
        pairs = [(i, own[0]) for i, own in enumerate(pieces)]  # a part, a piece of the answer
        pairs += [(i, piece) for i, own in enumerate(pieces) for piece in own[1:]]
        for number, (part, piece) in enumerate(pairs):
            label[(parts.part == part) & (of_piece == piece)] = number
        names = tuple(
            parts.part_names[part]
            + self.parts.part_names[piece].removeprefix(parts.part_names[first[part]])
            for part, piece in pairs
        )
        parents = tuple(part for part, _ in pairs)
        divided = PartVoxels(parts.grid, label, names, tuple(parts.labels[i] for i in parents))
        choices = (replace(self.choices[k], part=n) for (_, k), n in zip(pairs, names, strict=True))
        field = replace(self.field, part=label, part_names=names)
        return replace(self, parts=divided, parents=parents, field=field, choices=tuple(choices))


def unbound_by(choices: Sequence[PartChoice], clauses: Sequence[Clause]) -> tuple[str, ...]:
    """Clauses that say something of parts and that no choice follows, nor an option repeats."""
    texts = [choice.clause.text for choice in choices if choice.clause]
    texts += [c.binding.clause for c in choices if c.binding and c.binding.clause]
    followed = "\n".join(texts).lower()
    named = (
        c for c in clauses
        if c.says_matter and (c.subject.scope == "parts" or (c.subject.scope == "none" and (
            c.material or c.unknown or c.numbers or c.stiffness or c.density or not c.excluded
        )))
    )  # fmt: skip
    return tuple(clause.text for clause in named if clause.text.lower() not in followed)


def field_of(
    parts: PartVoxels, choices: Sequence[PartChoice], *, alpha: float | None = None
) -> MaterialField:
    """Return the field that gives every cell the values and ranges of its part's material."""
    names = sorted({choice.material for choice in choices})
    cell = np.where(parts.occupied, parts.part, 0)

    def of_parts(values: Iterable) -> np.ndarray:
        return np.array(list(values))[cell]

    E, nu, rho = (of_parts(getattr(choice.value, name) for choice in choices) for name in FIELDS)
    ranges = [of_parts(tuple(getattr(choice.row, name)) for choice in choices) for name in FIELDS]
    material = of_parts(names.index(choice.material) for choice in choices)
    return MaterialField(
        parts.grid, parts.occupied, E, nu, rho, part=parts.part, part_names=parts.part_names,
        material=np.where(parts.occupied, material, -1), material_names=tuple(names),
        ranges=Ranges(*ranges), alpha=alpha,
    )  # fmt: skip

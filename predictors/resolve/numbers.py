"""Numbers that are said of a part: they win over the table, exactly."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from ...fem.errors import UsageError
from ...fem.note import Note
from ...fem.table import (
    CATEGORIES,
    FIELDS,
    NU_CAP,
    Material,
    MaterialTable,
    MaterialValue,
    Span,
    material_of_values,
)
from ..prediction import PartChoice
from ..text.numerals import DATA, POWDERS, Blend, Quantity, wall_named

# E, nu and rho from what is said in place of them: hardness, infill, a second matter.
#
# Every relation is a published one; each says how it was used, in words for the user.

GENT_RANGE = (20.0, 80.0)  # Shore A: where Gent's relation was measured
QI_RANGE_D = (30.0, 85.0)  # Shore D, the same of Qi, Joyce and Boyce
RUBBER_NU = 0.49  # of solid elastomers: nearly incompressible
# Orientation efficiency of injection-moulded bars along the flow: .6 to .7 in Thomason and Vlug,
# Composites A 27 (1996).
ALONG = 0.65


class Derived(NamedTuple):
    """A value that was computed, and the sentence that says how."""

    value: float
    how: str


class Fibre(NamedTuple):
    """E [Pa], rho [kg/m^3] and length over diameter [1] of a reinforcement."""

    E: float
    rho: float
    aspect: float


# Hull and Clyne, An Introduction to Composite Materials, table 2.1; the aspect ratio of short
# fibres after moulding, 0.2-0.4 mm over 10-14 um, is that of Thomason, Composites A 33 (2002).
FIBRES = {
    "glass": Fibre(72e9, 2550.0, 20.0),
    "carbon": Fibre(230e9, 1780.0, 25.0),
    "aramid": Fibre(130e9, 1450.0, 25.0),
}


def modulus_of_shore_a(hardness: float) -> Derived:
    """E [Pa] of an elastomer of a hardness on Shore's scale A: Gent, Rubber Chem. Tech. 31 (1958).

    E = .0981 (56 + 7.62336 S) / (.137505 (254 - 2.54 S)) MPa.
    """
    E = 1e6 * 0.0981 * (56 + 7.62336 * hardness) / (0.137505 * (254 - 2.54 * min(hardness, 99.0)))
    low, high = GENT_RANGE
    inside = "" if low <= hardness <= high else Note("numbers.outside", low=low, high=high)
    return Derived(E, Note("numbers.mpa_shore", e=E / 1e6, hardness=hardness, inside=inside))


def modulus_of_shore_d(hardness: float) -> Derived:
    """E [Pa] of a hardness on Shore's scale D: Qi, Joyce, Boyce, Rubber Chem. Tech. 76 (2003).

    log10 E = .0235 (S + 50) - .6403, E in MPa.
    """
    E = 1e6 * 10 ** (0.0235 * (hardness + 50) - 0.6403)
    low, high = QI_RANGE_D
    inside = "" if low <= hardness <= high else Note("numbers.outside", low=low, high=high)
    return Derived(E, Note("numbers.mpa_shore_qis", e=E / 1e6, hardness=hardness, inside=inside))


USUAL_SKIN = 0.8e-3  # m: two lines of .4 mm and four layers of .2 mm, where a text says no more


def of_infill(solid: MaterialValue, share: float, skin: float = 0.0) -> tuple[MaterialValue, str]:
    """Value of a print filled to ``share`` (0, 1] inside a solid ``skin`` of so much of its volume.

    Gibson and Ashby's open cells inside, E ~ share^2; skin and inside bear side by side.
    """
    E = solid.E * (skin + (1 - skin) * share**2)
    value = solid._replace(E=E, rho=solid.rho * (skin + (1 - skin) * share))
    how = Note("numbers.infill_pa", share=share, skin=skin, e=value.E, rho=value.rho)
    return value, how


def hollowed(solid: MaterialValue, share: float) -> tuple[MaterialValue, str]:
    """Value of a thing of which walls that bear along it fill a ``share``: the rule of mixtures."""
    value = solid._replace(E=share * solid.E, rho=share * solid.rho)
    return value, Note("numbers.hollow", share=share, e=value.E, rho=value.rho)


def _volume_share(share: float, rho: float, matrix: MaterialValue) -> float:
    """Share of the volume that a ``share`` of the mass has, of a matter of a density in another."""
    return share / rho / (share / rho + (1 - share) / matrix.rho)


def with_fibres(matrix: MaterialValue, fibre: str, share: float) -> tuple[MaterialValue, str]:
    """Value of a moulded matter with short fibres of a ``share`` of its mass; nu stays.

    Cox and Krenchel: E = orientation length V E_f + (1 - V) E_m with the efficiencies of
    Thomason's moulded bars and of Cox's shear lag; volumes for the density.
    """
    kind = FIBRES[fibre]
    if share <= 0:
        return matrix, ""
    volume = _volume_share(share, kind.rho, matrix)
    lag = 2 * matrix.E / (kind.E * (1 + matrix.nu) * math.log(1 / volume))
    x = math.sqrt(lag) * kind.aspect
    length = 1 - math.tanh(x) / x
    E = ALONG * length * volume * kind.E + (1 - volume) * matrix.E
    value = matrix._replace(E=E, rho=volume * kind.rho + (1 - volume) * matrix.rho)
    how = Note("numbers.short_fibres", share=share, fibre=fibre, e=value.E, rho=value.rho)
    return value, how


def with_powder(matrix: MaterialValue, powder: str, share: float) -> tuple[MaterialValue, Note]:
    """Value of a matter with grains of a ``share`` of its mass.

    Halpin and Tsai, Polymer Eng. Sci. 16 (1976), with 2 for the shape of spheres; volumes for nu
    and the density.
    """
    grain = POWDERS[powder]
    volume = _volume_share(share, grain["rho"], matrix)
    stiffer = (grain["E"] - matrix.E) / (grain["E"] + 2 * matrix.E)
    value = matrix._replace(
        E=matrix.E * (1 + 2 * stiffer * volume) / (1 - stiffer * volume),
        nu=volume * grain["nu"] + (1 - volume) * matrix.nu,
        rho=volume * grain["rho"] + (1 - volume) * matrix.rho,
    )
    return value, Note("numbers.powder", share=share, powder=powder, e=value.E, rho=value.rho)


ELASTIC = 1e8  # Pa: what a hardness makes softer than this is an elastomer, and keeps its volume

HARDNESSES = (("shore_a", modulus_of_shore_a), ("shore_d", modulus_of_shore_d))
UNSHORED = ("metal", "glass-ceramic", "stone", "wood")  # no scale of Shore's A or D is for these

SAME = 1.02  # two numbers that differ by less are one, in another unit and rounded

# E of a rigid foam goes with this power of rho: between the square of its edges and the line of its
# faces (Gibson and Ashby). Ends of rows: 1.6 (PVC, EPS), 1.3 (PMI), 1.5 and 1.8 (PU), 3.7 (XPS).
CELLS, POWER = ("rigid foam", "structural foam"), 1.5

STRONGEST = 4e9  # Pa: a stress that metals bear at most, music wire; their E is twice that and more

SOLID = ("metal", "glass-ceramic")  # a third of their density is a slip rather than cells

ODD = 10.0  # how far beyond the range of a row that is named an E that is said is hardly meant
ODD_METAL = 1.25  # of a metal, which alloying and heat change little

GRADES = 1.15  # how far beyond the table's range the density of a solid's grade may lie

BESIDE = 2.0  # how far beyond the table's range a grade of the same name may lie

# What a linear isotropic solid can have at all: E [Pa], nu [1], rho [kg/m^3].
SETTABLE = {"E": (0.0, math.inf), "nu": (-1.0, 0.5), "rho": (0.0, math.inf)}


class Said(NamedTuple):
    """A value after all numbers, how it came about, what to tell, and what of it is ``exact``."""

    value: MaterialValue
    derivation: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    exact: tuple[str, ...] = ()


def with_numbers(
    part: str,
    row: Material,
    value: MaterialValue,
    numbers: Sequence[Quantity],
    *,
    blend: Blend | None = None,
    volume: float = 0.0,
    named: bool = False,
    within: Callable[[float], float] | None = None,
) -> Said:
    """Return a row's value with all that was said in numbers.

    A second matter and infill move what the table has, a hardness gives E; E, nu and rho come out
    as they were said. ``volume`` [m^3] turns a mass into a density; ``within`` gives the share of
    the part's volume that lies so deep [m] below its surface at most, for the skin of a print.
    Beside a row that is ``named`` a mass, or a pressure that no word calls a modulus, must be of
    such matter, or it is told.
    """
    how: list[str] = []
    warnings: list[str] = []
    said, weighed = _one_each(part, numbers, warnings), False
    stress = said.get("E")
    # "foam core 0.11 GPa / 100 kg/m3", "porous titanium 3 GPa, 1.8 g/cm3", "PU 0.9 GPa, 1.1 g/cm3"
    weighed_too = "rho" in said and (
        row.category.endswith("foam") or not _near(row.rho, said["rho"].value)
        or bool(stress and row.category != "metal" and "GPa" in stress.text)
    )  # fmt: skip
    if named and stress and not (stress.called or weighed_too or _near(row.E, stress.value)):
        span = row.E._asdict()
        strength = row.category == "metal" and stress.value < STRONGEST
        told = {"part": part, "text": stress.text, "name": row.name, **span}
        warnings.append(
            Note("numbers.part_strength" if strength else "numbers.part_modulus", **told)
        )
        del said["E"]
    if blend is not None:
        rows = {"CFRP (along fibre)": "carbon", "E-glass fibre": "glass"}  # of the words for them
        fibre = rows.get(blend.material)
        known = fibre or blend.material in POWDERS
        if not known or row.category == "metal":  # "flange CF63 1.4404"
            warnings.append(Note("numbers.part_changes_known", part=part, **vars(blend)))
        else:
            value, line = (
                with_fibres(value, fibre, blend.share) if fibre
                else with_powder(value, blend.material, blend.share)
            )  # fmt: skip
            how.append(line)
    for measure, relation in HARDNESSES:
        if measure in said and row.category in UNSHORED:
            told = {"part": part, "text": said[measure].text, "name": row.name}
            warnings.append(Note("numbers.part_hardness", **told))
        elif measure in said:
            E, line = relation(said[measure].value)
            value = value._replace(E=E, nu=RUBBER_NU if E < ELASTIC else value.nu)
            how.append(line)
    if "infill" in said:
        skin = said["skin"].value if "skin" in said else USUAL_SKIN
        value, line = of_infill(value, said["infill"].value, within(skin) if within else 0.0)
        how.append(line)
    if "void" in said:
        share = 1 - said["void"].value
        if _CELLULAR.search(row.name):  # its values have cells already, and of how much is unknown
            warnings.append(Note("numbers.part_void", part=part, text=said["void"].text))
        else:
            if _HOLLOW.search(said["void"].text):
                value, line = hollowed(value, share)
            else:
                value, _ = of_infill(value, share)
                line = Note("numbers.void", share=share, e=value.E, rho=value.rho)
            how.append(line)
    if "mass" in said:
        before = value
        value = _of_mass(part, row, value, said["mass"], volume, how, warnings, named=named)
        weighed = value != before
    if "thickness" in said and not wall_named(part, [said["thickness"]]):
        warnings.append(Note("numbers.part_changes", part=part, text=said["thickness"].text))
    exact = {name: said[name].value for name in ("E", "nu", "rho") if name in said}
    if row.category in CELLS and "rho" in exact and "E" not in exact:
        value = value._replace(E=value.E * (exact["rho"] / value.rho) ** POWER, rho=exact["rho"])
        how.append(Note("numbers.by_density", rho=exact["rho"], e=value.E))
    dense = exact.get("rho", row.rho.min)
    if named and not _near(row.rho, dense):
        solid, low, high = value.rho, *row.rho
        odd = {"part": part, "text": said["rho"].text, "name": row.name, "low": low, "high": high}
        if dense < solid and "E" not in exact and row.category not in SOLID:
            value, _ = of_infill(value, dense / solid)
            how.append(Note("numbers.cells", share=dense / solid, e=value.E))
            warnings.append(Note("numbers.part_porous", **odd, e=value.E))
        else:
            warnings.append(Note("numbers.part_density", **odd))
    far = ODD_METAL if row.category == "metal" else ODD
    if named and "E" in exact and not row.E.min / far < exact["E"] < row.E.max * far:
        odd = {"part": part, "text": said["E"].text, "name": row.name, **row.E._asdict()}
        warnings.append(Note("numbers.part_odd", **odd))
    if exact:
        how.append(", ".join(said[name].text for name in exact) + " as said")
    value = value._replace(**exact)
    if not -1 < value.nu < 0.5:  # a solver takes no other
        kept = NU_CAP if value.nu >= 0.5 else -0.99
        warnings.append(Note("numbers.part_nu", part=part, nu=value.nu, kept=kept))
        value = value._replace(nu=kept)
    stated = tuple(name for name in FIELDS if name in exact or (weighed and name == "rho"))
    return Said(value, tuple(how), tuple(warnings), stated)


def as_stated(choice: PartChoice) -> PartChoice:
    """Settle a choice whose E, nu and rho are all stated: a guessed row is none any more."""
    if not choice.guessed:
        return replace(choice, settled=True)
    row, why = material_of_values(choice.value), choice.derivation[-1]
    return replace(choice, row=row, why=why, weight=1.0, settled=True, guessed=False, doubts=())


def may_have(row: Material, numbers: Sequence[Quantity]) -> bool:
    """Whether a row may have what numbers say: E and rho near its own."""
    said = {number.measure: number.value for number in numbers}
    hardness = _modulus_of_hardness(numbers)
    if hardness is not None:
        said.setdefault("E", hardness)
    return all(_near(getattr(row, name), said[name]) for name in ("E", "rho") if name in said)


# Plastics that are foam where they are said to weigh less than half of themselves; the first is the
# soft one, the last the stiff.
FOAMED = {
    "thermoplastic polyurethane (TPU)": ("flexible PU foam", "rigid PU foam"),
    "polyurethane casting resin": ("rigid PU foam",),
    "polyurethane rubber": ("flexible PU foam", "rigid PU foam"),
    "polyethylene (generic)": ("polyethylene foam",),
    "LDPE": ("polyethylene foam",),
    "polypropylene": ("expanded polypropylene foam",),
    "polystyrene": ("EPS foam",),
    "rigid PVC": ("PVC foam core",),
    "PET": ("PET foam core",),
    "phenolic": ("phenolic foam",),
    "flexible PU foam": ("flexible PU foam", "rigid PU foam"),
    "calcium silicate board": ("calcium silicate insulation board",),
}


_CELLULAR = re.compile(r"^sintered (?!silicon)| foam\b.*| \(oil-retaining\)|^hollow | block$")
_HOLLOW = re.compile(DATA["hollow"]["void"])


def row_by_numbers(
    row: Material, table: MaterialTable, numbers: Sequence[Quantity], stiffness: int | None
) -> Material:
    """The row of a plastic's foam where its density says so, and of silicone by its hardness."""
    said = {number.measure: number.value for number in numbers}
    light = said.get("rho", math.inf) < row.rho.min / BESIDE or (stiffness or 0) > 3
    if row.name in FOAMED and "rho" in said and light:
        return table.exact(FOAMED[row.name][-1 if (stiffness or 0) > 3 else 0])
    dense = table.phrases.get(f"{row.name.lower()}, dense")
    if dense and dense.rho.min <= said.get("rho", 0.0) <= dense.rho.max:
        return dense
    if "void" in said:  # "aluminium foam, 85 % porosity" is aluminium with so much air
        return table.phrases.get(_CELLULAR.sub("", row.name).lower(), row)
    if row.name.startswith("silicone rubber") and "shore_a" in said:
        degree = f"{round(said['shore_a'], -1):.0f}"
        graded = ("silicone", degree)
        return next((x for x in table if (*x.name.split(" Shore A"),) == graded), row)
    return row


def rubber_of(rows: Sequence[Material], numbers: Sequence[Quantity]) -> Material | None:
    """The rubber of the table that is nearest to a hardness that is said, None without one."""
    E = _modulus_of_hardness(numbers)
    if E is None or E >= ELASTIC:
        return None
    rubbers = (row for row in rows if row.name.startswith("rubber Shore"))
    return min(rubbers, key=lambda row: abs(math.log(row.value().E / E)), default=None)


def _modulus_of_hardness(numbers: Sequence[Quantity]) -> float | None:
    """E [Pa] of a hardness among what is said, None without one."""
    hard = (
        relation(number.value).value
        for name, relation in HARDNESSES
        for number in numbers
        if number.measure == name
    )
    return next(hard, None)


def _one_each(part: str, numbers: Sequence[Quantity], warnings: list[str]) -> dict[str, Quantity]:
    """The number of each measure; of those that differ one that a word calls so, else none."""
    chosen: dict[str, Quantity] = {}
    for measure in dict.fromkeys(number.measure for number in numbers):
        found = [number for number in numbers if number.measure == measure]
        called = [number for number in found if number.called] or found
        values = [number.value for number in called]
        others = [q for q in found if not q.value / SAME <= values[0] <= q.value * SAME]
        texts = ", ".join(repr(number.text) for number in others)
        if max(values) > SAME * min(values):
            twice = {"part": part, "measure": measure, "text": called[0].text, "texts": texts}
            warnings.append(Note("numbers.part_said", **twice))
            continue
        chosen[measure] = called[0]
        if others:
            warnings.append(
                Note("numbers.part_beside", part=part, texts=texts, text=called[0].text)
            )
    return chosen


def _of_mass(
    part: str,
    row: Material,
    value: MaterialValue,
    mass: Quantity,
    volume: float,
    how: list[str],
    warnings: list[str],
    *,
    named: bool,
) -> MaterialValue:
    """Density of a mass over the volume; where no matter of the kind has it, the row's, told."""
    if not volume > 0:
        warnings.append(Note("numbers.part_used", part=part, text=mass.text))
        return value
    rho = mass.value / volume
    low, high = CATEGORIES[row.category].rho
    if low <= rho <= high and (not named or _near(row.rho, rho)):
        how.append(Note("numbers.rho_kg", rho=rho, text=mass.text, volume=volume))
        if (
            named
            and row.category in SOLID
            and not row.rho.min / GRADES < rho < row.rho.max * GRADES
        ):
            odd = {"part": part, "text": mass.text, "volume": volume, "rho": rho}
            warnings.append(Note("numbers.part_mass", **odd, name=row.name, **row.rho._asdict()))
        return value._replace(rho=rho)
    if row.category.endswith("foam") and _near(row.rho, mass.value):  # as foams are sold: "35 kg"
        how.append(Note("numbers.foam_rho", text=mass.text, rho=mass.value))
        return value._replace(rho=mass.value)
    what, (low, high) = (row.name, row.rho) if named else (row.category, (low, high))
    over = {"part": part, "text": mass.text, "volume": volume, "rho": rho, "what": what}
    warnings.append(Note("numbers.part_over", **over, low=low, high=high))
    return value


def _near(span: Span, value: float) -> bool:
    """Whether a value may be of matter whose rows lie in ``span``: within twice its ends."""
    return span.min / BESIDE <= value <= span.max * BESIDE


def numbers_of_parts(options: Sequence[str]) -> dict[str, dict[str, float]]:
    """Split PART:E=2e9,nu=.3,rho=1100 options into numbers by part; a wrong one is an error."""
    found: dict[str, dict[str, float]] = {}
    for option in options:
        name, colon, rest = option.rpartition(":")
        items = [item.partition("=") for item in rest.split(",")]
        if not (colon and name.strip()) or {key.strip() for key, *_ in items} - set(FIELDS):
            raise UsageError("numbers.wanted_part", option=option)
        try:
            numbers = {key.strip(): float(value) for key, _, value in items}
        except ValueError as error:
            raise UsageError("numbers.wanted_numbers", option=option, error=error) from error
        for field, (low, high) in SETTABLE.items():
            if field in numbers and not low < numbers[field] < high:
                raise UsageError("numbers.must_lie", key=field, low=low, high=high, option=option)
        found.setdefault(name.strip(), {}).update(numbers)
    return found

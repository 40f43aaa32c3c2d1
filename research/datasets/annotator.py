"""Texts and values of an object's parts from a language model behind an OpenAI-compatible endpoint.

The model's answer is data of unknown quality: JSON alone is read, every part needs a value inside
physical bounds, cross-part constraints go through the safe evaluator, and what fails is counted
with its reason, never repaired.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from ...fem.errors import AutophyxError, InputError
from ...fem.table import NU_CAP, MaterialValue
from ...predictors.text.interpreter import ChatEndpoint
from .constraints import holds

# E [Pa] from the softest gel to beyond diamond, rho [kg/m^3] from aerogel to beyond osmium.
E_BOUNDS, RHO_BOUNDS = (1e1, 2e12), (0.5, 3e4)
_PROMPT = """You describe materials of 3D objects for a physics simulation.
Object: {object}. Parts: {parts}.
Write {count} different variants. Each has a "text" (one or two sentences that say what the parts
are made of, or how stiff or heavy they are), "parts" (for every part E in Pa, nu, rho in kg/m^3
that agree with the text), and "constraints" (comparisons between parts that hold, such as
"pot.E > trunk.E"; may be empty). Answer with JSON alone: {{"variants": [{{"text": "...", "parts":
{{"PART": {{"E": 1e9, "nu": 0.3, "rho": 1000}}}}, "constraints": []}}]}}"""


class Variant(NamedTuple):
    """One text with the value of every part."""

    text: str
    values: dict[str, MaterialValue]


class Annotation(NamedTuple):
    """What the model gave that holds, and why the rest was left out."""

    variants: list[Variant]
    rejected: list[str]


@dataclass(frozen=True)
class Annotator:
    """Asks a language model."""

    endpoint: ChatEndpoint

    def annotate(self, name: str, parts: Sequence[str], *, count: int = 8) -> Annotation:
        """Ask for ``count`` variants of an object with these parts."""
        prompt = _PROMPT.format(object=name, parts=", ".join(parts), count=count)
        variants = self.endpoint.ask(prompt).get("variants")
        if not isinstance(variants, list):
            raise InputError(
                f"{self.endpoint.model} answered no JSON object with a list of variants: "
                "ask another model"
            )
        good, rejected = [], []
        for number, variant in enumerate(variants):
            try:
                good.append(_variant(variant, parts))
            except AutophyxError as error:
                rejected.append(f"variant {number + 1}: {error}")
        return Annotation(good, rejected)


def _variant(variant: Any, parts: Sequence[str]) -> Variant:
    """Check one variant of the model's answer."""
    if not isinstance(variant, Mapping) or not isinstance(variant.get("text"), str):
        raise InputError("no text")
    given = variant.get("parts")
    if not isinstance(given, Mapping) or set(given) != set(parts):
        raise InputError(f"values for {given if given is None else list(given)}, wanted {parts}")
    values = {name: _value(name, given[name]) for name in parts}
    for constraint in variant.get("constraints") or ():
        if not holds(str(constraint), values):
            raise InputError(f"its own constraint {constraint!r} does not hold")
    return Variant(variant["text"], values)


def _value(part: str, numbers: Any) -> MaterialValue:
    try:
        value = MaterialValue(*(float(numbers[name]) for name in ("E", "nu", "rho")))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{part}: no numbers E, nu and rho ({error})") from error
    inside = (
        E_BOUNDS[0] <= value.E <= E_BOUNDS[1]
        and 0 <= value.nu <= NU_CAP
        and RHO_BOUNDS[0] <= value.rho <= RHO_BOUNDS[1]
    )
    if not (inside and all(map(math.isfinite, value))):
        raise InputError(f"{part}: {value} lies outside E {E_BOUNDS} Pa, nu 0 .. {NU_CAP}, rho "
                         f"{RHO_BOUNDS} kg/m^3")  # fmt: skip
    return value

"""Loads that a text speaks of: its words set none, so that they are told with what does."""

from __future__ import annotations

import re
from typing import NamedTuple

_WHO = r"person|people|man|woman|child|kid|adult|rider|passenger|somebody|someone"
_MASS = r"\d\s*(?:kg|lbs?|pounds?|tons?|tonnes?)"
# What bears on a thing, by a unit that no material has, by who or what does it, or by the deed.
# "Stands on", "hangs from", "pressed" say more of supports and of matter: they are not among them.
_LOADS = re.compile(
    rf"""
    (?<![\w.])(?:\d[\d.,]+|[\d.,]+\s)\s*(?:k?N|[Nn]ewtons?|kgf|lbf|m/s|km/h|mph|knots)\b(?![/*²^])
    | [\d.,]*{_MASS}\s+(?:\w+\s+)?(?:{_WHO})\b
    | \b(?:an?|the|one|two|three|four)\s+(?:\w+\s+)?(?:{_WHO})\s+
      (?:who\s+)?(?:sit|stand|jump|lie|ride|swing)\w*
    | \b(?:is|are|being|gets?)\s+(?:sat|stood|stepped|jumped)\s+(?:up)?on\b
    | [\d.,]*{_MASS}\b(?!\s+of\b|/)[^,;]*?\s(?:on|onto)\s+(?:it|top|the|each|its)\b
    | \b(?:carr(?:y|ies|ying)|bear(?:s|ing)?|support(?:s|ing)?)\s+
      (?:up\s+to\s+|about\s+)?[\d.,]*{_MASS}\b
    | \b(?:dropped|drops|falls|falling|thrown|tossed)\s+(?:\w+\s+)?(?:from|off|onto|down|on|at)\b
    | \b(?:strong|heavy|high|gentle|light)\s+winds?\b | \bgusts?\b
    | \bwind\s+(?:of|blows?|blowing|loads?)\b
    | \b(?:push|pull|kick|squeez|shak)(?:e[ds]?|es|ed|ing|s)?\s+
      (?:\w+\s+)?(?:by|with|at|from|down|sideways|on)\b
    | \b(?:loads?|forces?|pressure|torque)\s+of\s+\d
    """,
    re.VERBOSE,
)
_END = re.compile(r"[;\n]|[,.](?=\s|$)|\s(?=and\b|but\b|while\b|which\b)|$")


class SaidLoad(NamedTuple):
    """Words of a text that speak of a load, and the place of those that tell it for one."""

    text: str
    start: int
    end: int


def loads_said(text: str) -> tuple[SaidLoad, ...]:
    """Phrases that speak of what bears on a thing, in their order, up to the next comma or stop."""
    found: list[SaidLoad] = []
    for match in _LOADS.finditer(text):
        end = _END.search(text, match.end())
        said = text[match.start() : end.start() if end else len(text)].strip()
        if found and found[-1].text.endswith(said):
            found[-1] = found[-1]._replace(end=match.end())
        else:
            found.append(SaidLoad(said, *match.span()))
    return tuple(found)


def without_loads(text: str) -> tuple[str, list[str]]:
    """The text with blanks for the words that tell loads, and a sentence for each load."""
    told = []
    for load in loads_said(text):
        text = text[: load.start] + " " * (load.end - load.start) + text[load.end :]
        told.append(
            f"{load.text!r} is a load, which the text does not set: --load part:NAME=x,y,z [N], "
            "or --scenario wind, poke or drop"
        )
    return text, told

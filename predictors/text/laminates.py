"""Laminates: "2x2 twill carbon prepreg" and "E-glass/epoxy, ±45" by fibre, lay-up and resin.

Whoever names a laminate says its fibre, how that lies and what binds it, in any order and with
grades, weights and forms between. ``data/laminates.toml`` has the words of each and the rows of
their combinations.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from .english import DATA

_JOIN = re.compile(r"[ \t/()+\-–]{0,3}|, ?")  # between the words of one laminate
# Words that behind a comma may begin something else: "glass, fabric seat"
_LOOSE = re.compile(r"(?i)mat|fabric|cloth|satin|tissue|braid(?:ed)?|forged|uni|45 ?(?:°|deg)")


_ALONE = (
    "intermediate",
    "high",
    "pitch",
    "grade",
    "k13d",
    "m40",
    "m46",
    "m55",
    "m60",
    "t1100",
)  # fibres that nobody uses without a resin


class Laminate(NamedTuple):
    """Where a text speaks of a laminate, and the names of rows to try for it in turn."""

    start: int
    end: int
    rows: Sequence[str]


class _Token(NamedTuple):
    kind: str  # fibre, lay, resin or between
    value: str
    start: int
    end: int


@lru_cache(maxsize=1)
def _data() -> tuple[re.Pattern, Mapping[str, str], Mapping[str, Any]]:
    """All words as one pattern, the kind and value of each of its groups, and the rows."""
    data = tomllib.loads((DATA / "laminates.toml").read_text(encoding="utf-8"))
    groups, patterns = {}, []
    for kind in ("fibre", "lay", "resin"):
        for value, pattern in data[kind].items():
            groups[f"{kind}_{value}"] = kind
            patterns.append(f"(?P<{kind}_{value}>{pattern})")
    patterns.append(f"(?P<between>{data['between']})")
    return re.compile(rf"(?<![\w.-])(?:{'|'.join(patterns)})(?!\w)"), groups, data["rows"]


def laminates(text: str) -> list[Laminate]:
    """The laminates of a text.

    >>> [text[a:b] for text in ["fins 2x2 twill carbon"] for a, b, _ in laminates(text)]
    ['2x2 twill carbon']
    >>> laminates("carbon steel"), laminates("UD carbon")[0].rows[0]
    ([], 'carbon/epoxy unidirectional (along fibre)')
    """
    return [found for run in _runs(text) if (found := _laminate(run))]


def _runs(text: str) -> Iterator[list[_Token]]:
    """Words of laminates that nothing else parts."""
    pattern, groups, _ = _data()
    run: list[_Token] = []
    for m in pattern.finditer(text):
        kind = groups.get(m.lastgroup or "", "between")
        value = (m.lastgroup or "").partition("_")[2] if kind != "between" else ""
        token = _Token(kind, value, m.start(), m.end())
        gap = text[run[-1].end : token.start] if run else ""
        kinds = {t.kind for t in run}
        joins = run and _JOIN.fullmatch(gap)
        if "," in gap:  # "carbon, 2x2 twill", but "carbon, glass" and "CSM, biax glass"
            joins = joins and kind == "lay" and "fibre" in kinds and not _LOOSE.fullmatch(m[0])
        elif "+" in gap:  # "kevlar + carbon hybrid", but "UD carbon + triax"
            joins = joins and not ({"lay", "resin"} & kinds and kind in ("fibre", "lay"))
        if not joins:
            yield run
            run = []
        run.append(token)
    yield run


def _laminate(run: Sequence[_Token]) -> Laminate | None:
    """What a run of words is of: a fibre with the way that it lies, or with a resin."""
    while run and run[-1].kind == "between":
        run = run[:-1]
    while run and run[0].kind == "between":
        run = run[1:]
    fibres = list(dict.fromkeys(t.value for t in run if t.kind == "fibre"))
    lays = [t.value for t in run if t.kind == "lay"]
    resins = [t.value for t in run if t.kind == "resin"]
    if not fibres or not (lays or resins or fibres[0] in _ALONE):
        return None
    rows = _data()[2]
    fibre = "_".join(sorted(fibres)) if "_".join(sorted(fibres)) in rows else fibres[0]
    known = rows[fibre]
    mixed = {"ud", "bias"} <= {*lays} and "quasi" in known
    lay = "quasi" if mixed else next((lay for lay in known if lay in lays), "")
    if not lay and lays and "plain" not in known:
        return None
    named = known[lay or "plain"]
    if isinstance(named, Mapping):  # by its resin
        named = next((named[r] for r in resins if r in named), named.get("other"))
    return Laminate(run[0].start, run[-1].end, [named]) if named else None

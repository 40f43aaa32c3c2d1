"""Constraints between parts ("pot.E > trunk.E"), read as data: a whitelist of syntax, no eval.

They are judged over whole ranges by interval arithmetic. Rounding keeps order, so that the ends of
an interval bound what any sample gives in the same floating-point numbers: no sample of a range
that a constraint holds for breaks it.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import NamedTuple

from ...fem.errors import UsageError
from ...fem.table import FIELDS, Band, MaterialValue, Span

_LONGEST = 500  # characters: longer than any sensible constraint, and a bound on the depth
_ALL = Span(-math.inf, math.inf)


class _Truth(NamedTuple):
    """Whether a comparison is met by every sample, and whether it may be met by one."""

    surely: bool
    maybe: bool


_ARITHMETIC: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_COMPARE: dict[type[ast.cmpop], Callable[[Span, Span], _Truth]] = {
    ast.Gt: lambda a, b: _Truth(a.min > b.max, a.max > b.min),
    ast.GtE: lambda a, b: _Truth(a.min >= b.max, a.max >= b.min),
    ast.Lt: lambda a, b: _Truth(a.max < b.min, a.min < b.max),
    ast.LtE: lambda a, b: _Truth(a.max <= b.min, a.min <= b.max),
}


def holds(constraint: str, values: Mapping[str, MaterialValue]) -> bool:
    """Whether a constraint such as "pot.E > 2 * trunk.E and pot.rho > 1000" is met.

    Names are parts, fields E [Pa], nu [1], rho [kg/m^3]; known are comparisons, and, or, not and
    + - * /. Anything else is a ``UsageError``.
    """
    points = {
        part: Band(*(Span(float(v), float(v)) for v in value)) for part, value in values.items()
    }
    return always_holds(constraint, points)


def always_holds(constraint: str, ranges: Mapping[str, Band]) -> bool:
    """Whether a constraint (see ``holds``) is met by every sample, each field drawn on its own.

    True is certain. False may be too strict where a constraint names one field twice.
    """
    if len(constraint) > _LONGEST:
        raise UsageError(f"constraint of {len(constraint)} characters: at most {_LONGEST} are read")
    try:
        tree = ast.parse(constraint, mode="eval")
    except SyntaxError as error:
        raise UsageError(f"constraint {constraint!r} cannot be read: {error.msg}") from error
    result = _value(tree.body, ranges, constraint)
    if not isinstance(result, _Truth):
        raise UsageError(f"constraint {constraint!r} compares nothing: wanted <, <=, > or >=")
    return result.surely


def _value(node: ast.AST, ranges: Mapping[str, Band], constraint: str) -> Span | _Truth:
    match node:
        case ast.BoolOp(op=op, values=terms):
            found = [_truth(term, ranges, constraint) for term in terms]
            judge = all if isinstance(op, ast.And) else any
            return _Truth(*map(judge, zip(*found, strict=True)))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            found = _truth(operand, ranges, constraint)
            return _Truth(not found.maybe, not found.surely)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARE:
            pair = (_number(side, ranges, constraint) for side in (left, right))
            return _COMPARE[type(op)](*pair)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            pair = (_number(side, ranges, constraint) for side in (left, right))
            return _combined(_ARITHMETIC[type(op)], *pair)
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return Span(float(number), float(number))
        case ast.Attribute(value=ast.Name(id=part), attr=field) if (
            part in ranges and field in FIELDS
        ):
            return Span(*getattr(ranges[part], field))
    raise UsageError(
        f"constraint {constraint!r}: {ast.unparse(node)!r} is not known; wanted parts "
        f"{', '.join(ranges)} with .E, .nu or .rho, numbers, + - * / and comparisons"
    )


def _truth(node: ast.AST, ranges: Mapping[str, Band], constraint: str) -> _Truth:
    found = _value(node, ranges, constraint)
    if isinstance(found, _Truth):
        return found
    raise UsageError(f"constraint {constraint!r}: {ast.unparse(node)!r} compares nothing")


def _number(node: ast.AST, ranges: Mapping[str, Band], constraint: str) -> Span:
    found = _value(node, ranges, constraint)
    if isinstance(found, Span):
        return found
    raise UsageError(f"constraint {constraint!r}: {ast.unparse(node)!r} is no number")


def _combined(of: Callable[[float, float], float], a: Span, b: Span) -> Span:
    """Every result of an operation on two intervals; unbounded where one is not defined."""
    if of is operator.truediv and b.min <= 0 <= b.max:
        return _ALL
    ends = [of(x, y) for x in a for y in b]
    return _ALL if any(map(math.isnan, ends)) else Span(min(ends), max(ends))

"""Constraints between parts ("pot.E > trunk.E"), read as data: a whitelist of syntax, no eval."""

from __future__ import annotations

import ast
import operator
from collections.abc import Mapping
from typing import Any

from ...fem.errors import UsageError
from ...fem.scene.materials import FIELDS, MaterialValue

_COMPARE = {
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
}
_ARITHMETIC = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_LONGEST = 500  # characters: longer than any sensible constraint, and a bound on the depth


def holds(constraint: str, values: Mapping[str, MaterialValue]) -> bool:
    """Whether a constraint such as "pot.E > 2 * trunk.E and pot.rho > 1000" is met.

    Names are parts, fields E [Pa], nu [1], rho [kg/m^3]; known are comparisons, and, or, not and
    + - * /. Anything else is a ``UsageError``.
    """
    if len(constraint) > _LONGEST:
        raise UsageError(f"constraint of {len(constraint)} characters: at most {_LONGEST} are read")
    try:
        tree = ast.parse(constraint, mode="eval")
    except SyntaxError as error:
        raise UsageError(f"constraint {constraint!r} cannot be read: {error.msg}") from error
    result = _value(tree.body, values, constraint)
    if not isinstance(result, bool):
        raise UsageError(f"constraint {constraint!r} compares nothing: wanted <, <=, > or >=")
    return result


def _value(node: ast.AST, values: Mapping[str, MaterialValue], constraint: str) -> Any:
    match node:
        case ast.BoolOp(op=op, values=terms):
            results = [_value(term, values, constraint) for term in terms]
            return all(results) if isinstance(op, ast.And) else any(results)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return not _value(operand, values, constraint)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARE:
            pair = (_value(side, values, constraint) for side in (left, right))
            return bool(_COMPARE[type(op)](*pair))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            pair = (_value(side, values, constraint) for side in (left, right))
            return _ARITHMETIC[type(op)](*pair)
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Attribute(value=ast.Name(id=part), attr=field) if (
            part in values and field in FIELDS
        ):
            return float(getattr(values[part], field))
    raise UsageError(
        f"constraint {constraint!r}: {ast.unparse(node)!r} is not known; wanted parts "
        f"{', '.join(values)} with .E, .nu or .rho, numbers, + - * / and comparisons"
    )

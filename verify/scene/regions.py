"""Regions and fields of the body as text: ``x < 0.01 and y > 0.5``, ``1e3 * (y - 0.5)``.

The text is parsed into a syntax tree of which only comparisons, ``and``/``or``/``not``,
arithmetic and a few functions are accepted; nothing is ever evaluated as Python.
"""

import ast
import operator
from collections.abc import Callable
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError

__all__ = ["RESERVED_NAMES", "Expression", "Region", "parse_expression", "parse_region"]

Array = NDArray[np.float64]
Region = Callable[[Array], NDArray[np.bool_]]
Expression = Callable[[Array], Array]

_LONGEST = 2000  # characters
_COORDINATES = ("x", "y", "z")
_ARITHMETIC = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_COMPARISONS = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_FUNCTIONS = {"abs": np.abs, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "hypot": np.hypot}
#: names that mean something in a formula
RESERVED_NAMES = {*_COORDINATES, *_FUNCTIONS, "t", "pi", "and", "or", "not"}
_MEANING = (
    "an inequality in x, y, z such as 'x < 0.01 and y > 0.5' "
    "(comparisons < <= > >=, and/or/not, + - * / **, abs sqrt sin cos hypot, pi)"
)
_FORMULA = "a formula in x, y, z such as '1e3 * (y - 0.5)' (+ - * / **, abs sqrt sin cos hypot, pi)"


def parse_region(text: str, dimension: int) -> Region:
    """Turn an inequality into a function of points.

    Parameters
    ----------
    text : str
        The inequality, in metres.
    dimension : int
        2 or 3: which of x, y, z may be named.

    Returns
    -------
    callable
        Maps points (n, dimension) to booleans (n,).

    Raises
    ------
    InputError
        If the text is not such an inequality; the message names the part that is not.

    Notes
    -----
    A comparison holds at no point where one of its sides is no finite number: 1/x > 10 not at
    x = 0, sqrt(x - 0.5) >= 0 not at x < 0.5. Such a number without x, y, z is an error.
    """
    _check_length(text)
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"'{text}' is not {_MEANING}") from None
    try:
        _check_condition(tree, text, dimension)
    except RecursionError:
        raise InputError(f"the inequality is nested too deep; expected {_MEANING}") from None

    def region(points: Array) -> NDArray[np.bool_]:
        with np.errstate(all="ignore"):
            values = _condition(tree, np.asarray(points, dtype=float))
        return np.broadcast_to(values, (len(points),)).astype(bool)

    return region


def parse_expression(text: str, dimension: int) -> Expression:
    """Turn a formula into a function of points.

    Parameters
    ----------
    text : str
        The formula; coordinates in metres.
    dimension : int
        2 or 3: which of x, y, z may be named.

    Returns
    -------
    callable
        Maps points (n, dimension) to values (n,). It raises InputError where a value is no finite
        number, and names the place.

    Raises
    ------
    InputError
        If the text is not such a formula; the message names the part that is not.
    """
    _check_length(text)
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        _check_number(tree, text, dimension, _FORMULA)
        _check_constants(tree, text)
    except InputError:
        raise
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"'{text}' is not {_FORMULA}") from None

    def expression(points: Array) -> Array:
        points = np.asarray(points, dtype=float)
        with np.errstate(all="ignore"):
            values = np.array(np.broadcast_to(_number(tree, points), (len(points),)))
        if not np.isfinite(values).all():
            place = points[np.argmin(np.isfinite(values))]
            at = ", ".join(f"{x:.4g}" for x in place)
            raise InputError(f"'{text}' is no finite number at ({at})")
        return values

    return expression


def _check_length(text: str) -> None:
    if len(text) > _LONGEST:
        raise InputError(f"has {len(text)} characters; expected at most {_LONGEST}")


def _reject(node: ast.AST, text: str, meaning: str = _MEANING) -> InputError:
    return InputError(f"'{ast.unparse(node)}' in '{text}' is not allowed; expected {meaning}")


def _check_condition(node: ast.AST, text: str, dimension: int) -> None:
    match node:
        case ast.BoolOp(values=values):
            for value in values:
                _check_condition(value, text, dimension)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            _check_condition(operand, text, dimension)
        case ast.Compare(left=left, ops=ops, comparators=comparators) if all(
            type(op) in _COMPARISONS for op in ops
        ):
            for value in (left, *comparators):
                _check_number(value, text, dimension)
                _check_constants(value, text)
        case _:
            raise _reject(node, text)


def _check_constants(node: ast.AST, text: str) -> None:
    """Refuse 1/0, sqrt(-1), 10**999: what holds no coordinate must be a finite number."""
    if any(isinstance(part, ast.Name) and part.id in _COORDINATES for part in ast.walk(node)):
        for part in node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node):
            if isinstance(part, ast.expr):
                _check_constants(part, text)
        return
    with np.errstate(all="ignore"):
        finite = np.isfinite(_number(node, np.empty((0, 0))))
    if not finite:
        raise InputError(f"'{ast.unparse(node)}' in '{text}' is no finite number")


def _check_number(node: ast.AST, text: str, dimension: int, meaning: str = _MEANING) -> None:
    match node:
        case ast.Constant(value=bool()):
            raise _reject(node, text, meaning)
        case ast.Constant(value=int() | float() as value) if abs(value) <= 1e300:
            pass
        case ast.Name(id=name) if name in (*_COORDINATES[:dimension], "pi"):
            pass
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check_number(operand, text, dimension, meaning)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            _check_number(left, text, dimension, meaning)
            _check_number(right, text, dimension, meaning)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if (
            name in _FUNCTIONS and len(arguments) == (2 if name == "hypot" else 1)
        ):
            for argument in arguments:
                _check_number(argument, text, dimension, meaning)
        case _:
            raise _reject(node, text, meaning)


def _condition(node: ast.AST, points: Array) -> NDArray[np.bool_]:
    match node:
        case ast.BoolOp(op=op, values=values):
            combine = np.logical_and if isinstance(op, ast.And) else np.logical_or
            return reduce(combine, (_condition(value, points) for value in values))
        case ast.UnaryOp(operand=operand):
            return np.logical_not(_condition(operand, points))
        case ast.Compare(left=left, ops=ops, comparators=comparators):
            terms = [_number(value, points) for value in (left, *comparators)]
            steps = zip(ops, terms[:-1], terms[1:], strict=True)
            holds = [_COMPARISONS[type(op)](a, b) for op, a, b in steps]
            return reduce(np.logical_and, holds + [np.isfinite(term) for term in terms])
    raise AssertionError(ast.dump(node))  # _check_condition lets nothing else through


def _number(node: ast.AST, points: Array) -> Array:
    match node:
        case ast.Constant(value=value):
            return np.float64(value)  # type: ignore[arg-type, return-value]
        case ast.Name(id="pi"):
            return np.float64(np.pi)  # type: ignore[return-value]
        case ast.Name(id=name):
            return points[:, _COORDINATES.index(name)]
        case ast.UnaryOp(op=op, operand=operand):
            inner = _number(operand, points)
            return -inner if isinstance(op, ast.USub) else inner
        case ast.BinOp(left=left, op=op, right=right):
            return _ARITHMETIC[type(op)](_number(left, points), _number(right, points))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _FUNCTIONS[name](*(_number(argument, points) for argument in arguments))
    raise AssertionError(ast.dump(node))  # _check_number lets nothing else through

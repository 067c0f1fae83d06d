"""Regions and fields of the body as text: ``x < 0.01 and y > 0.5``, ``1e3 * (y - 0.5) * t``.

The text is parsed into a syntax tree of which only comparisons, ``and``/``or``/``not``,
arithmetic and a few functions are accepted; nothing is ever evaluated as Python.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache, reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError

Array = NDArray[np.float64]
Region = Callable[[Array], NDArray[np.bool_]]
Side = Callable[[Array], Array]
_Variables = Mapping[str, Array]
_Term = Callable[[_Variables], tuple[Any, Any]]  # the value, and its derivative by the time

_LONGEST = 2000  # characters
_COORDINATES = ("x", "y", "z")
_TIME = "t"
_COMPARISONS = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
# by operator or name: the value, and its derivative from values and derivatives of what it is of
_Rule = tuple[Callable[..., Any], Callable[..., Any]]
_UNARY: dict[type | str, _Rule] = {
    ast.UAdd: (operator.pos, lambda a, da: da),
    ast.USub: (operator.neg, lambda a, da: -da),
    "abs": (np.abs, lambda a, da: _product(np.sign(a), da)),
    "sqrt": (np.sqrt, lambda a, da: _product(0.5 / np.sqrt(a), da)),
    "sin": (np.sin, lambda a, da: _product(np.cos(a), da)),
    "cos": (np.cos, lambda a, da: _product(-np.sin(a), da)),
}
_BINARY: dict[type | str, _Rule] = {
    ast.Add: (operator.add, lambda a, b, da, db: da + db),
    ast.Sub: (operator.sub, lambda a, b, da, db: da - db),
    ast.Mult: (operator.mul, lambda a, b, da, db: _product(b, da) + _product(a, db)),
    ast.Div: (
        operator.truediv, lambda a, b, da, db: _product(1 / b, da) - _product(a / b**2, db)
    ),
    ast.Pow: (
        operator.pow,
        lambda a, b, da, db: _product(b * a ** (b - 1), da) + _product(np.log(a) * a**b, db),
    ),
    "hypot": (np.hypot, lambda a, b, da, db: _product(1 / np.hypot(a, b), a * da + b * db)),
}  # fmt: skip
_FUNCTIONS = [name for name in (*_UNARY, *_BINARY) if isinstance(name, str)]
#: names that mean something in a formula
RESERVED_NAMES = {*_COORDINATES, *_FUNCTIONS, "t", "pi", "and", "or", "not"}
_MEANING = (
    "an inequality in x, y, z such as 'x < 0.01 and y > 0.5' "
    "(comparisons < <= > >=, and/or/not, + - * / **, abs sqrt sin cos hypot, pi)"
)
_FORMULA = "a formula in {variables} such as '{example}' (+ - * / **, abs sqrt sin cos hypot, pi)"


@lru_cache(maxsize=1024)  # a motion asks for the same ones in every step
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
    tree = _parsed(text, _MEANING)
    try:
        condition = _condition(tree, _Language(text, _COORDINATES[:dimension], _MEANING))
    except RecursionError:
        raise InputError(f"the inequality is nested too deep; expected {_MEANING}") from None

    def region(points: Array) -> NDArray[np.bool_]:
        with np.errstate(all="ignore"):
            values = condition(_variables(points, 0.0))
        return np.broadcast_to(values, (len(points),)).astype(bool)

    return region


def comparisons(text: str, dimension: int) -> list[tuple[Side, Side]]:
    """Return both sides of every comparison of an inequality that `parse_region` accepts.

    The region can only begin or end where the sides of one of them are equal. Where a side is no
    finite number, it is not a number.
    """
    parse_region(text, dimension)
    language = _Language(text, _COORDINATES[:dimension], _MEANING)
    found = []
    for node in ast.walk(_parsed(text, _MEANING)):
        if isinstance(node, ast.Compare):
            sides = [_side(_number(term, language)) for term in (node.left, *node.comparators)]
            found += list(pairwise(sides))
    return found


def is_affine(text: str) -> bool:
    """Whether the sides of all comparisons of an inequality are affine in x, y, z, by its form."""

    def varies(node: ast.AST) -> bool:
        return any(isinstance(n, ast.Name) and n.id in _COORDINATES for n in ast.walk(node))

    def bends(node: ast.AST) -> bool:
        match node:
            case ast.Call() | ast.BinOp(op=ast.Pow()):
                return varies(node)
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                return varies(left) and varies(right)
            case ast.BinOp(op=ast.Div(), right=right):
                return varies(right)
        return False

    return not any(bends(node) for node in ast.walk(_parsed(text, _MEANING)))


def _side(term: _Term) -> Side:
    def side(points: Array) -> Array:
        with np.errstate(all="ignore"):
            values = np.broadcast_to(term(_variables(points, 0.0))[0], (len(points),))
        return np.where(np.isfinite(values), values, np.nan)

    return side


class Expression:
    """A formula in the coordinates of a point, and perhaps in time.

    Parameters
    ----------
    text : str
        The formula; coordinates in metres, time t in seconds.
    dimension : int
        2 or 3: which of x, y, z may be named.
    timed : bool
        Whether t may be named.

    Raises
    ------
    InputError
        If the text is not such a formula; the message names the part that is not.
    """

    def __init__(self, text: str, dimension: int, timed: bool = False) -> None:
        names = (*_COORDINATES[:dimension], *((_TIME,) if timed else ()))
        example = "1e3 * (y - 0.5) * t" if timed else "1e3 * (y - 0.5)"
        meaning = _FORMULA.format(variables=", ".join(names), example=example)
        self._tree = _parsed(text, meaning)
        try:
            self._term = _term(self._tree, _Language(text, names, meaning))
        except RecursionError:
            raise InputError(f"'{text}' is not {meaning}") from None
        self.text = text

    @property
    def timed(self) -> bool:
        """Whether the formula names the time."""
        named = (part.id for part in ast.walk(self._tree) if isinstance(part, ast.Name))
        return _TIME in named

    def __call__(self, points: Array, time: float = 0.0) -> Array:
        """Values (n,) at points (n, d) and a time in s.

        Raises
        ------
        InputError
            Where a value is no finite number; the message names the place.
        """
        with np.errstate(all="ignore"):
            values = self._term(_variables(points, time))[0]
        return self._finite(values, points, "is no finite number")

    def rate(self, points: Array, time: float) -> Array:
        """Return the derivative (n,) by the time, 1/s, by the rules of differentiation.

        Raises
        ------
        InputError
            Where it is no finite number.
        """
        with np.errstate(all="ignore"):
            rates = self._term(_variables(points, time))[1]
        return self._finite(rates, points, f"has no finite rate at {time:.6g} s")

    def _finite(self, values: Array, points: Array, what: str) -> Array:
        found = np.array(np.broadcast_to(values, (len(points),)))
        if not np.isfinite(found).all():
            place = np.asarray(points)[np.argmin(np.isfinite(found))]
            at = ", ".join(f"{x:.4g}" for x in place)
            raise InputError(f"'{self.text}' {what} at ({at})")
        return found


@lru_cache(maxsize=1024)
def parse_expression(text: str, dimension: int, timed: bool = False) -> Expression:
    """Read a formula of the field of a body; see `Expression`."""
    return Expression(text, dimension, timed)


def _variables(points: Array, time: float) -> dict[str, Array]:
    columns = np.asarray(points, dtype=float).T
    named = dict(zip(_COORDINATES, columns, strict=False))
    return {**named, _TIME: np.float64(time)}


class _Language(NamedTuple):
    """What a text may say: it, the variables that it may name, and what it is meant to be."""

    text: str
    names: tuple[str, ...]
    meaning: str

    def fault(self, node: ast.AST) -> InputError:
        """Error of a part of the text that is not allowed."""
        return InputError(
            f"'{ast.unparse(node)}' in '{self.text}' is not allowed; expected {self.meaning}"
        )


def _parsed(text: str, meaning: str) -> ast.expr:
    """Read a text into a syntax tree, of which nothing is known yet."""
    if len(text) > _LONGEST:
        raise InputError(f"has {len(text)} characters; expected at most {_LONGEST}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"'{text}' is not {meaning}") from None


def _condition(node: ast.AST, language: _Language) -> Callable[[_Variables], NDArray[np.bool_]]:
    """Turn a condition into a function of the variables, or refuse it."""
    match node:
        case ast.BoolOp(op=op, values=values):
            parts = [_condition(value, language) for value in values]
            combine = np.logical_and if isinstance(op, ast.And) else np.logical_or
            return lambda at: reduce(combine, [part(at) for part in parts])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            inner = _condition(operand, language)
            return lambda at: np.logical_not(inner(at))
        case ast.Compare(left=left, ops=ops, comparators=comparators) if all(
            type(op) in _COMPARISONS for op in ops
        ):
            terms = [_term(value, language) for value in (left, *comparators)]

            def holds(at: _Variables) -> NDArray[np.bool_]:
                values = [term(at)[0] for term in terms]
                steps = zip(ops, pairwise(values), strict=True)
                compared = [_COMPARISONS[type(op)](a, b) for op, (a, b) in steps]
                return reduce(np.logical_and, compared + [np.isfinite(one) for one in values])

            return holds
    raise language.fault(node)


def _term(node: ast.AST, language: _Language) -> _Term:
    """Turn a number into a function of the variables; what has none must be finite."""
    term = _number(node, language)
    _check_constants(node, language)
    return term


def _check_constants(node: ast.AST, language: _Language) -> None:
    """Refuse 1/0, sqrt(-1), 10**999: what holds no variable must be a finite number."""
    variable = (*_COORDINATES, _TIME)
    if any(isinstance(part, ast.Name) and part.id in variable for part in ast.walk(node)):
        for part in node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node):
            if isinstance(part, ast.expr):
                _check_constants(part, language)
        return
    with np.errstate(all="ignore"):
        finite = np.isfinite(_number(node, language)({})[0])
    if not finite:
        raise InputError(f"'{ast.unparse(node)}' in '{language.text}' is no finite number")


def _number(node: ast.AST, language: _Language) -> _Term:
    """Turn a number into a function of the variables, or refuse it.

    The function gives the value, and its derivative by the time (forward differentiation).
    """
    still = np.float64(0.0)
    key: Any
    match node:
        case ast.Constant(value=int() | float() as value) if (
            not isinstance(value, bool) and abs(value) <= 1e300
        ):
            return lambda at: (np.float64(value), still)
        case ast.Name(id="pi"):
            return lambda at: (np.float64(np.pi), still)
        case ast.Name(id=name) if name in language.names:
            return lambda at: (at[name], np.float64(name == _TIME))
        case ast.UnaryOp(op=op, operand=operand):
            key, parts = type(op), [operand]
        case ast.BinOp(left=left, op=op, right=right):
            key, parts = type(op), [left, right]
        case ast.Call(func=ast.Name(id=key), args=parts, keywords=[]):
            pass
        case _:
            raise language.fault(node)
    table = {1: _UNARY, 2: _BINARY}.get(len(parts), {})
    if key not in table:
        raise language.fault(node)
    terms, (value_of, rate_of) = [_number(part, language) for part in parts], table[key]

    def applied(at: _Variables) -> tuple[Any, Any]:
        values, rates = zip(*(term(at) for term in terms), strict=True)
        return value_of(*values), rate_of(*values, *rates)

    return applied


def _product(slope: Any, rate: Any) -> Any:
    """Chain rule; what stands still has no rate, even where the slope is infinite."""
    return np.where(rate == 0.0, 0.0, slope * rate)

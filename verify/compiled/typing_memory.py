"""What an operation gives for some types, remembered.

For each sum of two numbers in a kernel numba asks every rule that it has for a plus (of numbers,
arrays, words, lists, …) whether it applies. The answer depends on the types only.
"""

import operator
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import types

__all__ = ["remembered_types"]

_signatures: dict[Any, Any] = {}


def _is_built_in(function: Any, signature: Any) -> bool:
    """Whether numba's own code implements it, not a function compiled with a caller's options."""
    if type(function) is not types.Function:
        return False
    implementations: dict[Any, Any] = vars(function)["_impl_keys"]
    return implementations.get(signature.args) is function.typing_key


@contextmanager
def remembered_types(context: Any) -> Iterator[None]:
    """Let a typing context answer from memory where it answered before.

    Parameters
    ----------
    context : numba.core.typing.Context
    """
    if "resolve_function_type" in vars(context):  # an outer compilation does it
        yield
        return
    resolve, resolve_setitem = context.resolve_function_type, context.resolve_setitem
    setitem = context.resolve_value_type(operator.setitem)

    def resolve_function_type(function: Any, arguments: Any, named: Any) -> Any:
        try:
            known = None if named else _signatures.get((function, arguments))
        except TypeError:  # lists are no keys
            return resolve(function, arguments, named)
        if known is not None:
            return known
        signature = resolve(function, arguments, named)
        if signature is not None and not named:
            own = context._lookup_global(function) or function
            if _is_built_in(own, signature):
                _signatures[function, arguments] = signature
        return signature

    def resolve_set(target: Any, index: Any, value: Any) -> Any:
        known = _signatures.get((target, index, value))
        if known is None:
            known = resolve_setitem(target, index, value)
            if known is not None and _is_built_in(setitem, known):
                _signatures[target, index, value] = known
        return known

    context.resolve_function_type, context.resolve_setitem = resolve_function_type, resolve_set
    try:
        yield
    finally:
        del context.resolve_function_type, context.resolve_setitem

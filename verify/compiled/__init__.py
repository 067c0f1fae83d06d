"""Compiled loops: numba, without what it makes for nobody at first use."""

from verify.compiled.decorators import inner, kernel

__all__ = ["inner", "kernel"]

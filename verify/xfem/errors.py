"""The error that every wrong input to the compact solver raises."""

__all__ = ["BasisError", "XfemError"]


class XfemError(ValueError):
    """Bad input to the compact solver: what it was, where, and what was expected."""


class BasisError(XfemError):
    """The basis cannot express the cuts; the side-wise one can."""

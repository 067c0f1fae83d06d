"""The error that every wrong input to the compact solver raises."""

__all__ = ["XfemError"]


class XfemError(ValueError):
    """Bad input to the compact solver: what it was, where, and what was expected."""

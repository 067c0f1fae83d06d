"""Pieces with a small share of their element: policies that remove them, and a ghost penalty."""

from verify.xfem.slivers.ghost_penalty import DEFAULT_FACTOR, GhostPenalty
from verify.xfem.slivers.policies import (
    DEFAULT_POLICY,
    DEFAULT_THRESHOLD,
    SliverPolicy,
    SliverReport,
    treat_slivers,
)

__all__ = [
    "DEFAULT_FACTOR",
    "DEFAULT_POLICY",
    "DEFAULT_THRESHOLD",
    "GhostPenalty",
    "SliverPolicy",
    "SliverReport",
    "treat_slivers",
]

"""The form of ``ranking.json`` that the report relies on."""

from typing import Any, Literal, TypedDict

__all__ = ["RankingRecord"]


class _LeftOut(TypedDict):
    case: str
    solver: str
    reason: str


class _Standing(TypedDict):
    solver: str
    rank: int | None
    tied: bool
    value: float | None
    low: float | None
    high: float | None
    count: int
    where: str


class _Comparison(TypedDict):
    metric: str
    view: str
    how: str
    items: int
    standings: list[_Standing]
    left_out: list[_LeftOut]


class _Stability(TypedDict):
    solver: str
    rank: int | None
    tied: bool
    asked: int
    solved: int
    refused: int
    failed: int
    timeout: int
    memory: int
    blown_up: int
    inside_out: int
    lost: float | None
    regularisations: dict[str, int]


class RankingRecord(TypedDict):
    """What `verify.study.ranking` writes."""

    schema: Literal[1]
    cases: list[str]
    solvers: list[str]
    conformance: dict[str, dict[str, Any]]
    accuracy: list[_Comparison]
    stability: list[_Stability]
    energy: list[_Comparison]
    cost: list[_Comparison]
    left_out: list[_LeftOut]
    contended: list[str]

"""Form of ``ranking.json``, for who writes and who reads it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from verify.result import REFERENCE, CaseResult


@dataclass(frozen=True)
class LeftOut:
    """What does not count in a comparison, and why; an empty solver means all of them."""

    case: str
    solver: str
    reason: str


@dataclass(frozen=True)
class Standing:
    """A solver in a comparison.

    Parameters
    ----------
    solver : str
    rank : int or None
        One more than the number of solvers that are certainly better (their intervals lie
        wholly below). None for a solver without a number in some item: its `value` is over fewer
        items than that of the others.
    tied : bool
        Whether another has the same rank.
    value, low, high : float or None
        The number and the interval in which it lies.
    count : int
        Items that it rests on.
    where : str
        Case that decided, where the worst counts.
    """

    solver: str
    rank: int | None
    tied: bool
    value: float | None
    low: float | None
    high: float | None
    count: int
    where: str = ""


@dataclass(frozen=True)
class Comparison:
    """All solvers in one respect.

    Parameters
    ----------
    metric : str
        What was compared.
    view : str
        Under which condition.
    how : str
        How cases are joined: ``"mean"``, geometric mean of the ratios to the best of each case,
        or ``"worst"``.
    items : int
    standings : list of Standing
        Best first, those without rank last.
    left_out : list of LeftOut
    """

    metric: str
    view: str
    how: str
    items: int
    standings: list[Standing]
    left_out: list[LeftOut]


@dataclass(frozen=True)
class StabilityStanding:
    """How the solves of one solver ended.

    Parameters
    ----------
    solver : str
    rank : int
        One more than the number of solvers with a smaller share of solves lost.
    tied : bool
    asked, solved, refused : int
        Refusals are not held against a solver: it says what it cannot do.
    failed, timeout, memory : int
    blown_up : int
        Solved, but as far off as a body that does not move, or not finite.
    inside_out : int
        Solves whose notes tell of elements turned inside out.
    lost : float
        Share of the solves not refused that failed, ran out of time or memory, or blew up.
    regularisations : dict of str to int
        What was dropped, snapped, clamped, scaled or floored, and how often.
    """

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


@dataclass(frozen=True)
class Profile:
    """Share of items that each solver has done within a number, as a function of that number.

    Parameters
    ----------
    quantity : str
        What the number is.
    items : int
        All of them; a solver that has not done an item has one number less.
    steps : dict of str to list of float
        By solver, the numbers at which its share grows by one item; ascending.
    most : float or None
        Number beyond which nothing is shown.
    """

    quantity: str
    items: int
    steps: dict[str, list[float]]
    most: float | None = None


@dataclass(frozen=True, kw_only=True)
class Ranking:
    """A table per question, and what was left out.

    Parameters
    ----------
    cases, solvers : list of str
    conformance : dict of str to dict
        What ``verify conform`` found, by solver; it does not move the ranks.
    accuracy, energy, cost : list of Comparison
    stability : list of StabilityStanding
    left_out : list of LeftOut
        What no ranking counts.
    contended : list of str
        Why times may be off, if they may.
    profiles : list of Profile
        Performance and data profiles.
    """

    schema: Literal[1]
    kind: Literal["ranking"] = "ranking"
    cases: list[str]
    solvers: list[str]
    conformance: dict[str, dict[str, Any]]
    accuracy: list[Comparison]
    stability: list[StabilityStanding]
    energy: list[Comparison]
    cost: list[Comparison]
    left_out: list[LeftOut]
    contended: list[str]
    profiles: list[Profile] = field(default_factory=list)


def ranked_solvers(results: Sequence[CaseResult]) -> list[str]:
    """Return the solvers of a run that can be ranked: all but the reference."""
    names = dict.fromkeys(solve.solver for result in results for solve in result.solves)
    return [name for name in names if name != REFERENCE]

"""The study of claims from the literature: measured where that can be done, and judged by limits.

`claims.toml` has a row per claim: its sense, who makes it and where, and limits with their reasons.
`verify.study.claims_measured` has a function per claim, by the name in the row.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from importlib.resources import files
from typing import Any

from verify.report.notation import number as written
from verify.result import Verdict
from verify.runner.tasks import Failure, Task
from verify.study import claims_measured
from verify.study.claims_measured import Number
from verify.study.study import Finding, Making, Study


class Judgement(StrEnum):
    """What the numbers say about a claim."""

    HOLDS = "holds"
    IN_PART = "holds in part"
    NOT = "does not hold"
    UNTOLD = "cannot be told"


_AS_VERDICT = {Judgement.HOLDS: Verdict.PASS, Judgement.NOT: Verdict.FAIL}


@dataclass(frozen=True)
class Limit:
    """What a claim means for a number; without bounds the number is shown only.

    Attributes
    ----------
    number : str
        Its name.
    at_least, at_most : float or None
    why : str
        Argument for the bounds.
    """

    number: str
    at_least: float | None = None
    at_most: float | None = None
    why: str = ""

    def kept_by(self, found: Number) -> bool | None:
        """Say whether all of a number's interval is inside (True) or outside (False)."""
        if found.value is None or found.low is None or found.high is None:
            return None
        low = -float("inf") if self.at_least is None else self.at_least
        high = float("inf") if self.at_most is None else self.at_most
        if low <= found.low and found.high <= high:
            return True
        return False if found.high < low or high < found.low else None

    def in_words(self) -> str:
        """Return the bounds and their reason; empty without bounds."""
        pairs = ("at least", self.at_least), ("at most", self.at_most)
        bounds = " and ".join(f"{word} {value:g}" for word, value in pairs if value is not None)
        return f"{bounds}: {self.why}" if bounds else ""


@dataclass(frozen=True)
class Claim:
    """A row of `claims.toml`.

    Attributes
    ----------
    measure : str
        Function of `verify.study.claims_measured`.
    solvers : list of str
        That it runs.
    sense, who, made, ran, command : str
        The claim, its authors, where they made it and what differs here, what was run in short,
        and what runs it again.
    limits : list of Limit
        Of the numbers, in their order.
    moved : str
        What was dropped, or set when its number was known; empty if nothing was.
    """

    measure: str
    solvers: list[str]
    sense: str
    who: str
    made: str
    ran: str
    command: str
    limits: list[Limit]
    moved: str = ""


def claims() -> list[Claim]:
    """Read all claims."""
    text = files("verify.study").joinpath("claims.toml").read_text(encoding="utf-8")
    rows = tomllib.loads(text)["claims"]
    return [Claim(**{**row, "limits": [Limit(**one) for one in row["limits"]]}) for row in rows]


def judgement_of(limits: Sequence[Limit], numbers: Sequence[Number]) -> Judgement:
    """Judge a claim: it holds if every limit is kept, not if every one is broken.

    Kept and broken limits together make it hold in part. A limit that is neither decides nothing,
    and a claim without limits cannot be told.
    """
    pairs = zip(limits, numbers, strict=True)
    states = [limit.kept_by(n) for limit, n in pairs if limit.in_words()]
    if True in states and False in states:
        return Judgement.IN_PART
    if None in states or not states:
        return Judgement.UNTOLD
    return Judgement.HOLDS if states[0] else Judgement.NOT


@dataclass(frozen=True)
class Judged:
    """A claim with its numbers, their words, and what they say."""

    claim: Claim
    numbers: list[Number]
    shown: list[str]
    judgement: Judgement


@dataclass(frozen=True, kw_only=True)
class ClaimsStudy(Study):
    """What the study found."""

    judged: list[Judged]

    def rows(self) -> list[dict[str, Any]]:
        """Return a line for each number."""
        return [
            {"claim": one.claim.measure, "judgement": str(one.judgement)}
            | asdict(limit)
            | asdict(n)
            for one in self.judged
            for limit, n in zip(one.claim.limits, one.numbers, strict=True)
        ]


_TOGETHER = 7  # claims in a process: they share imports and solves


def claims_study(making: Making) -> ClaimsStudy:
    """Measure all claims, and judge them.

    A claim whose measurement fails has the reason in the place of its numbers.
    """
    every = claims()
    groups = [every[at : at + _TOGETHER] for at in range(0, len(every), _TOGETHER)]
    tasks = [
        Task(f"{group[0].measure} to {group[-1].measure}", claims_measured.measured,
             {"names": [one.measure for one in group]},
             tuple(sorted({name for one in group for name in one.solvers})))
        for group in groups
    ]  # fmt: skip
    judged = []
    for group, found in zip(groups, making.parts("claims", tasks, may_fail=True), strict=True):
        lost = [Number(None, note=found.reason)] if isinstance(found, Failure) else []
        for claim in group:
            numbers = lost or found[claim.measure]
            if len(numbers) == 1:  # it failed
                numbers = numbers * len(claim.limits)
            shown = [in_words(one) for one in numbers]
            judged.append(Judged(claim, numbers, shown, judgement_of(claim.limits, numbers)))
    return ClaimsStudy(judged=judged, findings=[_finding(one) for one in judged])


def _finding(one: Judged) -> Finding:
    pairs = zip(one.claim.limits, one.shown, strict=True)
    said = "; ".join(f"{limit.number}: {words}" for limit, words in pairs)
    limits = "; ".join(words for limit in one.claim.limits if (words := limit.in_words()))
    verdict = _AS_VERDICT.get(one.judgement, Verdict.UNDECIDED)
    return Finding(one.claim.sense, f"{one.judgement}. {said}", limits or "shown", verdict)


def in_words(found: Number) -> str:
    """Write a number with its interval, if it has one, and its note."""
    if found.value is None or found.low is None or found.high is None:
        return f"not measured: {found.note}"
    text = written(found.value, 3)
    if found.low < found.high:
        text += f" [{written(found.low, 3)}, {written(found.high, 3)}]"
    return f"{text} ({found.note})" if found.note else text

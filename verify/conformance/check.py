"""One check of a solver: its claim, and what became of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from verify.conformance.trials import Outcome, Trial
from verify.result import Status
from verify.solution import Solution


class State(StrEnum):
    """What became of a check."""

    PASS = "pass"
    FAIL = "fail"
    ERROR = "error"  # the solver crashed, hung or raised on a scene that it did not refuse
    # off, by what a regularisation that it states and the place of its cut explain
    STATED = "stated"
    REFUSED = "refused"  # the solver does not do such scenes, or gives no such number


@dataclass(frozen=True)
class Finding:
    """A number that must not exceed `limit`; `note` says what else was seen.

    `limit` None: there was nothing to measure, for the reason in `note`. `stated`: what is above
    the limit is explained by what the solver states.
    """

    observed: float
    limit: float | None
    note: str = ""
    stated: bool = False


@dataclass(frozen=True)
class Check:
    """A claim, the trials that decide it, and how.

    `judge` gets the solutions by the name of their trials, all of them solved. If
    `judge_outcomes` is given it gets the outcomes instead, however they ended, and returns what
    is wrong, or an empty text.
    """

    name: str
    claim: str
    trials: Sequence[Trial]
    judge: Callable[[Mapping[str, Solution]], Finding] | None = None
    judge_outcomes: Callable[[Mapping[str, Outcome]], str] | None = None
    separate: tuple[str, ...] = ()  # trials that need a process of their own


@dataclass(frozen=True)
class CheckResult:
    """The result of a check, as `verify conform --json` prints it."""

    name: str
    claim: str
    state: State
    observed: float | None = None
    limit: float | None = None
    reason: str = ""


def evaluate(check: Check, outcomes: Mapping[str, Outcome]) -> CheckResult:
    """Decide `check` on the outcomes of its trials."""
    if check.judge_outcomes is not None:
        wrong = check.judge_outcomes(outcomes)
        state = State.FAIL if wrong else State.PASS
        return CheckResult(check.name, check.claim, state, reason=wrong)
    solutions = {}
    for name, outcome in outcomes.items():
        if outcome.status is Status.REFUSED:
            return CheckResult(check.name, check.claim, State.REFUSED, reason=outcome.reason)
        if outcome.solution is None:
            reason = f"{name}: {outcome.reason}"
            return CheckResult(check.name, check.claim, State.ERROR, reason=reason)
        solutions[name] = outcome.solution
    assert check.judge is not None
    found = check.judge(solutions)
    if found.limit is None:
        return CheckResult(check.name, check.claim, State.REFUSED, reason=found.note)
    # `not <=`, so that a number that is not finite breaks the check
    state = State.PASS if found.observed <= found.limit else State.FAIL
    state = State.STATED if found.stated else state
    return CheckResult(check.name, check.claim, state, found.observed, found.limit, found.note)

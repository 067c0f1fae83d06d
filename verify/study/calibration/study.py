"""Coverage of the error bars: stated uncertainty of the reference against its true error."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from time import perf_counter
from typing import Any

from verify.result import Verdict
from verify.study.calibration.families import families
from verify.study.calibration.trial import NORMS, Trial, trials
from verify.study.record import Finding, Study

COVERED, COVERED_IN_EACH, NOT_WASTED = 0.95, 0.90, 0.85  # shares that are asked for
WASTED = 10.0  # an error bar that is so many times the error judges little
FEWEST, FEWEST_SCENES = 60, 15  # triples and scenes of a family from which a share says something


@dataclass(frozen=True, kw_only=True)
class CalibrationStudy(Study):
    """What the calibration study found.

    Attributes
    ----------
    trials : list of Trial
    quick : bool
    """

    trials: list[Trial]
    quick: bool

    def as_record(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {**asdict(self), "trials": self.rows()}

    def rows(self) -> list[dict[str, Any]]:
        """Return a line per trial, for a table."""
        return [{**asdict(one), "covered": one.covered, "ratio": one.ratio} for one in self.trials]


def calibration_study(quick: bool, announce: Callable[[str], None]) -> CalibrationStudy:
    """Have the reference state its uncertainty where its true error is known.

    Parameters
    ----------
    quick : bool
        Two scenes of each family, in the plane only: too few to judge a family by.
    announce : callable
        Is told what is being solved.
    """
    start = perf_counter()
    found = []
    for family in families(quick):
        announce(f"{family.name}, {family.scenes} scenes of {family.levels} levels")
        for index in range(family.scenes):
            found += trials(family, index)
    findings = calibration_findings(found, quick)
    return CalibrationStudy(
        findings=findings, seconds=perf_counter() - start, trials=found, quick=quick
    )


def calibration_findings(found: Sequence[Trial], quick: bool = False) -> list[Finding]:
    """Hold the trials against the shares that are asked for: overall, and in each family."""
    counted = [one for one in found if not one.left_out]
    n = len(counted)
    if not n:
        nothing = "no trial has a true error that is known"
        return [Finding("calibration", nothing, "at least one", Verdict.UNDECIDED)]
    missed = sorted((one for one in counted if not one.covered), key=lambda one: one.ratio)
    worst = f"; worst: {_named(missed[0])}, {_short(missed[0])}" if missed else ""
    widest = max(counted, key=lambda one: one.ratio)
    near = sum(one.ratio < WASTED for one in counted)
    kinds = [
        (name, [one for one in counted if (one.quantity in NORMS) == norms])
        for name, norms in (("norms of the error", True), ("quantities of interest", False))
    ]
    return [
        Finding(
            "coverage",
            f"The stated uncertainty covers the true error in {n - len(missed)} of {n} triples of "
            f"case, quantity and level ({1 - len(missed) / n:.1%}): "
            f"{'; '.join(_covered(name, own) for name, own in kinds)}{worst}.",
            f"at least {COVERED:.0%}",
            _verdict(1 - len(missed) / n, COVERED),
        ),
        Finding(
            "width",
            f"It is below {WASTED:g} times the true error in {near} of {n} ({near / n:.1%}): "
            f"{'; '.join(_near(name, own) for name, own in kinds)}; widest {widest.ratio:.3g} "
            f"times ({_named(widest)}).",
            f"at least {NOT_WASTED:.0%}",
            _verdict(near / n, NOT_WASTED),
        ),
        *(
            _of_family(name, [one for one in counted if one.family == name], quick)
            for name in dict.fromkeys(one.family for one in found)
        ),
    ]


def _of_family(name: str, own: Sequence[Trial], quick: bool) -> Finding:
    """Judge the coverage in one family; too few triples are no sample."""
    covered, scenes = sum(one.covered for one in own), len({one.scene for one in own})
    near = sum(one.ratio < WASTED for one in own)
    few = len(own) < FEWEST or scenes < FEWEST_SCENES
    share = covered / len(own) if own else 0.0
    too_few = Verdict.UNDECIDED if quick else Verdict.FAIL
    return Finding(
        f"coverage, {name}",
        f"It covers the true error in {covered} of {len(own)} triples from {scenes} scenes "
        f"({share:.1%}), and is below {WASTED:g} times the true error in {near}.",
        f"at least {COVERED_IN_EACH:.0%} of at least {FEWEST} triples from {FEWEST_SCENES} scenes",
        too_few if few else _verdict(share, COVERED_IN_EACH),
    )


def _covered(name: str, own: Sequence[Trial]) -> str:
    return f"{name} {sum(one.covered for one in own)} of {len(own)}"


def _near(name: str, own: Sequence[Trial]) -> str:
    middle = f", median {median(one.ratio for one in own):.3g} times" if own else ""
    return f"{name} {sum(one.ratio < WASTED for one in own)} of {len(own)}{middle}"


def _short(one: Trial) -> str:
    if one.ratio == 0.0:
        return "which states no uncertainty"
    return f"whose error is {1 / one.ratio:.3g} times what is stated"


def _verdict(share: float, asked: float) -> Verdict:
    return Verdict.PASS if share >= asked else Verdict.FAIL


def _named(one: Trial) -> str:
    return f"{one.family}, scene {one.scene}, P{one.degree}, {one.quantity}"

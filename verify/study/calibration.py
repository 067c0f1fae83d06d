"""Coverage of the error bars: stated uncertainty of the reference against its true error.

A trial is one reference on a case whose truth is known: its stated half-width and its true error.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from statistics import median
from typing import Any

from scipy.special import betainc

from reference.exact import ExactSolution, exact_of
from verify.compare.body import AnyBody, body_of
from verify.compare.errors import Rules
from verify.compare.hooke import Law, law_of
from verify.judge.quantities import Measured
from verify.judge.reference import conforming_reference, exact_reference, size_of
from verify.result import Verdict
from verify.runner.tasks import Task
from verify.scene import Scene
from verify.solution import Solution
from verify.solvers import find_solver
from verify.study.calibration_families import Family, Trial, families, series_families
from verify.study.study import Finding, Making, Study, held

NORMS = ("displacement_l2", "energy_norm", "jump_l2")
_LEVELS = 3  # that a reference is made of
# Relative errors below come from the solve and the quadrature, not from the elements
_ROUND_OFF = 1e-10
# A truth that is itself uncertain by more than this share of the error judges nothing
_SURE = 0.1


def trials_of(family: str, index: int, seed: int) -> list[Trial]:
    """Judge a scene of the family of this name."""
    (one,) = (own for own in families(quick=False) if own.name == family)
    return trials(one, index, seed)


def trials(family: Family, index: int, seed: int) -> list[Trial]:
    """Solve the levels of a scene and judge every reference that three of them make."""
    scene, values = family.scene(index, seed)
    solver = find_solver("reference")
    solutions = {k: solver.solve(scene, k, 0) for k in range(solver.levels(scene))}
    law, exact = law_of(scene), exact_of(scene)
    body = body_of(scene, None if exact is None else exact.singular_points)
    truth = {name: (value, 0.0) for name, value in values.items()}
    if exact is not None:
        truth = exact_reference(scene, exact, body, law).quantities
    found = []
    for last in range(_LEVELS - 1, len(solutions)):
        levels = {k: solutions[k] for k in range(last - _LEVELS + 1, last + 1)}
        found += [
            replace(one, degree=scene.reference.degree, level=last)
            for one in _judged(scene, levels, body, law, exact, truth)
        ]
    return [replace(one, family=family.name, scene=index, left_out=_left_out(one)) for one in found]


def _judged(
    scene: Scene, levels: Mapping[int, Solution], body: AnyBody, law: Law,
    exact: ExactSolution | None, values: Mapping[str, tuple[float, float]],
) -> list[Trial]:  # fmt: skip
    finest = levels[max(levels)]
    size = size_of(finest) * (1 if scene.dimension == 2 else 2)  # of the quadrature
    stated = conforming_reference(scene, levels, body, law, Rules(body, size))
    found = []
    if exact is not None:
        own = Measured(finest, body, law, scene).field
        exact = exact.at(scene.analysis.duration) if scene.analysis.duration else exact
        known_norms = [name for name in NORMS if name in stated.norms]
        norms = Rules(body, size).norms(known_norms, own, exact, law, (0, 1))
        for name, (fine, check) in norms.items():
            known = abs(fine.absolute - check.absolute) / fine.scale
            half = stated.norms[name] / fine.scale
            found.append(Trial("", 0, 0, name, half, fine.relative, known))
    for name, (value, width) in values.items():
        if value == 0.0 or name not in stated.quantities:
            continue
        at, half = stated.quantities[name]
        off, known = abs(at / value - 1), width / abs(value)
        found.append(Trial("", 0, 0, name, half / abs(value), off, known))
    return found


def _left_out(one: Trial) -> str:
    if one.true <= _ROUND_OFF:
        return f"the true error {one.true:.1e} is round-off"
    if one.known > _SURE * one.true:
        return f"the true error {one.true:.1e} is known to {one.known:.1e} only"
    return ""


COVERED, COVERED_IN_EACH, NOT_WASTED = 0.95, 0.90, 0.85  # shares that are asked for
WASTED = 10.0  # an error bar that is so many times the error judges little
SIGNIFICANCE = 0.05  # of the binomial test that rejects a share
FEWEST, FEWEST_SCENES = 60, 15  # triples and scenes of a family from which a share says something


@dataclass(frozen=True, kw_only=True)
class CalibrationStudy(Study):
    """What the calibration study found.

    Attributes
    ----------
    trials : list of Trial
    quick : bool
    seed : int
    """

    trials: list[Trial]
    quick: bool
    seed: int

    def as_record(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {**asdict(self), "trials": self.rows()}

    def rows(self) -> list[dict[str, Any]]:
        """Return a line per trial, for a table."""
        return [{**asdict(one), "covered": one.covered, "ratio": one.ratio} for one in self.trials]


def calibration_study(making: Making, quick: bool, seed: int) -> CalibrationStudy:
    """Have the reference state its uncertainty where its true error is known.

    Parameters
    ----------
    making : Making
    quick : bool
        Two scenes of each family that is cheap: too few to judge a family by.
    seed : int
        Of all random numbers.

    Raises
    ------
    ChildProcessError
        If a scene cannot be solved; what was found of the others is kept.
    """
    making.announce(f"seed {seed}")
    found = [one for family in series_families(quick) for one in family.trials(seed)]
    tasks = [
        Task(f"{family.name}, scene {index}", trials_of,
             {"family": family.name, "index": index, "seed": seed}, ("reference",))
        for family in families(quick)
        for index in range(family.scenes)
    ]  # fmt: skip
    found += chain.from_iterable(making.parts("calibration", tasks))
    findings = calibration_findings(found, quick)
    return CalibrationStudy(findings=findings, trials=found, quick=quick, seed=seed)


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
    of_norms = [one for one in counted if one.quantity in NORMS]
    rest = [one for one in counted if one.quantity not in NORMS]
    kinds = [("norms of the error", of_norms), ("quantities of interest", rest)]
    return [
        Finding(
            "coverage",
            f"The stated uncertainty covers the true error in {n - len(missed)} of {n} triples of "
            f"case, quantity and level ({1 - len(missed) / n:.1%}): "
            f"{'; '.join(_covered(name, own) for name, own in kinds)}{worst}.",
            _expected(COVERED),
            _verdict(counted, [one.covered for one in counted], COVERED),
        ),
        Finding(
            "width",
            f"It is below {WASTED:g} times the true error in {near} of {n} ({near / n:.1%}): "
            f"{'; '.join(_near(name, own) for name, own in kinds)}; widest {widest.ratio:.3g} "
            f"times ({_named(widest)}).",
            _expected(NOT_WASTED),
            _verdict(counted, [one.ratio < WASTED for one in counted], NOT_WASTED),
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
        f"{_expected(COVERED_IN_EACH)}; at least {FEWEST} triples from {FEWEST_SCENES} scenes",
        too_few if few else _verdict(own, [one.covered for one in own], COVERED_IN_EACH),
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


def _expected(share: float) -> str:
    return f"{share:.0%}, not rejected by a binomial test at {SIGNIFICANCE:.0%}"


def _verdict(own: Sequence[Trial], hits: Sequence[bool], asked: float) -> Verdict:
    tail = binomial_tail(hits, [(one.family, one.scene) for one in own], asked)
    return held(tail >= SIGNIFICANCE)


def binomial_tail(hits: Sequence[bool], scenes: Sequence[Hashable], share: float) -> float:
    """Return the probability of so few hits if each is one with probability `share`.

    Hits of one scene are correlated. The numbers of hits and trials are divided by the design
    effect: the variance of the hit rate between scenes over the binomial one, at least 1.
    Rao, Scott, A simple method for the analysis of clustered binary data, Biometrics 48, 1992.
    """
    n, k = len(hits), sum(hits)
    if k == n:
        return 1.0
    rate = k / n
    found = dict.fromkeys(scenes, 0.0)
    for hit, scene in zip(hits, scenes, strict=True):
        found[scene] += float(hit) - rate
    between = sum(excess**2 for excess in found.values()) / n**2
    binomial = rate * (1 - rate) / n
    effect = max(1.0, between / binomial) if binomial else 1.0
    return float(betainc((n - k) / effect, k / effect + 1, 1 - share))


def _named(one: Trial) -> str:
    degree = f"P{one.degree}, " if one.degree else ""
    return f"{one.family}, scene {one.scene}, {degree}{one.quantity}"

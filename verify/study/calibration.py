"""Coverage of the error bars: stated uncertainty of the reference against its true error.

A trial is one reference on a case whose truth is known: its stated half-width and its true error.
The families are random scenes with a known answer, on which the reference judges itself, and
series: three levels of a number whose orders are mixed, and whose limit is known.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from statistics import median
from typing import Any

import numpy as np
from scipy.special import betainc

from reference.exact import ExactSolution, exact_of
from verify.compare.body import AnyBody, body_of
from verify.compare.errors import Rules
from verify.compare.hooke import Law, law_of
from verify.judge.convergence import extrapolate
from verify.judge.quantities import Measured
from verify.judge.reference import conforming_reference, exact_reference, size_of
from verify.result import Verdict
from verify.runner.tasks import Task
from verify.scene import Scene
from verify.solution import Solution
from verify.solvers import find_solver
from verify.study import calibration_scenes as scenes
from verify.study.study import Finding, Making, Study, held

Content = dict[str, Any]

_SCENES, _QUICK_SCENES = 15, 2


@dataclass(frozen=True)
class Trial:
    """What a reference states of one number, and how far off it is; relative.

    Parameters
    ----------
    family : str
    scene, degree, level : int
        Which scene of the family, degree of the elements, and the finest of the three levels.
    quantity : str
        An error norm of the finest level, or a quantity of interest.
    stated, true : float
        Half-width that the reference states, and its true error.
    known : float
        How well the true error is known.
    left_out : str
        Why it does not count; empty if it does.
    """

    family: str
    degree: int
    level: int
    quantity: str
    stated: float
    true: float
    known: float
    left_out: str = ""
    scene: int = 0

    @property
    def covered(self) -> bool:
        """Whether the stated half-width covers the true error."""
        return bool(self.true <= self.stated + self.known)

    @property
    def ratio(self) -> float:
        """Stated over true."""
        return self.stated / self.true if self.true > 0.0 else float("inf")


@dataclass(frozen=True)
class Family:
    """Scenes of one kind, of which every number is drawn at random.

    Parameters
    ----------
    name : str
    make : callable
        Makes the content of a scene, without a reference, from a random generator; of a motion
        with the true ``values`` of its quantities.
    cells : (float, float)
        Elements of the coarsest level along the side of the body, least and most, by degree.
    scenes : int
    levels : int
        Every three successive levels make a reference.
    degrees : tuple of int
        Scenes take them in turn.
    """

    name: str
    make: Callable[[np.random.Generator], Content]
    cells: tuple[float, float]
    scenes: int = _SCENES
    levels: int = 3
    degrees: tuple[int, ...] = (1, 2)

    def scene(self, index: int, seed: int) -> tuple[Scene, Mapping[str, float]]:
        """Return a scene, judged by conforming levels as if there were no exact solution.

        Beside it the true values of its quantities, where it is without an exact field.
        """
        random = np.random.default_rng([seed, index, *self.name.encode()])
        content = self.make(random)
        values = content.pop("values", {})
        low, high = (np.array(content["geometry"][end]) for end in ("lower", "upper"))
        reference = {
            "kind": "conforming",
            "size": float((high - low).max() / random.uniform(*self.cells)),
            "levels": self.levels,
            "degree": self.degrees[index % len(self.degrees)],
        }
        demand = "The stated uncertainty of the reference shall cover its true error."
        scene = {**content, "requirement": demand, "reference": reference}
        return Scene.model_validate(scene), values


def families(quick: bool) -> list[Family]:
    """Return the families of the study; quick: two scenes each of those that are cheap."""
    n = _QUICK_SCENES if quick else _SCENES
    found = [
        Family("airy", scenes.airy, (3, 7), n),
        Family("smooth", scenes.smooth, (3, 7), n),
        Family("tip", scenes.tip, (2, 5), n),
        Family("griffith", scenes.griffith, (3, 5), n),
        Family("ring and disc", scenes.ring_and_disc, (3, 7), n),
        Family("arc through", scenes.arc_through, (3, 7), n),
        Family("arc crack", scenes.curved_crack, (3, 5), n),
        Family("bar in motion", scenes.bar, (8, 12), n, degrees=(2,)),
    ]
    if quick:
        return found
    return [
        *found,
        Family("sudden crack", scenes.sudden_crack, (4, 5), degrees=(2,)),
        Family("blade strip", scenes.blade_strip, (6, 8), degrees=(1,)),
        # linear elements: levels of quadratic ones would take most of the study's time
        Family("solid smooth", scenes.solid_smooth, (1.5, 2.5), degrees=(1,)),
        Family("ball and shell", scenes.ball_and_shell, (1.5, 2.5), degrees=(1,)),
    ]


_LIMIT = 1.0
_SIZES = (0.2, 0.1, 0.05)  # the finest is by no means asymptotic
_DECADES = 1.0  # sizes of coefficients: 10 to the power of −1 … 1, of either sign


@dataclass(frozen=True)
class Series:
    """Values 1 + c₁ hᵃ + c₂ hᵇ + c₃ hᶜ, of which every coefficient is drawn at random.

    Parameters
    ----------
    name : str
    exponents : (float, float, float)
    formal : float
        Order that is counted on, right or wrong.
    count : int
        Series, each a triple of levels of its own.
    """

    name: str
    exponents: tuple[float, float, float]
    formal: float
    count: int

    def values(self, seed: int) -> np.ndarray:
        """Return the values (count, 3), coarse to fine."""
        random = np.random.default_rng([seed, *self.name.encode()])
        shape = (self.count, 3)
        sizes = 10.0 ** random.uniform(-_DECADES, _DECADES, shape)
        coefficients = random.choice([-1.0, 1.0], shape) * sizes
        return _LIMIT + coefficients @ np.power.outer(_SIZES, self.exponents).T

    def trials(self, seed: int) -> list[Trial]:
        """Have the estimator of quantities state its half-width of every series."""
        found = []
        for index, values in enumerate(self.values(seed)):
            stated = extrapolate(values.tolist(), _SIZES, self.formal).half_width
            true = abs(float(values[-1]) - _LIMIT)
            found.append(Trial(self.name, 0, 2, "value", stated, true, 0.0, scene=index))
        return found


def series_families(quick: bool) -> list[Series]:
    """Return the families of the study; quick: a tenth of the triples."""
    return [
        Series(f"{name}, formal order {formal}", exponents, formal, 40 if quick else 400)
        for name, exponents in (("h^½ + h + h²", (0.5, 1.0, 2.0)), ("h + h² + h³", (1.0, 2.0, 3.0)))
        for formal in (1, 2)
    ]


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

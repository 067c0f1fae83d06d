"""One reference on a case whose truth is known: what it states, and what is true."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from reference.exact import ExactSolution, exact_of
from verify.compare.body import AnyBody, body_of
from verify.compare.errors import Rules
from verify.compare.hooke import Law, law_of
from verify.judge.quantities import Measured
from verify.judge.reference import (
    conforming_reference,
    exact_reference,
    size_of,
)
from verify.scene import Scene
from verify.solution import Solution
from verify.solvers import find_solver
from verify.study.calibration.families import Family, families

NORMS = ("displacement_l2", "energy_norm", "jump_l2")
_LEVELS = 3  # that a reference is made of
# Relative errors below are those of the solve and of the quadrature, not of the elements
_ROUND_OFF = 1e-10
# A truth that is itself uncertain by more than this share of the error judges nothing
_SURE = 0.1


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
    scene: Scene,
    levels: Mapping[int, Solution],
    body: AnyBody,
    law: Law,
    exact: ExactSolution | None,
    values: Mapping[str, tuple[float, float]],
) -> list[Trial]:
    finest = levels[max(levels)]
    size = size_of(finest) * (1 if scene.dimension == 2 else 2)  # of the quadrature
    stated = conforming_reference(scene, levels, body, law, size)
    found = []
    if exact is not None:
        own = Measured(finest, body, law, scene).field
        known_norms = [name for name in NORMS if name in stated.norms]
        norms = Rules(body, size, count=2).norms(known_norms, own, exact, law)
        for name, (fine, check) in norms.items():
            known = abs(fine.absolute - check.absolute) / fine.scale
            half = stated.norms[name] / fine.scale
            found.append(Trial("", 0, 0, name, half, fine.relative, known))
    for name, (value, width) in values.items():
        if value == 0.0 or name not in stated.quantities:
            continue
        at, half = stated.quantities[name]
        found.append(
            Trial("", 0, 0, name, half / abs(value), abs(at / value - 1), width / abs(value))
        )
    return found


def _left_out(one: Trial) -> str:
    if one.true <= _ROUND_OFF:
        return f"the true error {one.true:.1e} is round-off"
    if one.known > _SURE * one.true:
        return f"the true error {one.true:.1e} is known to {one.known:.1e} only"
    return ""

"""The errors that are measured: of what, where, and with which order they should fall."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from verify.compare.body import AnyBody
from verify.compare.displacement_error import displacement_error
from verify.compare.energy_error import energy_error
from verify.compare.error_norm import ErrorNorm
from verify.compare.hooke import Law
from verify.compare.integration import cut_rules, rules
from verify.compare.jump_error import jump_error
from verify.compare.locate import Field
from verify.compare.maximum_error import maximum_error
from verify.compare.near_tip import near_radius, near_tip
from verify.compare.opening_error import opening_error, opening_maximum_error
from verify.compare.slabs import Rule

__all__ = ["ERRORS", "OVER_TIME", "ErrorMetric", "Rules"]

Measure = Callable[[Field, Field, Any, Law], ErrorNorm]
Where = Literal["body", "near", "far", "cut"]


@dataclass(frozen=True)
class ErrorMetric:
    """An error metric.

    Parameters
    ----------
    measure : callable
        Norm of the difference of two fields, and of the second.
    where : {"body", "near", "far", "cut"}
        Over the body, over its points near to tips or far from them, or along the cuts.
    beyond : int
        P_p can be counted on to converge with order p + `beyond`.
    """

    measure: Measure
    where: Where
    beyond: int


def _l2(field: Field, reference: Field, rule: Rule, law: Law) -> ErrorNorm:
    return displacement_error(field, reference, rule)


ERRORS: dict[str, ErrorMetric] = {
    "displacement_l2": ErrorMetric(_l2, "body", 1),
    "energy_norm": ErrorMetric(energy_error, "body", 0),
    "jump_l2": ErrorMetric(lambda f, r, rule, law: jump_error(f, r, rule), "cut", 1),
    "displacement_max": ErrorMetric(lambda f, r, rule, law: maximum_error(f, r, rule), "body", 1),
    "opening_l2": ErrorMetric(lambda f, r, rule, law: opening_error(f, r, rule), "cut", 1),
    "opening_max": ErrorMetric(lambda f, r, rule, law: opening_maximum_error(f, r, rule), "cut", 1),
    "displacement_l2_near": ErrorMetric(_l2, "near", 1),
    "displacement_l2_far": ErrorMetric(_l2, "far", 1),
    "energy_norm_near": ErrorMetric(energy_error, "near", 0),
    "energy_norm_far": ErrorMetric(energy_error, "far", 0),
}

# in dynamics these are also reported as their maximum and mean over time
OVER_TIME = ("displacement_l2", "energy_norm", "jump_l2")


class Rules:
    """The rules of a body for one element size: families of three, the finest first.

    Parameters
    ----------
    body : Body or SolidBody
    size : float
        Element size, m.
    count : int
        How many rules of each family.
    """

    def __init__(self, body: AnyBody, size: float, count: int = 3) -> None:
        self.radius = near_radius(body)
        whole = rules(body, size, count)
        self._by_place: dict[str, list[Any]] = {"body": whole, "near": [], "far": []}
        if self.radius:
            for rule in whole:
                near = near_tip(body, rule.points, self.radius)
                # the points are the same arrays: what a field is there is found once
                self._by_place["near"].append(
                    replace(rule, weights=np.where(near, rule.weights, 0))
                )
                self._by_place["far"].append(replace(rule, weights=np.where(near, 0, rule.weights)))
        cuts = cut_rules(body, size, count) if body.has_cuts else []
        self._by_place["cut"] = [rule for rule in cuts if len(rule.weights)]

    def measured(self) -> list[str]:
        """Names of the errors that mean something on this body."""
        return [name for name, metric in ERRORS.items() if self._by_place[metric.where]]

    def norms(self, name: str, field: Field, reference: Field, law: Law) -> list[ErrorNorm]:
        """Error norm by each rule of the family.

        What is measured near a tip or far from it is held against the norm of the reference
        over the whole body: the squares of both add up to the square of the whole.
        """
        metric = ERRORS[name]
        found = [metric.measure(field, reference, r, law) for r in self._by_place[metric.where]]
        if metric.where in ("near", "far"):
            whole = self.norms(name.rsplit("_", 1)[0], field, reference, law)
            found = [ErrorNorm(n.absolute, w.scale) for n, w in zip(found, whole, strict=True)]
        return found

"""A metric of one's own, measured on a finished run.  python strain_error.py RUN"""

import json
import sys
from pathlib import Path

import numpy as np

from reference.exact import exact_solution
from verify.compare.body import body_of
from verify.compare.body_rule import rules
from verify.compare.errors import ErrorNorm, integrate_norm
from verify.compare.hooke import hooke
from verify.compare.realised import field_of
from verify.scene import restore_scene
from verify.solution import read_solution


def strain_error(field, reference, rule, law):
    """‖ε − ε_ref‖ and ‖ε_ref‖ in L2 of the body."""

    def strain(of):
        gradient = of.gradient(rule.points, rule.points)
        return 0.5 * (gradient + gradient.transpose(0, 2, 1))

    expected = strain(reference)
    norms = [
        np.sqrt(rule.weights @ np.sum(values**2, axis=(1, 2)))
        for values in (strain(field) - expected, expected)
    ]
    return ErrorNorm(*map(float, norms))


for case in sorted(Path(sys.argv[1]).glob("cases/*/scene.json")):
    scene = restore_scene(json.loads(case.read_text()))
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    body, law = body_of(scene, exact.singular_points), hooke(scene.material)
    for path in sorted(case.parent.glob("*/solution.json")):
        solution = read_solution(path.with_suffix(""))
        field, family = field_of(solution, body), rules(body, solution.size)
        found = integrate_norm(lambda rule: strain_error(field, exact, rule, law), family)  # noqa: B023
        print(f"{path.parent.name}: {found.norm.relative:.4e} ± {found.integration_error:.0e}")

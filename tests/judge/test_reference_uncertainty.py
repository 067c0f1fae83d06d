"""The error bar of the conforming reference, held against exact solutions."""

import numpy as np
import pytest

from reference.exact import exact_solution
from verify.compare.body import body_of
from verify.compare.body_rule import area_rule
from verify.compare.cut_rule import cut_rule
from verify.compare.errors import Rules, displacement_error, energy_error, jump_error
from verify.compare.hooke import hooke
from verify.judge.quantities import Measured
from verify.judge.reference import conforming_reference, exact_reference
from verify.scene import Scene, load_scene
from verify.solvers import find_solver

pytestmark = pytest.mark.fenicsx


def test_the_stated_uncertainty_of_the_reference_covers_its_true_error():
    content = load_scene("statics/griffith_edges").model_dump(by_alias=True)
    lower, upper = np.array(content["geometry"]["lower"]), np.array(content["geometry"]["upper"])
    h = float(np.ptp([lower, upper])) / 6
    # judged by the conforming levels, as if there were no exact solution
    content["reference"] = {"kind": "conforming", "size": h, "levels": 3}
    case = Scene.model_validate(content)
    solver = find_solver("reference")
    levels = {level: solver.solve(case, level) for level in range(solver.levels(case))}
    law = hooke(case.material)
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    body = body_of(case, exact.singular_points)
    stated = conforming_reference(case, levels, body, law, Rules(body, h / 8))
    truth = exact_reference(case, exact, body, law)
    finest = Measured(levels[2], body, law, case)
    area, line = area_rule(body, h / 24, grading=0.3), cut_rule(body, h / 64)
    errors = {
        "displacement_l2": displacement_error(finest.field, exact, area),
        "energy_norm": energy_error(finest.field, exact, area, law),
        "jump_l2": jump_error(finest.field, exact, line),
    }
    for metric, error in errors.items():
        assert error.absolute <= stated.norms[metric], metric
        # a bound that is ten times too wide would be useless
        assert stated.norms[metric] < 10 * error.absolute, metric
    for quantity, (value, width) in truth.quantities.items():
        found, half_width = stated.quantities[quantity]
        assert abs(found - value) <= half_width + width, quantity

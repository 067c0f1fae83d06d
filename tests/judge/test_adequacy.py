"""Cost of a model in error: it is said beside the verdict, by the run, and does not move it."""

import re
from types import SimpleNamespace

import pytest
import scenes
from pydantic import ValidationError

from verify.compare.hooke import law_of, strain_energy
from verify.judge import models
from verify.judge.accuracy import assess_accuracy
from verify.judge.models import adequacy_notice, coarsest, on_one_level, other_scene
from verify.result import CaseResult, Metric, NoticeKind, ReferenceRecord, SolveRecord, Status
from verify.runner.fingerprint import physics_digest
from verify.scene import Scene, scene_hash
from verify.solvers import find_solver

CASE = {
    "geometry": scenes.box([0.4, 0.1]),
    "mesh": {"cells": [[4, 2]]},
    "material": {"young": 1e3, "poisson": 0.3, "plane": "strain", "density": 100.0},
    "supports": [{"where": "left", "displacement": [0.0, 0.0]}],
    "loads": [{"kind": "gravity", "acceleration": [0.0, -0.13]}],
    "reference": {"size": 0.03},
    "quantities": [
        {"kind": "strain_energy"},
        {"kind": "displacement", "name": "sag", "point": [0.4, 0.05], "component": "y"},
    ],
}


def scene(**changes) -> Scene:
    return scenes.scene(**CASE | changes)


def test_a_beam_that_bends_far_says_what_linear_kinematics_costs() -> None:
    """The difference that is said is that of the energies of both references by themselves."""
    one = scene(adequacy={"kinematics": True})
    other = other_scene(one, "kinematics")
    reference = find_solver("reference")
    own, beside = ({k: reference.solve(s, k, 0) for k in range(3)} for s in (one, other))
    judged = find_solver("conforming").solve(one, 0, 0)
    record = SolveRecord("scene", "conforming", 0, Status.SOLVED, size=judged.size, unknowns=10)
    result = assess_accuracy(one, [record], {"conforming": {0: judged}, "reference": own})
    notice = adequacy_notice(one, "kinematics", beside, result)
    assert notice.kind is NoticeKind.ADEQUACY
    rich = strain_energy(beside[2], law_of(other))
    poor = strain_energy(own[2], law_of(one))
    assert "in strain_energy" in notice.text, notice.text
    said = float(re.search(r"([\d.]+) % \(± [^)]*\) in strain_energy", notice.text)[1])  # type: ignore[index]
    assert said == pytest.approx(100 * abs(poor / rich - 1), rel=0.06)  # two digits
    assert said > 0.5
    assert notice.text.startswith("linear kinematics against finite rotation: ")


def test_the_question_does_not_change_the_scene_that_is_solved() -> None:
    """References stay in the cache; the other scene asks nothing further."""
    asked, plain = scene(adequacy={"kinematics": True}), scene()
    assert physics_digest(asked) == physics_digest(plain)
    assert scene_hash(asked) == scene_hash(plain)
    other = other_scene(asked, "kinematics")
    assert not other.adequacy.models
    assert other.analysis.kinematics == "corotational"
    assert other.reference.levels == 3


def test_hookes_law_at_finite_rotation_is_the_cheaper_one_whichever_is_asked() -> None:
    one = scene(adequacy={"material": True}, analysis={"kinematics": "finite_rotation"})
    other = other_scene(one, "material")
    assert (other.material.model, other.analysis.kinematics) == ("neo_hookean", "corotational")
    assert other_scene(other, "material").material.model == "hooke"


@pytest.mark.parametrize(("key", "levels"), [
    ("sizes", [0.2, 0.1, 0.05]), ("cells", [[2, 1], [4, 2], [8, 4]]),
])  # fmt: skip
def test_levels_are_chosen_whether_a_case_gives_sizes_or_cells(key, levels) -> None:
    one = scene(mesh={key: levels})
    for chosen, kept in ((on_one_level(one, 1), levels[1:2]), (coarsest(one, 2), levels[:2])):
        assert list(map(list if key == "cells" else float, getattr(chosen.mesh, key))) == kept


def test_the_share_is_as_uncertain_as_both_energies_make_it(monkeypatch) -> None:
    """1.30 ± 0.01 against 1.00 ± 0.04: at most 1.31/0.96 − 1 = 36.5 %, where 30 % are said."""
    one = scene(adequacy={"kinematics": True})
    rich = SimpleNamespace(quantities={"strain_energy": (1.0, 0.04)})
    monkeypatch.setattr(models, "conforming_reference", lambda *_: rich)
    for value, said in ((1.3, "30 % (± 6 %)"), (1.02, "no more than 7.3 %")):
        poor = Metric("strain_energy", value, "J/m", value, 0.01, "conforming")
        solve = SolveRecord("scene", "xfem", 0, Status.SOLVED, metrics=[poor])
        result = CaseResult("scene", "", "", "", {}, ReferenceRecord(), [solve], [], [])
        text = adequacy_notice(one, "kinematics", {}, result).text
        assert text.endswith(f": {said} in strain_energy")


def test_the_other_reference_of_a_body_without_a_size_follows_its_area() -> None:
    small, large = (
        other_scene(scene(geometry=scenes.box([0.4 * s, 0.1 * s]), reference={"levels": 3},
                          quantities=[{"kind": "strain_energy"}],
                          adequacy={"kinematics": True}), "kinematics")
        for s in (1.0, 2.0)
    )  # fmt: skip
    assert large.reference.size == pytest.approx(2 * small.reference.size, rel=1e-12)
    assert 0.0 < small.reference.size < 0.1


def test_the_static_answer_bears_the_last_body_force_and_traction() -> None:
    history = [[0.0, 0.0], [0.5, 2.0], [1.0, 3.0]]
    moving = scene(
        analysis={"kind": "dynamic", "duration": 1.0, "time_step": 0.1}, adequacy={"motion": True},
        loads=[{"kind": "body_force", "force": [0.5, -1.0], "history": history},
               {"kind": "traction", "where": "right", "traction": [0.2, 0.4], "history": history}],
    )  # fmt: skip
    other = other_scene(moving, "motion")
    assert other.analysis.kind == "static"
    force, traction = other.loads
    assert list(force.force) == [1.5, -3.0]
    assert list(traction.traction) == pytest.approx([0.6, 1.2], rel=1e-15)
    with pytest.raises(ValidationError, match="dynamic"):
        scene(adequacy={"motion": True})

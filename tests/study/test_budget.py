"""Error budget: differences are found with their source; the cheapest adequate model."""

import numpy as np
import pytest

from verify.compare.body import body_of
from verify.compare.cut_deviation import polylines_of
from verify.compare.hooke import hooke
from verify.compare.motion import ExactMotion
from verify.result import Verdict
from verify.scene import load_scene
from verify.study.budget import Candidate, cheapest_adequate
from verify.study.budget_chain import Answer, error_budget


class Affine:
    """u = a (x, 0)."""

    def __init__(self, a):
        self.a = a

    def displacement(self, points, near=None):
        return self.a * points * [1.0, 0.0]

    def gradient(self, points, near=None):
        found = np.zeros((len(points), 2, 2))
        found[:, 0, 0] = self.a
        return found


SCENE = "statics/f1_patch"


def chain(*strains, width=0.0):
    names = ["", "model", "mesh", "solver"]
    return [
        Answer(
            f"link {i}",
            names[i],
            ExactMotion(Affine(a)),
            {"length": (a, width)},
            {"displacement_l2": width},
        )
        for i, a in enumerate(strains)
    ]


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENE)


def budgets(scene, links):
    found = error_budget(links, body_of(scene), 0.1, hooke(scene.material), {"length": "m"})
    return {budget.metric: budget for budget in found}


def test_each_source_gets_what_it_changed(scene):
    """Strains 1 → 1.1 → 1.05 → 1.08: parts +10 %, −5 %, +3 %, as lengths in the norms."""
    found = budgets(scene, chain(1.0, 1.1, 1.05, 1.08))
    signed = [part.value for part in found["length"].parts]
    np.testing.assert_allclose(signed, [0.1, -0.05, 0.03], rtol=1e-12)
    for metric in ("displacement_l2", "energy_norm"):
        lengths = [part.value for part in found[metric].parts]
        np.testing.assert_allclose(lengths, np.abs(signed), rtol=1e-10)
        assert found[metric].total.value == pytest.approx(0.08, rel=1e-10)
        assert found[metric].closes
    assert found["length"].closes
    assert found["length"].largest.source == "model"


def test_uncertain_links_make_both_of_their_parts_uncertain(scene):
    links = chain(1.0, 1.1, 1.05)
    links[1] = Answer(
        "", "model", ExactMotion(Affine(1.1)), {"length": (1.1, 0.01)}, {"displacement_l2": 0.0}
    )
    found = budgets(scene, links)["length"]
    assert [part.uncertainty for part in found.parts] == pytest.approx([0.01, 0.01])
    assert found.total.uncertainty == 0.0


def candidate(kinematics, error, seconds, width=0.0, spread=0.01, reason=""):
    low, high = error - width, error + width
    times = (seconds, seconds * (1 - spread), seconds * (1 + spread))
    return Candidate(kinematics, "", 0, 0.1, 100, error, low, high, *times, reason)


def test_the_fastest_of_the_adequate_is_taken_not_the_most_accurate():
    tried = [
        candidate("linear", 0.20, 0.001),
        candidate("corotational", 0.01, 0.010),
        candidate("corotational", 0.04, 0.005),
    ]
    found, finding = cheapest_adequate(tried, 0.05, "displacement_l2")
    assert found is tried[2]
    assert finding.verdict is Verdict.PASS
    assert "Linear kinematics is not adequate on any mesh tried (20 % at best)" in finding.sentence


@pytest.mark.parametrize(
    ("rival", "verdict", "said"),
    [
        (candidate("linear", 0.06, 0.001, width=0.02), "UNDECIDED", "may be adequate"),
        (candidate("linear", 0.01, 0.0101), "UNDECIDED", "cannot be told"),
        (candidate("linear", 0.03, 0.001), "PASS", "Corotational kinematics needs 10 ms"),
    ],
)
def test_where_both_are_adequate_the_faster_wins_if_it_can_be_told(rival, verdict, said):
    tried = [candidate("corotational", 0.01, 0.010), rival]
    found, finding = cheapest_adequate(tried, 0.05, "displacement_l2")
    assert finding.verdict is Verdict(verdict)
    assert verdict == "UNDECIDED" or found is rival
    assert said in finding.sentence


def test_segments_in_any_order_and_direction_become_the_polylines_they_are():
    bent = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [3.0, 2.0]])
    branch = np.array([[2.0, 1.0], [2.0, 2.0]])
    segments = [bent[i : i + 2] for i in range(4)] + [branch]
    rng = np.random.default_rng(3)
    for _ in range(20):
        order = rng.permutation(len(segments))
        flipped = [segments[i][:: rng.choice([-1, 1])] for i in order]
        lines = polylines_of(np.array(flipped))
        sizes = sorted(len(line) for line in lines)
        assert sizes == [2, 2, 3]  # the middle of the straight part is no corner
        total = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)
        assert total == pytest.approx(2 + 1 + np.sqrt(2) + 1)

"""Formulas that are no finite number where they are used are refused before a run."""

import pytest
from scenes import scene, soft

from verify.errors import InputError
from verify.runner.checking import check_scene

HELD = {"where": "left", "displacement": [0.0, 0.0]}
CUT = {"kind": "polyline", "points": [[-0.1, 0.42], [0.6, 0.55]]}


def _face(pressure):
    return {"loads": [{"kind": "cut_faces", "pressure": pressure}]}


def _top(traction):
    return {"loads": [{"kind": "traction", "where": "top", "traction": [traction, 0.0]}]}


def _moving(**more):
    rest = {"material": soft(density=1.0), "analysis": {"kind": "dynamic", "duration": 2.0}}
    return rest | more


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"supports": [HELD, {"where": "right", "displacement": ["1/y", 0.0]}]}, "supports[1]"),
        (_top("sqrt(x - 2)"), "loads[0].traction"),
        (_top("sqrt(0.6 - x)"), "loads[0].traction"),
        ({"loads": [{"kind": "body_force", "force": ["1/(x-x)", 0.0]}]}, "loads[0].force"),
        (_face("sqrt(x - 0.3)"), "loads[0]"),
        (_moving(**_top("1/(t - 2)")), "at 2 s"),
        (_moving(initial={"kind": "field", "velocity": ["sqrt(-y)", 0.0]}), "initial.velocity"),
    ],
)
def test_a_formula_without_a_value_where_it_is_used_is_refused(changes, said):
    with pytest.raises(InputError, match="is no finite number at") as error:
        check_scene(scene(**{"supports": [HELD], "cuts": [CUT]} | changes))
    assert said in str(error.value)


@pytest.mark.parametrize("changes", [_top("1 / x"), _top("sqrt(x)"), _face("sqrt(0.6 - x)")])
def test_a_formula_may_have_no_value_where_it_is_not_used(changes):
    check_scene(scene(**{"supports": [HELD], "cuts": [CUT]} | changes))

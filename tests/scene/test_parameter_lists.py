"""Cases with a list of values for a parameter: one scene per value, and faults of such files."""

import json

import pytest
from test_case_file_faults import WHOLE

from verify.errors import InputError
from verify.runner.selection import select_cases
from verify.scene import load_scene, load_scenes, restore_scene, scene_content

FAMILY = WHOLE.replace("young = 1e4", 'young = "1e4 * (1 + epsilon)"')
ROWS = "[parameters]\nepsilon = [0.5, 1e-12, 0.0]\n"


def family(folder, text, rows=ROWS):
    path = folder / "case.toml"
    path.write_text(text + rows)
    return path


def test_a_case_has_one_scene_per_value(tmp_path):
    path = family(tmp_path, FAMILY)
    scenes = load_scenes(path)
    assert [scene.material.young for scene in scenes] == [1.5e4, 1e4 * (1 + 1e-12), 1e4]
    labels = ["[epsilon=0.5]", "[epsilon=1e-12]", "[epsilon=0]"]
    assert [scene.name for scene in scenes] == [f"case{label}" for label in labels]
    assert [scene.row.value for scene in scenes] == [0.5, 1e-12, 0.0]
    assert scenes[1].title.endswith(", epsilon = 1e-12")
    one = load_scene(f"{path}[epsilon=0.50]")
    assert one == scenes[0]
    restored = restore_scene(json.loads(json.dumps(scene_content(one))))
    assert (restored, restored.row, restored.name) == (one, one.row, one.name)


def test_fields_and_regions_keep_their_coordinates(tmp_path):
    text = FAMILY + (
        '[[loads]]\nkind = "body_force"\nforce = ["epsilon * x", "2 * epsilon"]\n'
        '[[supports]]\nwhere = "x <= epsilon"\ndisplacement = [0.0, 0.0]\n'
    )
    scene = load_scenes(family(tmp_path, text))[0]
    assert scene.loads[-1].force == ["(0.5) * x", 1.0]
    assert scene.supports[-1].where == "x <= (0.5)"


def test_a_table_may_hold_in_some_rows_only(tmp_path):
    check = '[[acceptance]]\nwhen = "{}"\ncheck = "ratio"\nmetric = "displacement_l2"\n{}\n'
    near = check.format("0 < epsilon <= 1e-2", "row = 0.0\nwithin = 0.05")
    far = check.format("epsilon > 1e-2", "at_most = 1.25")
    path = family(tmp_path, FAMILY + near + far)
    far_row, near_row, base = load_scenes(path)
    count = len(base.acceptance)
    assert [len(s.acceptance) - count for s in (far_row, near_row)] == [1, 1]
    assert [(s.acceptance[-1].row, s.acceptance[-1].compared) for s in (far_row, near_row)] == [
        (None, "conforming"), (0.0, None),
    ]  # fmt: skip
    # the row that another is compared with comes with it
    names = [scene.row.value for scene in select_cases([f"{path}[epsilon=1e-12]"])]
    assert names == [1e-12, 0.0]
    assert [s.row.value for s in select_cases([str(path)], "epsilon=0.5")] == [0.5]


@pytest.mark.parametrize(
    ("text", "rows", "message"),
    [
        (FAMILY, "[parameters]\nepsilon = 0.5\n", r"parameters.epsilon: expected 1 to 64 numbers"),
        (FAMILY, '[parameters]\nepsilon = [0.5, "x"]\n', r"epsilon\[1\]: expected a finite number"),
        (FAMILY, "[parameters]\nepsilon = [0.5, nan]\n", r"epsilon\[1\]: expected a finite number"),
        (FAMILY, "[parameters]\nepsilon = [true]\n", r"epsilon\[0\]: expected a finite number"),
        (FAMILY, "[parameters]\nepsilon = [0.5, 0.50]\n", r"\[epsilon=0.5\] is listed twice"),
        (FAMILY, "[parameters]\nx = [0.5]\n", "parameter"),
        (FAMILY, "[parameters]\nepsilon = [1.0]\nh = [1.0]\n", "expected one parameter"),
        (WHOLE, ROWS, "epsilon"),
        (FAMILY.replace("(1 + eps", "open(eps"), ROWS, "material.young: .*open.* is not allowed"),
        (FAMILY.replace("(1 + eps", "(0 * eps"), ROWS, r"case.toml\[epsilon=0.5\]: material.young"),
        (FAMILY.replace("(1 +", "1 / (0.5 -"), ROWS, "no finite number"),
        (FAMILY.replace("1 + epsilon", "1 + epsilom"), ROWS, "no text of the case uses"),
        (FAMILY + '[[cuts]]\nwhen = "5 > 3"\n', ROWS, r"cuts\[.\].when: .*does not use"),
        (FAMILY + '[[cuts]]\nwhen = "epsilon"\n', ROWS, r"cuts\[.\].when: .*inequality"),
        (FAMILY, "", "material.young: expected a finite number"),
    ],
)  # fmt: skip
def test_faults_are_one_clear_line(tmp_path, text, rows, message):
    with pytest.raises(InputError, match=message) as caught:
        load_scenes(family(tmp_path, text, rows))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("", r"it has 3 rows; name one, e.g. '.*case.toml\[epsilon=0.5\]'"),
        ("[epsilon=0.7]", r"no row '\[epsilon=0.7\]'; it has \[epsilon=0.5\], "),
        ("[h=0.5]", "no row"),
        ("[epsilon=big]", "no row"),
    ],
)
def test_a_row_that_there_is_not(tmp_path, source, message):
    with pytest.raises(InputError, match=message):
        load_scene(f"{family(tmp_path, FAMILY)}{source}")
    with pytest.raises(InputError, match="has no parameters"):
        load_scene(f"{family(tmp_path, WHOLE, '')}[epsilon=0.5]")


@pytest.mark.parametrize(
    ("row", "message"),
    [("row = 0.25", "no row 0.25; the case has 0.5, 1e-12, 0"), ("row = 0.5", "with itself")],
)
def test_a_check_names_another_row(tmp_path, row, message):
    check = f'[[acceptance]]\ncheck = "ratio"\nmetric = "displacement_l2"\n{row}\nwithin = 0.1\n'
    with pytest.raises(InputError, match=message):
        load_scenes(family(tmp_path, FAMILY + check))


def test_the_name_of_a_folder_stands_for_its_cases_that_are_not_heavy():
    names = [scene.name for scene in select_cases(["controls"])]
    assert names
    assert names == [scene.name for scene in select_cases(["controls/*"])]
    # values.toml lies beside them and is no case
    assert {scene.name.split("/")[0] for scene in select_cases(["benchmark"])} == {"benchmark"}

"""Selection of cases by a command line."""

import pytest

from verify.errors import InputError
from verify.runner import selection
from verify.runner.selection import select_cases
from verify.scene import load_scene

CASES = {
    "statics/patch": ("F1 patch", ["demo", "quick"]),
    "statics/tissue": ("A hanging strip", ["demo"]),
    "statics/long": ("Fine Griffith crack", ["heavy"]),
    "dynamics/fall": ("Free fall", []),
}


@pytest.fixture(autouse=True)
def _project(tmp_path, monkeypatch, case_text):
    from verify.scene import loading

    for name, (title, tags) in CASES.items():
        path = tmp_path / f"{name}.toml"
        path.parent.mkdir(exist_ok=True)
        text = case_text.replace("A stretched square", title).replace('["stretched"]', str(tags))
        path.write_text(text.replace("'", '"'))
    monkeypatch.setattr(loading, "case_folder", lambda: tmp_path)
    monkeypatch.setattr(selection, "list_cases", lambda: loading.list_cases(tmp_path))


def names(*arguments, **options):
    return {scene.name.partition("/")[2] for scene in select_cases(*arguments, **options)}


def test_by_default_all_but_the_heavy_ones_run():
    assert names() == {"patch", "tissue", "fall"}
    assert names(weight="quick") == {"patch"}
    assert names(weight="heavy") == {"patch", "tissue", "fall", "long"}


def test_a_case_that_is_named_runs_whatever_its_weight():
    assert names(["statics/long"]) == {"long"}
    assert names(["statics/tissue"], weight="quick") == {"tissue"}
    assert names(["statics/*"]) == {"patch", "tissue"}


@pytest.mark.parametrize(
    "expression, expected",
    [
        ("demo", {"patch", "tissue"}),
        ("DEMO and not tissue", {"patch"}),
        ("demo or fall", {"patch", "tissue", "fall"}),
        ("not demo", {"fall"}),
        ("not (demo or fall)", set()),
        ("not not demo and strip", {"tissue"}),
        ("strip or patch and fall", {"tissue"}),  # and binds tighter
        ("(strip or patch) and demo", {"patch", "tissue"}),
        ("hanging", {"tissue"}),
        ("dynamics/", {"fall"}),
        ("nothing", set()),
    ],
)
def test_an_expression_looks_into_name_title_and_tags(expression, expected):
    assert names([], expression) == expected


def test_two_cases_of_one_name_are_refused(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "yours").mkdir()
    text = (tmp_path / "dynamics/fall.toml").read_text()
    for folder in ("mine", "yours"):
        (tmp_path / folder / "own.toml").write_text(text)
    loaded = {load_scene(tmp_path / f / "own.toml").name for f in ("mine", "yours")}
    if len(loaded) == 1:
        with pytest.raises(InputError, match="another case is called"):
            select_cases([str(tmp_path / f / "own.toml") for f in ("mine", "yours")])
    else:
        assert loaded == {"mine/own", "yours/own"}  # below the case folder paths tell them apart

"""A guest that cannot be loaded: what failed, in which file and line, and what was expected."""

import pytest

from verify.errors import InputError
from verify.solvers import find_solver

GUESTS = {
    "syntax": ("import os\nclass A\n", ["SyntaxError", "syntax.py:2"]),
    "raises": (
        "class A:\n    def __init__(self):\n        {}['young']\n",
        ["young", "raises.py:3"],
    ),
    "imports": ("\nfrom verify.scene import Nothing\n", ["Nothing", "imports.py:2"]),
    "needs": ("import numpy\nimport no_such_thing\n", ["'no_such_thing'", "needs.py:2"]),
    "leaves": ("raise SystemExit('not today')\n", ["not today", "leaves.py:1"]),
    "asks": ("class A:\n    def __init__(self, more): ...\n", ["'more'", "without arguments"]),
    "lacks": ("class A:\n    def refuses(self, scene): ...\n", ["has no levels()", "solve"]),
    "gives": ("def A(): ...\n", ["has no refuses()"]),
}


@pytest.mark.parametrize("name", GUESTS)
def test_a_guest_that_cannot_be_loaded_is_said_with_file_and_line(name, tmp_path, monkeypatch):
    text, tokens = GUESTS[name]
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError) as said:
        find_solver(f"{name}:A")
    for token in (f"'{name}:A'", *tokens):
        assert token in str(said.value)


@pytest.mark.parametrize(
    "name, token",
    [
        ("no_such_module:A", "no module 'no_such_module'"),
        (":A", "MODULE:CLASS"),
        ("json:", "MODULE:CLASS"),
        ("json:Solver", "no 'Solver'"),
    ],
)
def test_a_name_of_no_class_says_what_was_expected(name, token):
    with pytest.raises(InputError, match=token):
        find_solver(name)

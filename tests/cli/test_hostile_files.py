"""Files made to do harm: one clear line within seconds, exit code 2, nothing left behind."""

import time

import pytest
from command_line import without_waits

from verify.cli import main
from verify.csv_files import csv_text
from verify.printable import one_line, visible
from verify.scene import case_folder

PATCH = (case_folder() / "statics" / "f1_patch.toml").read_text()
NESTED = '{"a":' * 90_000
DEEP = '{"schema": 1, "scene": ' + '{"a": ' * 700 + "1" + "}" * 701
UPPER = "upper = [1.0, 1.0]"

CASES = {
    "nested 900 deep": (UPPER, f"upper = {'[' * 900}{']' * 900}", "nested too deep; expected at"),
    "5000 digits": ("poisson = 0.3", f"poisson = {'9' * 5000}", "not valid TOML: Exceeds"),
    "1e308": (UPPER, "upper = [1.0, 1e308]", "geometry.upper[1]: expected a number ≤ 1e+60"),
    "dotted key": ("[material]", f"{'a.' * 20_000}a = 1\n[material]", "a key of more than"),
    "key of 10 MB": ("[material]", f"{'a' * 10**7} = 1\n[material]", "has 10 MB; expected a case"),
    "long inequality": (
        'where = "boundary"',
        f'where = "{" or ".join(["x < 1"] * 100_000)}"',
        "characters; expected at most 2000",
    ),
    "escape in the title": ('title = "', 'title = "\\u001b[2J', "title: expected one line of text"),
    "mark of direction": ('title = "', 'title = "\\u202e', "title: expected one line of text"),
}  # fmt: skip


def refused(capsys, arguments, said, code=2):
    """One line on standard error, in time."""
    start = time.process_time()
    try:
        found = main([str(argument) for argument in arguments])
    except SystemExit as leaving:
        found = leaving.code
    assert time.process_time() - start < 15
    captured = capsys.readouterr()
    assert said in captured.err
    assert without_waits(captured.err).count("\n") == 1
    assert len(captured.err) < 5000
    assert "\x1b" not in captured.err
    assert captured.out == ""
    assert found == code


@pytest.mark.parametrize("fault", CASES)
def test_a_hostile_case_file_is_refused(tmp_path, monkeypatch, capsys, fault):
    old, new, said = CASES[fault]
    assert old in PATCH
    (tmp_path / "own.toml").write_text(PATCH.replace(old, new, 1))
    monkeypatch.chdir(tmp_path)
    refused(capsys, ["run", "own.toml", "--out", "out"], said)
    assert [path.name for path in tmp_path.iterdir()] == ["own.toml"]


@pytest.mark.parametrize("content", [NESTED, DEEP, '{"schema": 1, "n": ' + "9" * 5000 + "}"])
def test_json_that_is_too_deep_or_too_long_is_one_line(tmp_path, capsys, content):
    run, answers = tmp_path / "run", tmp_path / "answers" / "level-0"
    for folder in (run / "cases" / "a", answers):
        folder.mkdir(parents=True)
    for file in (run / "run.json", tmp_path / "base.json", answers / "solution.json"):
        file.write_text(content)
    refused(capsys, ["baseline", "check", run, "--file", tmp_path / "base.json"], "base.json: ")
    refused(
        capsys,
        ["run", "statics/f1_patch", "--out", run, "--solver", "conforming"],
        "run.json: not a JSON file",
    )
    (run / "run.json").write_text('{"schema": 1, "finished": "now", "cases": ["a"]}')
    (run / "cases" / "a" / "result.json").write_text(content)
    refused(capsys, ["baseline", "diff", run, run], "result.json: not a JSON file")


def test_no_escape_of_others_reaches_the_terminal(tmp_path, capsys):
    (tmp_path / "\x1b[2Jown.toml").write_text("title = 3")
    assert main(["check", str(tmp_path / "\x1b[2Jown.toml")]) == 2
    said = capsys.readouterr().err
    assert "\x1b" not in said
    assert r"\x1b[2Jown.toml" in said


def test_what_is_printed_is_visible_and_short():
    assert visible("a\x1b[31m\u202eb\x9b\n\tü\ud800") == "a\\x1b[31m\\u202eb\\x9b\n\tü\\ud800"
    assert one_line("a\r\nb  c") == "a b c"
    assert len(one_line("x" * 10**7)) <= 2000


def test_no_cell_of_a_table_is_a_formula():
    rows = [{"a": '=HYPERLINK("http://x","y")', "b": -1.0}, {"a": " @SUM(A1)", "b": "-2"}]
    text = csv_text(["a", "b"], rows)
    assert text.splitlines()[1] == '"\'=HYPERLINK(""http://x"",""y"")",-1.0'
    assert text.splitlines()[2] == "' @SUM(A1),'-2"

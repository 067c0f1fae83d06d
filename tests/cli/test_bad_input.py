"""Bad input: one line, exit code 2, whatever is in files and words."""

import random
import signal
import time
from contextlib import contextmanager

import pytest
from command_line import without_waits

from verify.cli import main
from verify.printable import csv_text, one_line, visible
from verify.scene import case_folder

PATCH = (case_folder() / "statics" / "f1_patch.toml").read_text()

MATERIAL = '[material]\nyoung = 1.0\npoisson = 0.3\nplane = "strain"\n'

UPPER = "upper = [1.0, 1.0]"

BROKEN_CASES = {
    "unknown key": ("young = ", "yuong = ", "material.yuong"),
    "missing material": (MATERIAL, "", "material: missing"),
    "Poisson's ratio": ("poisson = 0.3", "poisson = -1.5", "material.poisson"),
    "cut outside": ("0.3], [1.1, 0.7]", "3.0], [1.1, 3.0]", "outside"),
    "cut through itself": ("[1.1, 0.7]]", "[1.1, 0.7], [0.5, 0.9], [0.5, 0.1]]", "intersects"),
    "exact solution": ('solution = "patch"', 'solution = "pitch"', "'patch'"),
    "parameter of it": ("slope = ", "slop = ", "'slop'"),
    "solver of a check": ('check = "value"', 'check = "value"\nsolver = "conform"', "'conforming'"),
    "nested 900 deep": (UPPER, f"upper = {'[' * 900}{']' * 900}", "nested too deep; expected at"),
    "5000 digits": ("poisson = 0.3", f"poisson = {'9' * 5000}", "not valid TOML: Exceeds"),
    "1e308": (UPPER, "upper = [1.0, 1e308]", "geometry.upper[1]: expected a number ≤ 1e+60"),
    "dotted key": ("[material]", f"{'a.' * 20_000}a = 1\n[material]", "a key of more than"),
    "key of 10 MB": ("[material]", f"{'a' * 10**7} = 1\n[material]", "has 10 MB; expected a case"),
    "long inequality": ('"boundary"', f'"{" or ".join(["x < 1"] * 100_000)}"', "at most 2000"),
    "escape in the title": ('title = "', 'title = "\\u001b[2J', "title: expected one line of text"),
    "mark of direction": ('title = "', 'title = "\\u202e', "title: expected one line of text"),
}  # fmt: skip

BROKEN_LINES = {
    "case": (["statics/f1_pach"], "'statics/f1_patch'"),
    "file": (["nowhere.toml"], "nowhere.toml"),
    "pattern": (["fluids/*"], "'fluids/*'"),
    "expression": (["-k", "demo and"], "'demo and'"),
    "timeout of zero": (["--timeout", "0"], "--timeout"),
    "timeout nan": (["--timeout", "nan"], "--timeout"),
    "no process": (["-j", "0"], "-j"),
    "negative memory": (["--memory", "-1"], "--memory"),
    "half a repetition": (["--repetitions", "1.5"], "--repetitions"),
    "solver": (["--solver", "xfen"], "'xfem'"),
    "parameter": (["statics/f1_patch", "--set", "xfem.masss=evs"], "'mass'"),
    "removed parameter": (["statics/f1_patch", "--set", "xfem.basis=shifted"], "leave it out"),
    "cluster": (["statics/f1_patch", "--cluster", "dask.json"], "'dask.json'"),
    "both weights": (["--quick", "--heavy"], "--heavy"),
    "option": (["--fast"], "--fast"),
    "misspelt option": (["--repetition", "1", "--solvr=xfem"], "did you mean '--solver'?"),
}


def refused(capsys, arguments, said):
    """One line on standard error, in time; the exit of argparse is an exit code too."""
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
    assert found == 2


@pytest.mark.parametrize(
    ("command", "fault"), [*(("check", fault) for fault in BROKEN_CASES), ("run", "unknown key")]
)
def test_a_broken_case_file_is_refused(tmp_path, monkeypatch, capsys, command, fault):
    old, new, said = BROKEN_CASES[fault]
    assert old in PATCH
    (tmp_path / "own.toml").write_text(PATCH.replace(old, new, 1))
    monkeypatch.chdir(tmp_path)
    options = ["--out", "out"] if command == "run" else []
    refused(capsys, [command, "own.toml", *options], said)
    assert [path.name for path in tmp_path.iterdir()] == ["own.toml"]


def test_what_was_removed_is_said_with_what_to_use_instead(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    refused(capsys, ["data", "anatomy"], "'verify data' was removed: for real anatomy give its")
    case = (case_folder() / "thesis" / "hand_straight.toml").read_text()
    (tmp_path / "own.toml").write_text(
        case.replace('kind = "skin"', 'kind = "skin"\nsource = "anatomy"')
    )
    refused(capsys, ["check", "own.toml"], "'geometry.source' was removed: shapes are made by")


@pytest.mark.parametrize("fault", BROKEN_LINES)
def test_a_broken_command_line_is_refused(tmp_path, monkeypatch, capsys, fault):
    arguments, said = BROKEN_LINES[fault]
    monkeypatch.chdir(tmp_path)
    refused(capsys, ["run", *arguments, "--out", "out"], said)
    assert list(tmp_path.iterdir()) == []


def test_check_says_a_line_for_every_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.toml").write_text(PATCH)
    (tmp_path / "bad.toml").write_text(PATCH.replace("young", "yuong"))
    assert main(["check", "good.toml", "bad.toml", "lost.toml"]) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("good.toml: ok (F1 patch")
    assert without_waits(captured.err).count("\n") == 2


NESTED = '{"a":' * 90_000
DEEP = '{"schema": 1, "scene": ' + '{"a": ' * 700 + "1" + "}" * 701


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


CASES = sorted(case_folder().glob("*/*.toml"))
CODES = {0, 1, 2, 3, 4, 5}
SECONDS = 30.0  # of processor time for an item; the slowest of our own cases takes less than 2
VALUES = (
    "nan", "inf", "-1", "0", "1e308", "-1e-308", "5e-324", "9" * 50, "true", '""', "[]", "{}",
    '"\\u001b[2J"', "[[[]]]", "1979-05-27", '"exact"', "0x10", "1_000", "-0.0", "''", '"=1+1"',
)  # fmt: skip


@contextmanager
def limited():
    def stop(_signal, _frame):
        raise AssertionError(f"hangs: more than {SECONDS:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def assert_said(capsys, arguments, item):
    try:
        with limited():
            code = main([str(argument) for argument in arguments])
    except SystemExit as leaving:
        code = leaving.code
    except BaseException as error:
        raise AssertionError(f"item {item}: {arguments}") from error
    captured = capsys.readouterr()
    assert code in CODES, item
    assert "\x1b" not in captured.err + captured.out, item
    if code == 2:
        assert 0 < without_waits(captured.err).count("\n") <= 2, (item, captured.err)
        assert len(captured.err) < 5000, item


def mutated_text(text, rng):
    """A case file with one to four lines, values or characters changed."""
    lines = text.splitlines()
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(lines))
        key, equals, _ = lines[at].partition("=")
        match rng.randrange(7):
            case 0:
                lines[at] = f"{key}= {rng.choice(VALUES)}" if equals else rng.choice(VALUES)
            case 1:
                del lines[at]
                lines = lines or [""]
            case 2:
                lines.insert(at, lines[rng.randrange(len(lines))])
            case 3 if lines[at]:
                place = rng.randrange(len(lines[at]))
                mark = rng.choice("[]{}\"'=.,#-+0e\x00\x1b\u202eé")
                lines[at] = lines[at][:place] + mark + lines[at][place + rng.randint(0, 1) :]
            case 4 if equals:
                lines[at] = lines[at].replace(rng.choice("0123456789"), rng.choice("0123456789"))
            case 5:
                other = rng.randrange(len(lines))
                lines[at], lines[other] = lines[other], lines[at]
            case 6 if equals:
                lines[at] = f"{key}{rng.choice('xyz_')}={lines[at].partition('=')[2]}"
    return "\n".join(lines)


def test_a_few_mutated_cases(tmp_path, capsys):
    for item in range(20):
        rng = random.Random(f"case {item}")
        source = rng.choice(CASES)
        file = tmp_path / "own.toml"
        file.write_text(mutated_text(source.read_text(), rng))
        assert_said(capsys, ["check", file], item)
        assert [path.name for path in tmp_path.iterdir()] == ["own.toml"], item

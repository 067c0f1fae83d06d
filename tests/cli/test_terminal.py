"""Words on a terminal: verdicts in colour, what a misspelt word may mean."""

import io
import sys

import pytest

from verify.cli.main import main
from verify.cli.streams import in_colour, print_line, printable_streams


class Terminal(io.StringIO):
    def isatty(self):
        return True


def printed(monkeypatch, stream, line):
    monkeypatch.setattr(sys, "stdout", stream)
    with printable_streams():
        print_line(line)
    return stream.getvalue()


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def test_the_first_verdict_of_a_line_has_a_colour_of_its_own():
    assert in_colour("a  FAIL       1 PASS") == "a  \x1b[31mFAIL\x1b[0m       1 PASS"
    assert in_colour("a  PASS") == "a  \x1b[32mPASS\x1b[0m"
    assert in_colour("PASSED") == "PASSED"


def test_only_a_terminal_gets_colours_and_no_escapes_of_others(monkeypatch):
    assert "\x1b[32m" in printed(monkeypatch, Terminal(), "a  PASS")
    assert printed(monkeypatch, io.StringIO(), "a  PASS") == "a  PASS\n"
    assert "\x1b[2J" not in printed(monkeypatch, Terminal(), "a \x1b[2J PASS")


@pytest.mark.parametrize("name, value", [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_colours_can_be_refused(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    assert printed(monkeypatch, Terminal(), "a  PASS") == "a  PASS\n"


@pytest.mark.parametrize(
    "words, meant", [(["rnu"], "run"), (["list", "--jsno"], "--json"), (["solvers", "lst"], "list")]
)
def test_misspelt_commands_and_options_get_the_nearest(capsys, words, meant):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert f"'{meant}'" in capsys.readouterr().err

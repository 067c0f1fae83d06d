"""The page on the methods is run: its commands and its example."""

import re
import shlex
from pathlib import Path

import pytest
from command_line import run_here

from verify.methods import METHODS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "theory" / "methods.md"


def blocks(language):
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.usefixtures("warm")
def test_every_command_of_the_page_succeeds(tmp_path):
    lines = [line for block in blocks("sh") for line in block.splitlines() if line.strip()]
    assert len(lines) == 2
    for line in lines:
        done = run_here(shlex.split(line)[1:], tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def test_the_example_of_the_page_prints_a_line_for_every_method(capsys):
    (example,) = blocks("python")
    exec(compile(example, str(PAGE), "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed] == list(METHODS)

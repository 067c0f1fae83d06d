"""The page on the methods is run: its commands and its example."""

import re
from pathlib import Path

from verify.methods import METHODS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "theory" / "methods.md"


def blocks(language):
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def test_the_example_of_the_page_prints_a_line_for_every_method(capsys):
    (example,) = blocks("python")
    exec(compile(example, str(PAGE), "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed] == list(METHODS)

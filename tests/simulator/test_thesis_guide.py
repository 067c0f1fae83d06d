"""The guide to the thesis' scenes is run: its commands, and its Python."""

import re
import shlex
from pathlib import Path

import pytest

from verify.cli import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guide" / "simulator.md"


def blocks(language: str) -> list[str]:
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.graphics
def test_every_command_of_the_guide_succeeds(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    assert len(lines) == 3
    for line in lines:
        assert main(shlex.split(line)[1:]) == 0, line

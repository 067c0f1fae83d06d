"""The documentation is run: every command in it, on the case that it teaches to write."""

import re
import shlex
from pathlib import Path

import pytest
from doc_pages import DOCS, blocks, commands, run_line

from verify.cli import build_parser

PAGES = ["guide/write-a-case.md", "guide/cli.md"]
ELSEWHERE = {"verify doctor"}  # what it finds is held in tests/install


@pytest.mark.parametrize("page", PAGES)
def test_every_command_of_the_page_succeeds(page: str, tmp_path: Path) -> None:
    case = blocks("guide/write-a-case.md", "toml")[0]
    # a reference four digits better than the 20 % that are asked, in a tenth of the time of eight
    case = case.replace("[48, 16], ", "") + "[reference]\nsize = 0.01\n"
    (tmp_path / "my_case.toml").write_text(case, encoding="utf-8")
    lines = commands(page)
    assert len(lines) >= 3
    for line in [line for line in lines if line not in ELSEWHERE]:
        done = run_line(line, tmp_path)
        # cli.md runs the example without its reference: its verdicts stay undecided, code 0
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def test_every_command_in_the_docs_parses() -> None:
    pages = [DOCS.parent / "README.md", *DOCS.rglob("*.md"), *DOCS.rglob("*.py")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages).replace("\\\n", " ")
    lines = re.findall(r"^(?:[!$] ?)?(verify .+)$", "\n".join(code_in(text)), flags=re.MULTILINE)
    assert len(lines) > 50
    parser = build_parser()
    for line in lines:
        words = shlex.split(re.split(r" [>|&] | &&", line)[0], comments=True)
        assert parser.parse_args(words[1:]).command, line


def code_in(text: str) -> list[str]:
    return re.findall(r"^```[^\n]*\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)

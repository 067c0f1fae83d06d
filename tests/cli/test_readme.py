"""The README counts right, and its result stands on the page that it links."""

import re

from doc_pages import ROOT
from scenes import catalogue

TEXT = (ROOT / "README.md").read_text("utf-8")


def count(pattern: str) -> int:
    (found,) = re.findall(pattern, TEXT)
    return int(found)


def test_it_can_be_read_in_three_minutes() -> None:
    assert len(TEXT.split()) <= 900


def test_its_counts_are_those_of_the_repository() -> None:
    scenes = (ROOT / "docs/benchmark/index.md").read_text("utf-8")
    listed = re.findall(r"^\| \[(C\d+)\]", scenes, flags=re.MULTILINE)
    assert count(r"\[(\d+) scenes\]\(docs/benchmark/index\.md\)") == len(listed) > 0
    shipped = {path.stem.split("_")[0].upper() for path in (ROOT / "cases/benchmark").glob("c*")}
    assert shipped == set(listed)
    shown = [rows for rows in catalogue().values() if "demo" in rows[0].tags]
    assert count(r"solves (\d+) small scenes") == len(shown)
    arena = (ROOT / "docs/results/arena/index.md").read_text("utf-8").splitlines()[0]
    assert re.search(r"\d+ solvers on \d+ cases", TEXT)[0] in arena


def test_its_result_stands_on_the_pages_that_it_links_with_the_command_that_makes_it() -> None:
    (result,) = re.findall(r"<!-- result:.*?-->\n(.*?)\n\n", TEXT, flags=re.DOTALL)
    links = re.findall(r"\]\((docs/[^)#]*)", result)
    page = "\n".join((ROOT / link).read_text("utf-8") for link in links)
    numbers = re.findall(r"(?<![\w.])\d+\.\d+", result)
    assert len(numbers) >= 2
    assert [number for number in numbers if not re.search(rf"(?<![\d.]){number}(?!\d)", page)] == []
    (command,) = re.findall(r"`(verify [^`]*)`", result)
    assert command in page

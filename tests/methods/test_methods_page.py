"""The page on the methods is run: its commands and its example."""

from doc_pages import blocks

from verify.methods import METHODS

PAGE = "theory/methods.md"


def test_the_example_of_the_page_prints_a_line_for_every_method(capsys):
    (example,) = blocks(PAGE, "python")
    exec(compile(example, PAGE, "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed] == list(METHODS)

"""The line of a log that says what happened."""

import pytest

from verify.runner.log import telling_line


@pytest.mark.parametrize(
    "text, line",
    [
        ("", "said nothing"),
        ("Traceback (most recent call last):\n  File x\nValueError: bad\n", "ValueError: bad"),
        ("Fatal Python error: Segmentation fault\n\nThread 0x1:\n  File y\n", "Segmentation fault"),
        ("one\ntwo\n", "two"),
        ("[0]PETSC ERROR: zero pivot\nbye\n", "[0]PETSC ERROR: zero pivot"),
        ("an early error\n" + "step\n" * 100, "step"),  # it went on for long: not that
        ("x" * 1000, "x" * 300),
    ],
)
def test_the_telling_line(tmp_path, text, line):
    (tmp_path / "log.txt").write_text(text)
    assert telling_line(tmp_path / "log.txt") == line


def test_a_log_that_is_not_there_or_no_text_is_no_error(tmp_path):
    assert telling_line(tmp_path / "log.txt") == "left no log"
    (tmp_path / "log.txt").write_bytes(b"\xff\xfe error\n")
    assert "error" in telling_line(tmp_path / "log.txt")

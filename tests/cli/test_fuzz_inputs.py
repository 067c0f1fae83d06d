"""Mutated files: no traceback, no hang, no file left, an exit code that the guide knows.

Each item is made of its own number alone, so that one that fails can be made again.
"""

import random
import signal
from contextlib import contextmanager

from command_line import without_waits

from verify.cli import main
from verify.scene import case_folder

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


def check_cases(tmp_path, capsys, items):
    for item in items:
        rng = random.Random(f"case {item}")
        source = rng.choice(CASES)
        file = tmp_path / "own.toml"
        file.write_text(mutated_text(source.read_text(), rng))
        assert_said(capsys, ["check", file], item)
        assert [path.name for path in tmp_path.iterdir()] == ["own.toml"], item


def test_a_few_mutated_cases(tmp_path, capsys):
    check_cases(tmp_path, capsys, range(40))

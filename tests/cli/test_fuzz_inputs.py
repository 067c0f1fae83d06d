"""Mutated files: no traceback, no hang, no file left, an exit code that the guide knows.

Each item is made of its own number alone, so that one that fails can be made again.
"""

import json
import random
import signal
import zipfile
from contextlib import contextmanager

from verify.cli import main
from verify.scene import case_folder

CASES = sorted(case_folder().glob("*/*.toml"))
CODES = {0, 1, 2, 3, 4, 5}
SECONDS = 30.0  # of processor time for an item; the slowest of our own cases takes less than 2
VALUES = (
    "nan", "inf", "-1", "0", "1e308", "-1e-308", "5e-324", "9" * 50, "true", '""', "[]", "{}",
    '"\\u001b[2J"', "[[[]]]", "1979-05-27", '"exact"', "0x10", "1_000", "-0.0", "''", '"=1+1"',
)  # fmt: skip
JSON_VALUES = (
    None, True, -1, 0, 10**39, 1e308, -1e-320, "", "\x1b[2J", "..", [], {}, [[]], "=1", "solved",
    float("nan"), float("inf"),
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
        assert 0 < captured.err.count("\n") <= 2, (item, captured.err)
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


def mutated_json(value, rng, chance=0.05):
    if rng.random() < chance:
        return rng.choice(JSON_VALUES)
    if isinstance(value, dict):
        kept = {k: mutated_json(v, rng, chance) for k, v in value.items() if rng.random() > 0.02}
        return kept | ({"surplus": 1} if rng.random() < 0.02 else {})
    return [mutated_json(v, rng, chance) for v in value] if isinstance(value, list) else value


def check_cases(tmp_path, capsys, items):
    for item in items:
        rng = random.Random(f"case {item}")
        source = rng.choice(CASES)
        file = tmp_path / "own.toml"
        file.write_text(mutated_text(source.read_text(), rng))
        assert_said(capsys, ["check", file], item)
        assert [path.name for path in tmp_path.iterdir()] == ["own.toml"], item


ENTRY = {
    "schema": 1, "key": "a" * 24, "physics": "b" * 24, "code": "c" * 24, "level": 0,
    "case": "statics/f1_patch", "files": {"solution.json": "d" * 24, "solution.vtu": "e" * 24},
    "origin": {"versions": {"dolfinx": "0.10"}, "commit": "0"}, "made": "2026-01-01",
    "record": {
        "case": "statics/f1_patch", "solver": "reference", "level": 0, "status": "solved",
        "size": 0.1, "unknowns": 10, "metrics": [], "timings": {"solve": [0.1]}, "notes": {},
    },
}  # fmt: skip
RESULT = {
    "case": "a", "title": "A", "requirement": "It shall.", "scene_hash": "0", "scene": {},
    "reference": {"kind": "exact", "source": "exact: patch", "levels": [], "metrics": {}},
    "solves": [
        {**ENTRY["record"], "solver": solver, "case": "a", "metrics": [
            {"name": "displacement_l2", "value": 0.1, "unit": "1", "uncertainty": 0.0}
        ]}
        for solver in ("xfem", "guest")
    ],
    "rates": [
        {"solver": "xfem", "metric": "displacement_l2", "order": 2.0, "uncertainty": 0.1,
         "reason": "", "pairwise": [2.0]}
    ],
    "verdicts": [
        {"check": "error", "solver": "xfem", "metric": "displacement_l2", "verdict": "PASS",
         "observed": 0.1, "low": 0.1, "high": 0.1, "limit": "≤ 1", "reason": ""}
    ],
    "schema": 1,
}  # fmt: skip
RUN = {
    "schema": 1, "cases": ["a"], "command": "verify run", "started": "now", "finished": "then",
    "options": {"jobs": 1}, "provenance": {"commit": "0", "versions": {}},
    "options_of_result": {},
}  # fmt: skip


def check_records(tmp_path, monkeypatch, capsys, items):
    """A run directory, an entry of the cache and a bundle, each of them mutated."""
    monkeypatch.setenv("VERIFY_CACHE", str(tmp_path / "cache"))
    run, entry = tmp_path / "run", tmp_path / "cache" / ("a" * 24)
    folder = run / "cases" / "a"
    folder.mkdir(parents=True)
    for item in items:
        rng = random.Random(f"record {item}")
        entry.mkdir(parents=True, exist_ok=True)
        (run / "run.json").write_text(json.dumps(mutated_json(RUN, rng, 0.02)))
        (folder / "result.json").write_text(json.dumps(mutated_json(RESULT, rng)))
        (entry / "entry.json").write_text(json.dumps(mutated_json(ENTRY, rng)))
        (entry / "solution.json").write_text(json.dumps(mutated_json({"files": ["a.vtu"]}, rng)))
        with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
            content = mutated_json({"schema": 1, "entries": [ENTRY]}, rng)
            archive.writestr("bundle.json", json.dumps(content))
        data = bytearray((tmp_path / "b.zip").read_bytes())
        if rng.random() < 0.5:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        (tmp_path / "b.zip").write_bytes(data)
        for command in (
            ["report", run], ["baseline", "diff", run, run], ["cache", "list"],
            ["run", "statics/tissue_strip", "--references", tmp_path / "b.zip",
             "--solver", "xfem", "--out", tmp_path / "out"],
            ["cache", "clear"],
        ):  # fmt: skip
            assert_said(capsys, command, item)
        assert not (tmp_path / "out").exists(), item


def test_a_few_mutated_cases(tmp_path, capsys):
    check_cases(tmp_path, capsys, range(40))


def test_a_few_mutated_records(tmp_path, monkeypatch, capsys):
    check_records(tmp_path, monkeypatch, capsys, range(20))

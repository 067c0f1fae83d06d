"""``verify baseline``: save, check, update, diff."""

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

from verify.baseline import (
    Baseline,
    Row,
    check_run,
    exit_code_of,
    read_baseline,
    read_run,
    save_run,
    update_from,
    verdict_changes,
    write_baseline,
)
from verify.baseline.difference import any_worse, meaning_lines
from verify.result import Verdict


def execute(arguments: argparse.Namespace) -> int:
    """Do what the action says."""
    actions = {"save": _save, "check": _check, "update": _update, "diff": _diff}
    return actions[arguments.action](arguments)


def _save(arguments: argparse.Namespace) -> int:
    run, file = read_run(arguments.run), arguments.file
    before = read_baseline(file) if file.exists() else Baseline()
    after, notes = save_run(before, run)
    write_baseline(after, file)
    added = _size(after) - _size(before)
    rows = [row for row in check_run(after, run, partial=True) if row.axis != "own"]
    bad = [row for row in rows if row.verdict is Verdict.FAIL]
    code = exit_code_of(bad)
    if arguments.json:
        answer = {"exit": code, "file": str(file), "added": added, "notes": notes}
        print(json.dumps({**answer, "rows": [asdict(row) for row in bad]}, indent=2))
        return code
    for note in notes:
        print(note)
    _print_rows(bad)
    print(f"{file}: {added} values added, {_size(before)} kept as they were")
    return code


def _check(arguments: argparse.Namespace) -> int:
    baseline, run = read_baseline(arguments.file), read_run(arguments.run)
    rows = check_run(baseline, run, arguments.partial)
    code = exit_code_of(rows, arguments.strict)
    if arguments.json:
        print(json.dumps({"exit": code, "rows": [asdict(row) for row in rows]}, indent=2))
        return code
    _print_rows([row for row in rows if row.verdict is not Verdict.PASS])
    counts = Counter((row.axis, row.verdict) for row in rows)
    for axis in ("own", "meaning", "independent", "reference", "speed"):
        said = ", ".join(f"{counts[axis, v]} {v}" for v in Verdict if counts[axis, v])
        if said:
            print(f"{axis:<12} {said}")
    open_ended = sum(
        1
        for case in baseline.cases.values()
        for quantity in case.quantities.values()
        if quantity.independent is None or quantity.independent.tolerance is None
    )
    if open_ended:
        print(
            f"{open_ended} quantities have no tolerance against an independent value and are "
            "held against the last own value only"
        )
    return code


def _update(arguments: argparse.Namespace) -> int:
    baseline, run = read_baseline(arguments.file), read_run(arguments.run)
    after, moves = update_from(baseline, run, arguments.only)
    moved = [move for move in moves if move.state == "moved"]
    if moved:
        write_baseline(after, arguments.file)
    code = 1 if any(move.state == "refused" for move in moves) else 0
    if arguments.json:
        answer = {"exit": code, "file": str(arguments.file), "moved": len(moved)}
        print(json.dumps({**answer, "moves": [asdict(move) for move in moves]}, indent=2))
        return code
    for move in moves:
        old, new = f"{move.old:.10g}", "–" if move.new is None else f"{move.new:.10g}"
        change = f" ({move.new / move.old - 1:+.3e})" if move.new is not None and move.old else ""
        print(f"{move.state:<8} {move.case}:{move.quantity}: {old} → {new}{change}")
        if move.reason:
            print(f"         {move.reason}")
    rest = "" if arguments.only else "; name what shall move with --only CASE:METRIC"
    print(f"{arguments.file}: {len(moved)} own values moved, no independent one{rest}")
    return code


def _diff(arguments: argparse.Namespace) -> int:
    old, new = read_run(arguments.run), read_run(arguments.other)
    changes = verdict_changes(old, new)
    code = 1 if any_worse(changes) else 0
    if arguments.json:
        answer = {"exit": code, "old": old.origin, "new": new.origin}
        answer["meaning"] = list(meaning_lines(old, new))
        print(json.dumps({**answer, "changes": [asdict(c) for c in changes]}, indent=2))
        return code
    for run, name in ((old, "old"), (new, "new")):
        commit = str(run.origin.get("commit") or "no commit")[:12]
        dirty = ", with local changes" if run.origin.get("dirty") else ""
        print(f"{name}: {run.directory} ({commit}{dirty}, {run.origin.get('date')})")
    for line in meaning_lines(old, new):
        print(line)
    for change in changes:
        verdicts = f"{change.old or '–'} → {change.new or '–'}"
        numbers = " → ".join(
            "–" if x is None else f"{x:.6g}" for x in (change.old_observed, change.new_observed)
        )
        print(f"{change.direction:<6} {change.case}: {change.check}: {verdicts} ({numbers})")
        print(f"       {change.reason}")
    counts = Counter(change.direction for change in changes)
    said = ", ".join(f"{count} {direction}" for direction, count in counts.items())
    print(said or "no verdict changed")
    return code


def _size(baseline: Baseline) -> int:
    return sum(len(case.quantities) + len(case.speed) for case in baseline.cases.values())


def _print_rows(rows: Sequence[Row]) -> None:
    for row in rows:
        place = f"{row.case}:{row.quantity}" if row.quantity else row.case
        numbers = ""
        if row.now is not None and row.stored is not None:
            numbers = f"{row.now:.10g}, stored {row.stored:.10g}: "
        print(f"{row.verdict:<9} {row.axis:<11} {place}: {numbers}{row.reason}")

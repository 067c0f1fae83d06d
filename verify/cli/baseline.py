"""Hold a finished run against stored values: did anything get worse?

Examples
--------
  verify run -k quick --out out
  verify baseline save out --file baseline.json
  verify baseline check out --file baseline.json
  verify baseline update out --file baseline.json --only statics/f1_patch:strain_energy
  verify baseline diff old-run new-run

exit codes of check and update:
  0  everything within its tolerances
  1  something is worse, or an update contradicts the independent value
  2  bad input
  3  something could not be checked: its solve failed, its case was not run or changed
  5  with --strict: something is undecided
exit codes of diff: 0, or 1 if a verdict became worse
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from verify.cli.signatures import Actions, Arg, AsJson, Run
from verify.cli.streams import print_answer

if TYPE_CHECKING:
    from verify.baseline import Baseline, Row

File = Annotated[Path, Arg("FILE", help="the baseline, to be committed")]
FILE = Path("baseline.json")


def save(run: Run, *, file: File = FILE, as_json: AsJson = False) -> int:
    """Add what the file does not know yet; nothing in it changes."""
    from verify.baseline import (
        Baseline,
        check_run,
        exit_code_of,
        read_baseline,
        read_run,
        save_run,
        write_baseline,
    )  # fmt: skip
    from verify.result import Verdict

    measured = read_run(run)
    before = read_baseline(file) if file.exists() else Baseline()
    after, notes = save_run(before, measured)
    write_baseline(after, file)
    added = _size(after) - _size(before)
    rows = [row for row in check_run(after, measured, partial=True) if row.axis != "own"]
    bad = [row for row in rows if row.verdict is Verdict.FAIL]
    code = exit_code_of(bad)
    answer = {"exit": code, "file": str(file), "added": added, "notes": notes}
    lines = [*notes, *_lines(bad)]
    lines.append(f"{file}: {added} values added, {_size(before)} kept as they were")
    return print_answer(as_json, {**answer, "rows": [asdict(row) for row in bad]}, lines, code)


def check(
    run: Run,
    *,
    file: File = FILE,
    strict: bool = False,
    partial: bool = False,
    as_json: AsJson = False,
) -> int:
    """Compare a finished run with the file.

    Parameters
    ----------
    strict
        undecided verdicts: exit code 5
    partial
        leave out cases of the file that the run was not asked for
    """
    from verify.baseline import check_run, exit_code_of, read_baseline, read_run
    from verify.result import Verdict

    baseline = read_baseline(file)
    rows = check_run(baseline, read_run(run), partial)
    code = exit_code_of(rows, strict)
    lines = list(_lines(row for row in rows if row.verdict is not Verdict.PASS))
    counts = Counter((row.axis, row.verdict) for row in rows)
    for axis in ("own", "meaning", "independent", "reference", "speed"):
        found = ", ".join(f"{counts[axis, v]} {v}" for v in Verdict if counts[axis, v])
        lines += [f"{axis:<12} {found}"] if found else []
    open_ended = sum(
        1
        for case in baseline.cases.values()
        for quantity in case.quantities.values()
        if quantity.independent is None or quantity.independent.tolerance is None
    )
    if open_ended:
        lines.append(
            f"{open_ended} quantities have no tolerance against an independent value and are "
            "held against the last own value only"
        )
    answer = {"exit": code, "rows": [asdict(row) for row in rows]}
    return print_answer(as_json, answer, lines, code)


def update(
    run: Run,
    *,
    file: File = FILE,
    only: Annotated[Sequence[str], Arg("CASE:METRIC")] = (),
    as_json: AsJson = False,
) -> int:
    """Move own values that are named, never the independent ones.

    Parameters
    ----------
    only
        what to move: CASE:METRIC or CASE:SOLVER/LEVEL/METRIC; repeat for several; without it the
        difference is shown and nothing is moved
    """
    from verify.baseline import read_baseline, read_run, update_from, write_baseline

    after, moves = update_from(read_baseline(file), read_run(run), only)
    if moved := [move for move in moves if move.state == "moved"]:
        write_baseline(after, file)
    code = 1 if any(move.state == "refused" for move in moves) else 0
    lines = []
    for move in moves:
        old, new = f"{move.old:.10g}", "–" if move.new is None else f"{move.new:.10g}"
        change = f" ({move.new / move.old - 1:+.3e})" if move.new is not None and move.old else ""
        lines.append(f"{move.state:<8} {move.case}:{move.quantity}: {old} → {new}{change}")
        lines += [f"         {move.reason}"] if move.reason else []
    rest = "" if only else "; name what shall move with --only CASE:METRIC"
    lines.append(f"{file}: {len(moved)} own values moved, no independent one{rest}")
    answer = {"exit": code, "file": str(file), "moved": len(moved)}
    return print_answer(as_json, {**answer, "moves": [asdict(move) for move in moves]}, lines, code)


def _apart(*values: float | None) -> str:
    """Write numbers with the digits that tell them apart, up to twelve."""
    written: list[str] = []
    for digits in (6, 9, 12):
        written = ["–" if x is None else f"{x:.{digits}g}" for x in values]
        if len(set(written)) > 1:
            break
    return " → ".join(written) if len(set(written)) > 1 else f"{written[0]}, unchanged"


def diff(
    run: Annotated[Path, Arg("OLD")], other: Annotated[Path, Arg("NEW")], *, as_json: AsJson = False
) -> int:
    """Show which verdicts differ between two runs.

    Parameters
    ----------
    run
        directory of a finished run
    other
        directory of a finished run
    """
    from verify.baseline import read_run, verdict_changes
    from verify.baseline.checking import any_worse, meaning_lines

    old, new = read_run(run), read_run(other)
    changes = verdict_changes(old, new)
    code = 1 if any_worse(changes) else 0
    meaning, lines = list(meaning_lines(old, new)), []
    for side, name in ((old, "old"), (new, "new")):
        commit = str(side.origin.get("commit") or "no commit")[:12]
        dirty = ", with local changes" if side.origin.get("dirty") else ""
        lines.append(f"{name}: {side.directory} ({commit}{dirty}, {side.origin.get('date')})")
    lines += meaning
    for change in changes:
        verdicts = f"{change.old or '–'} → {change.new or '–'}"
        numbers = _apart(change.old_observed, change.new_observed)
        lines.append(f"{change.direction:<6} {change.case}: {change.check}: {verdicts} ({numbers})")
        lines.append(f"       {change.reason}")
    counts = Counter(change.direction for change in changes)
    found = ", ".join(f"{count} {direction}" for direction, count in counts.items())
    answer = {"exit": code, "old": old.origin, "new": new.origin, "meaning": meaning}
    answer["changes"] = [asdict(change) for change in changes]
    return print_answer(as_json, answer, [*lines, found or "no verdict changed"], code)


def _size(baseline: "Baseline") -> int:
    return sum(len(case.quantities) + len(case.speed) for case in baseline.cases.values())


def _lines(rows: Iterable["Row"]) -> Iterator[str]:
    for row in rows:
        place = f"{row.case}:{row.quantity}" if row.quantity else row.case
        numbers = ""
        if row.now is not None and row.stored is not None:
            numbers = f"{row.now:.10g}, stored {row.stored:.10g}: "
        yield f"{row.verdict:<9} {row.axis:<11} {place}: {numbers}{row.reason}"


ACTIONS = Actions((save, check, update, diff))

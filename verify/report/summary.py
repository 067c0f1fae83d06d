"""The top of the report: what was found, in one paragraph and one table."""

from collections import Counter

from verify.report.markup import Markup, joined, tag
from verify.report.notation import error_title, metric_title, number, solver_title, with_interval
from verify.report.notices import adequacy_lines, warning_mark
from verify.report.run_directory import CaseEntry, Run
from verify.result import Status, Verdict, VerdictRecord

__all__ = ["anchor", "badge", "check_row", "check_text", "summary", "verdict_of", "verdict_table"]

_SIGNS = {
    Verdict.PASS: "✓",
    Verdict.FAIL: "✕",
    Verdict.UNDECIDED: "?",
    Verdict.ERROR: "!",
}
_CHECKS = {
    "rate": "order of the",
    "error": "",
    "ratio": "worst ratio of the",
}
_NAMED_IN_PARAGRAPH = 6


def anchor(index: int) -> str:
    """Return the identifier of the section of case number `index`."""
    return f"case-{index + 1}"


def badge(verdict: Verdict) -> Markup:
    """Return a verdict as a sign, a word and a frame: the colour says nothing of its own."""
    sign = tag("span", _SIGNS[verdict], aria_hidden="true")
    return tag("span", sign, " ", str(verdict), class_=f"verdict {verdict.lower()}")


def verdict_of(entry: CaseEntry) -> Verdict:
    """Return the verdict of a case; one without a result could not be judged."""
    return entry.result.verdict if entry.result else Verdict.ERROR


def check_text(record: VerdictRecord) -> str:
    """Return whom a check judges and what it looks at, in words."""
    return f"{solver_title(record.solver) if record.solver else 'nobody'}: {_what(record)}"


def _what(record: VerdictRecord) -> str:
    name = metric_title(record.metric) if record.check == "value" else error_title(record.metric)
    return f"{_CHECKS.get(record.check, record.check)} {name}".strip()


def summary(run: Run) -> Markup:
    """Return the paragraph that says what came out, and what to distrust."""
    judged = [(e, v) for e in run.entries if e.result for v in e.result.verdicts]
    counts = Counter(v.verdict for _, v in judged)
    cases, checks = len(run.entries), len(judged)
    solvers = len({v.solver for _, v in judged if v.solver})
    said: list[str | Markup] = [
        f"{_count(cases, 'case')} with {_count(checks, 'check')} of {_count(solvers, 'solver')}: "
        f"{counts[Verdict.PASS]} passed, {counts[Verdict.FAIL]} failed, "
        f"{counts[Verdict.UNDECIDED]} undecided, {counts[Verdict.ERROR]} not judged. "
    ]
    failed = [(e, v) for e, v in judged if v.verdict is Verdict.FAIL]
    if new := [(e, v) for e, v in failed if not v.known]:
        said.append(joined(tag("b", "Failed"), ": ", _listed(_by_solver(new, judged)), ". "))
    if known := [(e, v) for e, v in failed if v.known]:
        words = _listed(_by_solver(known, judged))
        said.append(joined(tag("b", "Failed, known findings"), ": ", words, ". "))
    open_ = [(e, v) for e, v in judged if v.verdict is Verdict.UNDECIDED]
    if undecided := [f"{e.name} ({check_text(v)}): {_clause(v.reason)}" for e, v in open_]:
        said.append(joined(tag("b", "Undecided"), ": ", _listed(undecided), ". "))
    errors = [f"{e.name}: {_clause(v.reason)}" for e, v in judged if v.verdict is Verdict.ERROR]
    errors += [f"{e.name}: {_clause(e.defect)}" for e in run.entries if e.result is None]
    if errors := list(dict.fromkeys(errors)):
        said.append(joined(tag("b", "Not judged"), ": ", _listed(errors), ". "))
    warned: dict[str, list[str]] = {}
    for e in run.entries:
        for w in e.result.warnings if e.result else []:
            whose = solver_title(w.solver) if w.solver else "every solver"
            warned.setdefault(f"{w.about} in {e.name}", []).append(whose)
    if warned:  # the text of each stands on top of its case
        doubtful = [f"{about} ({', '.join(whose)})" for about, whose in warned.items()]
        said.append(joined(tag("b", "Warned of"), ": ", _listed(doubtful), ". "))
    without = [e.name for e in run.entries if e.result and not e.result.verdicts]
    if without:
        said.append(f"No check is stated for {_listed(without)}: nothing was accepted there. ")
    solves = [s for r in run.results for s in r.solves] + [
        s for e in run.entries for s in e.unjudged
    ]
    ended = Counter(str(s.status) for s in solves if s.status is not Status.SOLVED)
    if ended:
        how = ", ".join(f"{count} {name}" for name, count in sorted(ended.items()))
        said.append(f"Of {_count(len(solves), 'solve')}, {how}; each is listed under its case. ")
    return joined(tag("p", said, class_="summary"), _warnings(run))


def _by_solver(
    failed: list[tuple[CaseEntry, VerdictRecord]], judged: list[tuple[CaseEntry, VerdictRecord]]
) -> list[str]:
    """Say of each solver what it fails, the one that fails most first."""
    counts = Counter(v.solver for _, v in failed)
    said = []
    for solver, count in counts.most_common():
        made = sum(v.solver == solver for _, v in judged)
        where: dict[str, list[str]] = {}
        for entry, record in failed:
            if record.solver == solver:
                where.setdefault(entry.name, []).append(_what(record))
        places = "; ".join(f"{name} ({', '.join(whats)})" for name, whats in where.items())
        said.append(f"{solver_title(solver)}, {count} of its {_count(made, 'check')}: {places}")
    return said


def verdict_table(run: Run) -> Markup:
    """Return all verdicts, a group of rows per case."""
    groups = []
    for index, entry in enumerate(run.entries):
        title = entry.result.title if entry.result else entry.name
        requirement = entry.result.requirement if entry.result else entry.defect
        head = tag(
            "th",
            tag("a", title, href=f"#{anchor(index)}"),
            tag("span", entry.name, class_="path"),
            tag("p", requirement, class_="requirement"),
            *(adequacy_lines(entry.result) if entry.result else []),
            colspan=3,
            scope="rowgroup",
        )
        failing = ", ".join(map(solver_title, entry.result.failing)) if entry.result else ""
        whose = tag("div", failing, class_="reason") if failing else None
        mark = warning_mark(entry.result)
        verdict = tag("td", badge(verdict_of(entry)), " ", mark, whose, class_="worst")
        rows = [tag("tr", head, verdict, class_="case-row")]
        rows += [check_row(record) for record in entry.result.verdicts] if entry.result else []
        groups.append(tag("tbody", rows))
    titles = ["check", "observed [interval]", "limit", "verdict"]
    head_row = tag("tr", [tag("th", title, scope="col") for title in titles])
    whole = tag(
        "table", tag("caption", "Verdicts"), tag("thead", head_row), groups, class_="verdicts"
    )
    return tag("div", whole, class_="scroll", tabindex="0", role="region", aria_label="Verdicts")


def check_row(record: VerdictRecord) -> Markup:
    """Return the row of one check."""
    observed = with_interval(record.observed, record.low, record.high)
    if record.check == "value":  # as many digits as the limit has beside it
        observed = number(record.observed, 10)
    return tag(
        "tr",
        tag("td", check_text(record)),
        tag("td", observed, class_="number", data_label="observed "),
        tag("td", record.limit, data_label="limit "),
        tag("td", badge(record.verdict), tag("div", _reason(record), class_="reason")),
    )


def _reason(record: VerdictRecord) -> str:
    return f"Known finding: {record.known} ({record.reason})" if record.known else record.reason


def _warnings(run: Run) -> Markup:
    said = [f"{defect}." for defect in run.defects]
    if (run.record.get("provenance") or {}).get("dirty"):
        said.append(
            "the code differed from its commit when this ran: it cannot be reproduced from it."
        )
    return joined(*(tag("p", "Note: " + sentence, class_="warning") for sentence in said))


def _listed(parts: list[str]) -> str:
    rest = len(parts) - _NAMED_IN_PARAGRAPH
    shown = "; ".join(parts[:_NAMED_IN_PARAGRAPH])
    return shown if rest <= 0 else f"{shown}; and {rest} more in the table"


def _clause(sentence: str) -> str:
    return sentence.rstrip(". ") or "no reason given"


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"

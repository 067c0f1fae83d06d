"""Notices of a case: warnings as a banner and a mark beside its badge, missing values as rows."""

from verify.report.markup import Markup, joined, tag
from verify.report.notation import metric_title, solver_title
from verify.result import CaseResult, Notice, NoticeKind

__all__ = ["adequacy_lines", "unavailable_rows", "warning_banner", "warning_mark"]


def warning_mark(result: CaseResult | None) -> Markup | None:
    """Return the mark that stands beside the badge of a case with warnings."""
    count = len(result.warnings) if result else 0
    if not count:
        return None
    sign = tag("span", "⚠", aria_hidden="true")
    return tag("span", sign, f" {count} warning{'s' * (count > 1)}", class_="verdict doubtful")


def warning_banner(result: CaseResult) -> Markup | None:
    """Return all warnings of a case as one banner, a paragraph for each."""
    if not result.warnings:
        return None
    said = [
        tag("p", tag("b", "Warning, ", _about(notice)), ": ", notice.text, class_="warning")
        for notice in result.warnings
    ]
    return tag("div", said, class_="banner", role="alert")


def adequacy_lines(result: CaseResult) -> list[Markup]:
    """Return a line for each other model that was measured beside the case's own."""
    return [
        tag("p", tag("b", "Adequacy of the model"), ": ", notice.text, class_="adequacy")
        for notice in result.notices
        if notice.kind is NoticeKind.ADEQUACY
    ]


def unavailable_rows(result: CaseResult, columns: int) -> list[Markup]:
    """Return a row of `columns` columns per quantity that was asked for and cannot be had."""
    missing = [n for n in result.notices if n.kind is NoticeKind.UNAVAILABLE]
    return [
        tag(
            "tr",
            tag("td", solver_title(notice.solver) if notice.solver else "every solver"),
            tag(
                "td",
                tag("b", metric_title(notice.about), " is not available"),
                ": ",
                notice.text,
                colspan=columns - 1,
                class_="reason",
            ),
        )
        for notice in missing
    ]


def _about(notice: Notice) -> Markup:
    return joined(f"{solver_title(notice.solver)}, " if notice.solver else "", notice.about)

"""The section of one case: pictures, curves, numbers, reference, regularisations, failures."""

from verify.report.colour_bar import colour_bar
from verify.report.curves import Curve, error_curves, limits, metric_names
from verify.report.figures_convergence import convergence_figure, error_range, required_slope
from verify.report.figures_cost import time_figure, unknowns_figure
from verify.report.markup import Markup, joined, tag
from verify.report.motion_section import motion_section
from verify.report.notation import error_title, number, number_text, solver_title
from verify.report.notices import adequacy_lines, warning_banner, warning_mark
from verify.report.opening_section import opening_section
from verify.report.pictures import CasePictures, Picture
from verify.report.run_directory import CaseEntry
from verify.report.summary import anchor, badge, verdict_of
from verify.report.tables import (
    failures_table,
    numbers_table,
    orders_table,
    reference_record,
    regularisations_table,
    times_table,
)
from verify.result import CaseResult

__all__ = ["case_section", "failed_section"]

_TURN = (
    "Drag to turn; click first, then the wheel or two fingers zoom, arrow keys turn, 0 goes back. "
    "All bodies of a figure turn together. Colours are shaded a little by the light."
)


def case_section(index: int, entry: CaseEntry, pictures: CasePictures) -> Markup:
    """Return the section of a case, number `index` of the run."""
    result = entry.result
    head = tag(
        "header",
        tag("h2", result.title if result else entry.name),
        tag(
            "p",
            badge(verdict_of(entry)),
            _whose(result),
            " ",
            warning_mark(result),
            " ",
            tag("span", entry.name, class_="path"),
        ),
        tag("p", result.requirement, class_="requirement") if result else None,
        *(adequacy_lines(result) if result else []),
    )
    if result is None:
        solved = sum(solve.status == "solved" for solve in entry.unjudged)
        body = joined(
            tag("p", f"Not judged: {entry.defect}.", class_="warning"),
            tag("p", f"{solved} of its solves had finished; running it again takes them over.")
            if entry.unjudged
            else None,
            failures_table(entry.unjudged),
        )
    else:
        body = _body(result, pictures)
    return tag("section", head, body, id=anchor(index), class_="case")


def _whose(result: CaseResult | None) -> str:
    failing = ", ".join(map(solver_title, result.failing)) if result else ""
    return f" {failing}" if failing else ""


def failed_section(index: int, entry: CaseEntry, reason: str) -> Markup:
    """Return what can be said of a case whose section cannot be made."""
    head = tag("h2", entry.name)
    said = f"This case cannot be shown: {reason}. Its numbers are in results.json."
    return tag("section", head, tag("p", said, class_="warning"), id=anchor(index), class_="case")


def _body(result: CaseResult, pictures: CasePictures) -> Markup:
    parts: list[Markup | None] = [warning_banner(result)]
    parts += [_pictures(pictures), failures_table(result.solves)]
    names = metric_names(result)
    if diagrams := [d for name in names if (d := _diagrams(result, name)) is not None]:
        curves = [curve for name in names for curve in error_curves(result, name)]
        said = tag("p", " ".join(_reservations(curves, result)), class_="quiet")
        parts += [tag("h3", "Convergence and cost"), said, *diagrams]
    parts += [opening_section(result), motion_section(result)]
    parts += [orders_table(result), numbers_table(result), times_table(result)]
    reference = reference_record(result.reference)
    parts.append(tag("h3", "Reference"))
    parts.append(reference or tag("p", "No reference is recorded for this case."))
    parts.append(tag("h3", "What was regularised"))
    parts.append(
        regularisations_table(result)
        or tag(
            "p", "No solver reported that it dropped, snapped, clamped, scaled or floored anything."
        )
    )
    return joined(*parts)


def _pictures(pictures: CasePictures) -> Markup:
    parts: list[Markup] = []
    if pictures.deformed and pictures.deformed[0].image:
        scale = "at true scale" if pictures.scale == 1 else joined("× ", number(pictures.scale, 1))
        caption = tag(
            "figcaption",
            "Deformed bodies, displacements ",
            scale,
            ", one view and one colour scale.",
        )
        parts.append(_figure(pictures.deformed, "displacement |u|", caption))
    if pictures.error and pictures.error[0].image:
        caption = tag(
            "figcaption",
            "Error of the displacement of each solver's finest solution, |u − u reference|, on the "
            "undeformed body, one colour scale, the largest first.",
        )
        parts.append(_figure(pictures.error, "error", caption))
    notes = [tag("p", note, class_="quiet") for note in pictures.notes]
    return joined(tag("div", parts, class_="pictures") if parts else None, *notes)


def _figure(group: list[Picture], bar: str, caption: Markup) -> Markup:
    width, height = group[0].view.size
    images = [
        tag(
            "div",
            tag("div", picture.title, class_="label"),
            _image(picture, width, height),
        )
        for picture in group
    ]
    shape = "tall" if height > 1.6 * width else "wide"
    row = tag("div", images, class_=f"row {shape}")
    if any(picture.turned for picture in group):
        caption = joined(caption, tag("p", _TURN, class_="quiet turn-hint"))
    return tag("figure", row, colour_bar(group[0].view, bar), caption, class_=f"n{len(group)}")


def _image(picture: Picture, width: int, height: int) -> Markup:
    image = tag("img", src=picture.address, alt=picture.description, width=width, height=height)
    if not (data := picture.turned):
        return image
    return tag("div", image, class_="turn", **{k.replace("-", "_"): v for k, v in data.items()})


def _diagrams(result: CaseResult, metric: str) -> Markup | None:
    """Return the three panels of a metric, on one error axis, and what they rest on."""
    curves = error_curves(result, metric)
    slope = required_slope(result, metric)
    y_range = error_range(curves, sloped=slope is not None)
    if y_range is None:
        return _undrawn(metric, curves)
    title = error_title(metric)
    panels = [
        convergence_figure(result, metric, curves, y_range, title),
        unknowns_figure(curves, y_range, title),
        time_figure(curves, y_range, title),
    ]
    panels = [panel for panel in panels if panel is not None]
    if not panels:
        return None
    source = next(m.source for s in result.solves if (m := s.metric(metric)) is not None)
    said = [
        f"{title[:1].upper()}{title[1:]}, against {source or 'an unnamed reference'}.",
        _floor_text(curves),
        f"The triangle has the required order, {slope[1]}." if slope else "",
    ]
    return tag(
        "figure",
        tag("div", panels, class_="panels"),
        tag("figcaption", " ".join(sentence for sentence in said if sentence)),
    )


def _undrawn(metric: str, curves: list[Curve]) -> Markup | None:
    if not curves:
        return None
    title = error_title(metric)
    said = f"{title[:1].upper()}{title[1:]}: zero on every level, so there is no logarithm to draw."
    return tag("p", said, class_="quiet")


def _floor_text(curves: list[Curve]) -> str:
    finest = max(point.level for curve in curves for point in curve.points)
    points = [point for curve in curves for point in curve.points]
    floor = max(point.uncertainty for point in points if point.level == finest)
    if floor <= 0:
        return "No uncertainty of the comparison is recorded."
    where = f"at most {number_text(floor, 2)} on the finest level"
    if any(limits(point) for point in points):
        return (
            "Bars: uncertainty of reference and integration; grey band: the least of a level; "
            f"{where}."
        )
    return f"Uncertainty of reference and integration: {where}, below 1/30 of every error."


def _phases(curve: Curve) -> list[str]:
    times = [point.duration for point in curve.points if point.duration is not None]
    return list(dict.fromkeys(name for time in times for name in time.phases))


def _reservations(curves: list[Curve], result: CaseResult) -> list[str]:
    """Return what a reader has to know before trusting the panels."""
    said = []
    if any(point.value <= 0 for curve in curves for point in curve.points):
        said.append("Errors of exactly zero are in the table only.")
    if any(curve.ends for curve in curves):
        said.append("× marks a level that did not finish: the curve ends there.")
    timed = [p.duration for c in curves for p in c.points if p.duration]
    if timed:
        phases = "; ".join(
            f"{curve.label}: {', '.join(names)}"
            for curve in {curve.label: curve for curve in curves}.values()
            if (names := _phases(curve))
        )
        counts = sorted({time.repetitions for time in timed})
        repeated = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        said.append(
            f"Timed: {phases}. Median of {repeated} repetition{'s' if counts != [1] else ''} "
            "after a first call that is not counted"
            + ("; dotted, the time with meshing." if any(t.meshing > 0 for t in timed) else ".")
        )
    said += dict.fromkeys(
        f"Timing note: {solve.notes['timing']}."
        for solve in result.solves
        if "timing" in solve.notes
    )
    return said

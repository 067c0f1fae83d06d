"""View of one case, without markup."""

from dataclasses import dataclass, field, replace

from verify.printable import words_of
from verify.report.bodies import colour_bar
from verify.report.curves import Curve, error_curves, limits, metric_names
from verify.report.error_plots import error_panel, error_range
from verify.report.notation import (
    ROUND_OFF,
    Drawing,
    Figure,
    Table,
    error_title,
    number,
    number_text,
    solver_title,
)
from verify.report.pictures import CasePictures, Picture
from verify.report.plots import Palette
from verify.report.problem import problem_facts, sketch
from verify.report.profiles import MotionView, motion_view, opening_figures
from verify.report.run_directory import CaseEntry
from verify.report.tables import MANY, case_tables, reference_facts, reference_tables
from verify.result import CaseResult, SolveRecord, Verdict, worst


@dataclass(frozen=True)
class PictureRow:
    """Pictures in one view and one scale of colours."""

    kind: str
    pictures: list[Picture]
    bar: Drawing

    @property
    def clipped(self) -> bool:
        """Whether values are above the scale."""
        return self.pictures[0].view.beyond


@dataclass
class CaseView:
    """A case on the page.

    Parameters
    ----------
    anchor, name, title : str
    verdict : Verdict
    failing : list of str
        Titles of the solvers that fail.
    by_solver : dict of str to str
        Worst verdict of each solver, by its title.
    result : CaseResult or None
    defect : str
        Why it cannot be shown; empty if it can.
    unjudged : list of SolveRecord
        Solves of a case that was not judged.
    """

    anchor: str
    name: str
    title: str
    verdict: Verdict
    result: CaseResult | None = None
    failing: list[str] = field(default_factory=list)
    by_solver: dict[str, str] = field(default_factory=dict)
    defect: str = ""
    unjudged: list[SolveRecord] = field(default_factory=list)
    warnings: list[tuple[str, str]] = field(default_factory=list)
    facts: list[tuple[str, list[str]]] = field(default_factory=list)
    sketch: Drawing | None = None
    pictures: CasePictures = field(default_factory=CasePictures)
    rows: list[PictureRow] = field(default_factory=list)
    metrics: list[str] = field(default_factory=list)
    convergence: list[Figure] = field(default_factory=list)
    convergence_notes: list[str] = field(default_factory=list)
    cost: Figure | None = None
    cost_notes: list[str] = field(default_factory=list)
    openings: list[Figure] = field(default_factory=list)
    motion: MotionView | None = None
    has_order: bool = False
    many: bool = False  # more solvers than a table of them has room for beside the figures
    tables: dict[str, Table | None] = field(default_factory=dict)
    reference: list[tuple[str, str]] = field(default_factory=list)
    reference_tables: list[Table] = field(default_factory=list)


def case_view(
    index: int, entry: CaseEntry, pictures: CasePictures, palette: Palette, drawn: bool = True
) -> CaseView:
    """Return the view of case number `index`, with notes on missing pictures, perhaps undrawn."""
    anchor, result = f"case-{index + 1}", entry.result
    if result is None:
        return CaseView(anchor, entry.name, entry.name, Verdict.ERROR,
                        defect=f"Not judged: {entry.defect}.", unjudged=entry.unjudged)  # fmt: skip
    view = CaseView(anchor, entry.name, result.title, result.verdict, result, pictures=pictures)
    try:
        _fill(view, result)
        if drawn:
            _draw(view, result, palette)
    except Exception as error:
        said = f"This case cannot be shown: {words_of(error)}. Its numbers are in results.json."
        return CaseView(anchor, entry.name, result.title, view.verdict, defect=said)
    return view


def _fill(view: CaseView, result: CaseResult) -> None:
    view.failing = [solver_title(name) for name in result.failing]
    of_solver: dict[str, list[Verdict]] = {}
    for record in result.verdicts:
        of_solver.setdefault(solver_title(record.solver or "nobody"), []).append(record.verdict)
    view.by_solver = {name: str(worst(own)) for name, own in of_solver.items()}
    for notice in result.warnings:
        whose = f"{solver_title(notice.solver)}, " if notice.solver else ""
        view.warnings.append((f"{whose}{notice.about}", notice.text))
    view.tables, view.metrics = case_tables(result), metric_names(result)
    view.many = len({solve.solver for solve in result.solves}) > MANY
    few = len({rate.solver for rate in result.rates}) <= MANY
    view.has_order = few and any(rate.order is not None for rate in result.rates)
    view.reference = reference_facts(result.reference)
    view.reference_tables = reference_tables(
        result.reference, {m.name: m.unit for s in result.solves for m in s.metrics}
    )


def _draw(view: CaseView, result: CaseResult, palette: Palette) -> None:
    try:
        view.facts, view.sketch = problem_facts(result.scene), sketch(result.scene)
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        view.facts.append(("Sketch", [f"cannot be drawn ({words_of(error)})"]))
    _convergence(view, result, palette)
    view.openings = opening_figures(result, palette)
    view.motion = motion_view(result, palette)
    show_pictures(view)


def show_pictures(view: CaseView) -> None:
    """Set the rows of pictures anew from the pictures of the case."""
    view.rows, pictures = [], view.pictures
    frames = [picture for body in pictures.film for picture in body]
    for kind, group, bar in (("deformed", pictures.deformed, "displacement |u|"),
                             ("film", frames, "displacement |u|"),
                             ("error", pictures.error, "error"),
                             ("tip", pictures.tip, "error")):  # fmt: skip
        if group and group[0].image:
            view.rows.append(PictureRow(kind, group, colour_bar(group[0].view, bar)))
            for picture in group:  # packed here, each of them
                _ = picture.turned


def _convergence(view: CaseView, result: CaseResult, palette: Palette) -> None:
    """Draw each metric over the element size, and what the first of them costs."""
    lead = _lead_metric(result)
    drawn: list[Curve] = []
    for metric in view.metrics:
        curves, said = _above_round_off(error_curves(result, metric), metric)
        view.convergence_notes += said
        slope = required_slope(result, metric)
        y_range = error_range(curves, sloped=slope is not None)
        if y_range is None:
            continue
        drawn += curves
        title = error_title(metric)
        if max(len([p for p in curve.points if p.value > 0]) for curve in curves) > 1:
            source = next(m.source for s in result.solves if (m := s.metric(metric)) is not None)
            panel = error_panel(title, curves, y_range, palette, slope=slope)
            said = [
                f"{title[:1].upper()}{title[1:]}, against {source or 'an unnamed reference'}.",
                floor_text(curves),
                f"The triangle has the required order, {slope[1]}." if slope else "",
            ]
            if panel is not None:
                view.convergence.append(Figure([panel], " ".join(filter(None, said))))
            if view.cost is None or metric == lead:
                costs = [p for over in ("unknowns", "time")
                         if (p := error_panel(title, curves, y_range, palette, over))]  # fmt: skip
                view.cost = Figure(costs) if costs else view.cost
    if drawn and not view.convergence:
        view.convergence_notes.append(
            "One level was solved: there is no convergence to draw; its errors are in the numbers."
        )
    _reservations(view, drawn, result)


def _lead_metric(result: CaseResult) -> str:
    """Return the metric of the worst check."""
    order = [Verdict.FAIL, Verdict.UNDECIDED, Verdict.ERROR, Verdict.PASS]
    judged = sorted(result.verdicts, key=lambda record: order.index(record.verdict))
    return judged[0].metric if judged else ""


def _above_round_off(curves: list[Curve], metric: str) -> tuple[list[Curve], list[str]]:
    """Leave out solvers that are exact to round-off and points that the comparison hides."""
    title = error_title(metric)
    title = f"{title[:1].upper()}{title[1:]}"
    exact = {c.label: max(p.value for p in c.points) for c in curves
             if all(p.value <= ROUND_OFF for p in c.points)}  # fmt: skip
    said = []
    if exact:
        most = max(exact.values())
        amount = f"exact to round-off (at most {number(most, 2)})" if most else "exactly zero"
        said.append(f"{title}: {amount} on every level: {', '.join(exact)}.")
    shown = []
    below: dict[str, list[str]] = {}
    for curve in curves:
        if curve.label in exact:
            continue
        hidden = [p.level for p in curve.points if p.value <= p.uncertainty]
        if hidden:
            levels = f"level{'s' * (len(hidden) > 1)} {', '.join(map(str, hidden))}"
            below.setdefault(levels, []).append(curve.label)
            kept = [[p for p in s if p.value > p.uncertainty] for s in curve.stretches]
            curve = replace(curve, stretches=[s for s in kept if s])
        if curve.points:
            shown.append(curve)
    if below:
        whose = "; ".join(f"{', '.join(who)}, {levels}" for levels, who in below.items())
        said.append(f"{title}: below the uncertainty of the comparison, and not drawn: {whose}.")
    return shown, said


def required_slope(result: CaseResult, metric: str) -> tuple[float, str] | None:
    """Return the order of convergence that the case demands of `metric`, and how it says so."""
    for check in result.scene.get("acceptance") or []:
        if (
            isinstance(check, dict)
            and check.get("check") == "rate"
            and check.get("metric") == metric
        ):
            if isinstance(order := check.get("at_least"), int | float):
                return float(order), f"≥\N{NARROW NO-BREAK SPACE}{order:g}"
            if isinstance(order := check.get("equals"), int | float):
                return float(order), f"{order:g}"
    return None


def floor_text(curves: list[Curve]) -> str:
    """Say how large the uncertainty of the comparison is beside the errors that are drawn."""
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


def _reservations(view: CaseView, curves: list[Curve], result: CaseResult) -> None:
    """Add what a reader has to know before trusting the panels."""
    if any(curve.ends for curve in curves):
        view.convergence_notes.append("× marks a level that did not finish: the curve ends there.")
    timed = [p.duration for c in curves for p in c.points if p.duration]
    if timed and view.cost:
        phases: dict[str, dict[str, None]] = {}
        for curve in curves:
            for point in curve.points:
                names = point.duration.phases if point.duration else ()
                phases.setdefault(curve.label, {}).update(dict.fromkeys(names))
        listed = "; ".join(
            f"{label}: {', '.join(names)}" for label, names in phases.items() if names
        )
        counts = sorted({time.repetitions for time in timed})
        repeated = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        view.cost_notes.append(
            f"Timed: {listed}. Median of {repeated} repetition{'s' if counts != [1] else ''} "
            "after a first call that is not counted. A mesh that conforms to the cut is paid for "
            "each cut, also by who was handed it; one that is cut afterwards is not."
        )
    notes = dict.fromkeys(s.notes["timing"] for s in result.solves if "timing" in s.notes)
    view.cost_notes += [f"Timing note: {note}." for note in notes]

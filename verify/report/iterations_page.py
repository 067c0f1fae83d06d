"""The page of a study of iterations: how many a solver needs, and whether substeps help."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from verify.report.notation import Drawing, Lead, number
from verify.report.plots import Palette, Series, loglog
from verify.report.sliver_values import listed

Settings = Sequence[Mapping[str, Any]]

_NEARER = 0.8  # of the other error: less than a fifth apart is no difference that one would pay for
_SINGLE = 1e-6  # ten of its units, of the largest displacement
_CAUSE = re.compile(r"^.*Error: | \(\S+:\d+ in \w+\)$")  # around the words of an error
_MORE = 4  # times the iterations, which an error of theirs would show


def iterations_lead(record: Mapping[str, Any]) -> Lead:
    """Return what the study answers, its work counted in iterations in a step of a case."""
    settings = record["settings"]
    caption = (
        "Distance (RMS over nodes) from the answer with the smallest steps, solved to convergence, "
        "over the largest displacement. Iterations in a step of the case: in all of its substeps."
    )
    if names := [case for case, own in _by_case(settings) if _is_round_off(own, "whole_error")]:
        caption += f" Not drawn, since all is round-off there: {', '.join(names)}."
    said = [_said_of_iterations(record), *_said_of_the_rest(record), *_said_of_time(record)]
    return Lead(
        f"How many iterations does {record['solver']} need on a cut body, and do substeps help?",
        [" ".join(said), _said_of_substeps(settings, record.get("left_out", {}))],
        iterations_panels(settings, "whole_error"), caption,
    )  # fmt: skip


def iterations_panels(settings: Settings, error: str) -> list[Drawing | None]:
    """Return a panel per case: an error over the work, a line for each number of substeps."""
    palette, panels = Palette(), []
    for case, own in _by_case(settings):
        if _is_round_off(own, error):
            continue
        places: dict[int, list[tuple[Any, Any]]] = {}
        for one in own:
            if one["iterations"]:
                places.setdefault(one["substeps"], []).append((_work(one), one[error]))
        series = [
            Series(f"{count} substep{'s' if count > 1 else ''}", curve)
            for count, curve in places.items()
        ]
        title = f"{case}: {error.replace('_', ' ')}, relative"
        ticks = sorted({work for curve in places.values() for work, _ in curve})
        panels.append(
            loglog(title, "iterations in a step of the case", series, palette, ticks=ticks)
        )
    return panels


def substeps_panels(settings: Settings) -> list[Drawing | None]:
    """Return a panel per case in motion: the whole error over substeps, by work and by counts."""
    palette, panels = Palette(), []
    for case, own in _by_case(settings):
        if _is_round_off(own, "whole_error") or own[0]["time_step"] is None:
            continue
        curves: dict[str, list[tuple[Any, Any]]] = {}
        for one in sorted(own, key=lambda one: one["substeps"]):
            if count := one["iterations"]:
                for name in (f"{_work(one)} in a step", f"{count} in each"):
                    curves.setdefault(name, []).append((one["substeps"], one["whole_error"]))
        joined: dict[tuple[tuple[int, str], ...], str] = {}  # equal as they would be written
        for name, curve in curves.items():
            if len(curve) > 1:
                key = tuple((parts, number(error, 2)) for parts, error in curve)
                joined[key] = f"{joined[key]}, {name}" if key in joined else name
        first = {name: curves[name.split(", ")[0]] for name in joined.values()}
        series = [Series(name, curve) for name, curve in first.items()]
        ticks = sorted({count for one in series for count, _ in one.places})
        title = f"{case}: whole error, relative"
        panels.append(loglog(title, "substeps", series, palette, ticks=ticks))
    return panels


def _work(one: Mapping[str, Any]) -> int:
    return int(one["iterations"] * one["substeps"])


def _is_round_off(own: Settings, error: str) -> bool:
    """Whether all errors are of the 32 bits in which solvers by descent compute."""
    return all((one[error] or 0.0) <= _SINGLE for one in own if one["iterations"])


def _by_case(settings: Settings) -> Iterator[tuple[str, Settings]]:
    for case in dict.fromkeys(one["case"] for one in settings):
        yield case, listed(settings, case=case)


def _said_of_iterations(record: Mapping[str, Any]) -> str:
    """Say the least work with which the same steps are met, for each case."""
    tolerance, met, missed, cases = record["tolerance"], [], [], list(_by_case(record["settings"]))
    for case, own in cases:
        tried = [one for one in own if one["iterations"]]
        if best := _cheapest(own, "iteration_error", tolerance):
            most = "at most " * (_work(best) == min(map(_work, tried)))
            met.append(f"{most}{_setting(best)} ({case})")
        elif tried:
            missed.append(f"{max(map(_work, tried))} are not enough on {case}")
    within = f"within {100 * tolerance:.2g} % of the same steps, solved to convergence"
    if not met:
        return f"No number comes {within}, on any of {len(cases)} cut cases: {'; '.join(missed)}."
    said = f"So many iterations in a step of the case come {within}: {', '.join(met)}"
    return f"{said}; {'; '.join(missed)}." if missed else f"{said}."


def _cheapest(own: Settings, error: str, tolerance: float) -> Mapping[str, Any] | None:
    """Return the setting of the least work whose error is within a tolerance."""
    good = [one for one in own if one["iterations"] and one[error] is not None]
    good = [one for one in good if one[error] <= tolerance]
    return min(good, key=lambda one: (_work(one), one["substeps"]), default=None)


def _setting(one: Mapping[str, Any]) -> str:
    each = f", {one['iterations']} in each of {one['substeps']} substeps"
    return f"{_work(one)}{each if one['substeps'] > 1 else ''}"


def _said_of_the_rest(record: Mapping[str, Any]) -> Iterator[str]:
    """Say what the steps themselves leave, and where more iterations do not lower an error."""
    tolerance = record["tolerance"]
    for case, own in _by_case(record["settings"]):
        met = _cheapest(own, "iteration_error", tolerance)
        if not met or met["whole_error"] is None or met["whole_error"] <= tolerance:
            continue
        best = _cheapest(own, "whole_error", tolerance)
        needed = f"it takes {_setting(best)}" if best else "no setting comes as near"
        yield (
            f"On {case} that is still {100 * met['whole_error']:.2g} % off the smallest steps: "
            f"within {100 * tolerance:.2g} % of these {needed}."
        )
    for case, own in _by_case(record["settings"]):
        left = []
        for parts in dict.fromkeys(one["substeps"] for one in own):
            series = [one for one in listed(own, substeps=parts) if one["iterations"]]
            last = series[-1] if series else {}
            few = [one for one in series if _MORE * one["iterations"] <= last["iterations"]
                   and _NEARER * (one["iteration_error"] or 0.0) <= (last["iteration_error"] or 0.0)
                   and (one["iteration_error"] or 0.0) > _SINGLE]  # fmt: skip
            if few:
                left.append(f"{number(few[0]['iteration_error'], 3)} with {few[0]['iterations']}, "
                            f"{number(last['iteration_error'], 3)} with {last['iterations']} in "
                            f"each of {parts}")  # fmt: skip
        if left:
            yield (
                f"On {case} more iterations do not help from some number on (distance from the "
                f"same steps, solved: {'; '.join(left)}): that is no error of iterations."
            )


def _said_of_time(record: Mapping[str, Any]) -> Iterator[str]:
    """Compare the most iterations with the same steps, solved, on the first case in motion."""
    for case, own in _by_case(record["settings"]):
        for solved in [one for one in own if one["iterations"] is None and one["time_step"]]:
            tried = [one for one in listed(own, substeps=solved["substeps"])
                     if one["iterations"] and one["seconds"]]  # fmt: skip
            if tried and solved["seconds"]:
                most = max(tried, key=lambda one: one["iterations"])
                yield (
                    f"{most['iterations']} iterations take {number(most['seconds'], 2)} s on "
                    f"{case}, its steps solved to convergence {number(solved['seconds'], 2)} s."
                )
                return


def _said_of_substeps(settings: Settings, left_out: Mapping[str, str]) -> str:
    """Compare the fewest and the most substeps at the largest work that both had, in motion."""
    told: dict[int, list[str]] = {1: [], -1: [], 0: []}  # better, worse, neither
    resting = [case for case, own in _by_case(settings) if own[0]["time_step"] is None]
    for case, own in _by_case(settings):
        errors = {
            (one["substeps"], _work(one)): one["whole_error"]
            for one in own
            if one["iterations"] and one["whole_error"] is not None
        }
        few, many = min((s for s, _ in errors), default=1), max((s for s, _ in errors), default=1)
        common = {w for s, w in errors if s == few} & {w for s, w in errors if s == many}
        if case in resting or few == many or not common:
            continue
        work = max(common)
        one, other = errors[few, work], errors[many, work]
        text = (
            f"{case}, {work} iterations: {number(other, 2)} with {many} substeps, "
            f"{number(one, 2)} with {few}"
        )
        told[(other < _NEARER * one) - (one < _NEARER * other)].append(text)
    compared, better = sum(map(len, told.values())), len(told[1])
    if not compared:
        said = "No case in motion has the same work with different substeps: nothing is compared."
    else:
        some = "all" if better == compared else f"{better} of" if better else "any of"
        where = f"{some} {compared} cases" if compared > 1 else "the one case"
        verb = "pay" if better else "do not pay"
        shown = "; ".join(text for own in told.values() for text in own)
        said = f"Substeps {verb} at equal work on {where} in motion. Error beside the smallest "
        said += f"steps: {shown}."
    if resting:
        said += f" {len(resting)} at rest say nothing, where steps have no error of their own: "
        said += f"{', '.join(resting)}."
    if left_out:
        said += f" {len(left_out)} left out: "
        said += "; ".join(f"{case} ({_CAUSE.sub('', why)})" for case, why in left_out.items())
        said += "."
    return said

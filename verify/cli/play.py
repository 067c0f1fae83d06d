"""``verify play``: a cutting scene step by step, drawn off-screen or shown in a window."""

import os
import shutil
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from verify.cli.signatures import Arg, Case, positive
from verify.cli.streams import print_answer
from verify.errors import InputError, UnsupportedSceneError
from verify.printable import csv_text

_QUALITY = (
    "volume_error", "loose_edges", "inverted_elements", "inverted_facets", "stray_facets",
    "largest_stretch",
)  # fmt: skip
_ACCOUNT = ("kinetic", "strain", "potential", "work", "dissipated", "contacts")
_FORCES = ("driving_force", "resistance")  # on blades, as Session.blade_forces gives them

if TYPE_CHECKING:
    from verify.scene import Scene
    from verify.simulator import Session, Stage, StepRecord
    from verify.simulator.animation import Frame
    from verify.xfem.arrays import Floats


def play(
    case: Case,
    *,
    out: Annotated[Path | None, Arg("FILE")] = None,
    window: bool = False,
    stroke: Annotated[Path, Arg("TOML")] = Path("stroke.toml"),
    frames: Annotated[int, Arg("N")] = 48,
    zoom: Annotated[float, Arg("F", read=positive)] = 1.0,
    records: Annotated[Path | None, Arg("CSV")] = None,
    tolerance: Annotated[float | None, Arg("R", read=positive)] = None,
    as_json: Annotated[bool, Arg(flags=("--json",))] = False,
) -> int:
    """Play a cutting scene as a simulator would, and show or draw it.

    Parameters
    ----------
    out
        draw off-screen into this file: .gif, .mp4 (needs ffmpeg), or .png (the last frame)
    window
        open a window
    stroke
        window: where strokes of the mouse are written
    frames
        frames drawn
    zoom
        look at the wound, F times as near (default: 1, the whole body)
    records
        write what every step cost and did
    tolerance
        residual that iterations may leave of each step's load (default: 1e-10)
    as_json
        print the summary as JSON

    Examples
    --------
      verify play thesis/hand_straight --out hand.gif
      verify play thesis/square_dissected --out square.gif --records steps.csv
      verify play thesis/hand_straight            in a window, where there is a display
      verify play my_case.toml --out a.gif --tolerance 1e-3      faster, and how far off
      verify play my_case.toml --window --stroke my_stroke.toml

    In a window the left mouse button is the scalpel; its strokes are written as cuts of kind
    tool_path that can be pasted into a case file.
    """
    in_window = window or (out is None and records is None)
    _check_outputs(out, window, stroke if in_window else None, frames, records)
    from verify.scene import load_scene

    scene = load_scene(case)
    from verify.simulator import stage_of

    try:
        stage = stage_of(scene)
    except UnsupportedSceneError as reason:
        raise InputError(f"cannot be played: {reason}", str(scene.file or scene.name)) from None
    if tolerance is not None:
        if tolerance >= 1.0:
            raise InputError(f"--tolerance {tolerance:g}: expected below 1")
        stage = replace(stage, tolerance=tolerance)
    if in_window:
        from verify.simulator.animation import play_in_window

        time, strokes = play_in_window(stage, scene.title, stroke)
        file = str(stroke) if strokes else None
        made = f"strokes of the mouse: {strokes}, in {file}" if file else "no stroke was made"
        answer = {"case": scene.name, "time": time, "strokes": strokes, "stroke": file}
        return print_answer(as_json, answer, [f"{scene.name}: closed at t = {time:.2f} s; {made}"])
    summary = _played(stage, scene, out, frames, zoom, records)
    return print_answer(as_json, summary, _words(summary))


def _check_outputs(
    out: Path | None, window: bool, stroke: Path | None, frames: int, records: Path | None
) -> None:
    """Refuse early what cannot be drawn, shown or written; `stroke` is None without a window."""
    if frames < 2:
        raise InputError(f"--frames {frames}: expected at least 2")
    if out is not None and out.suffix not in (".gif", ".mp4", ".png"):
        raise InputError(f"--out {out}: expected a name that ends in .gif, .mp4 or .png")
    if out is not None and out.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError("--out: MP4 needs the program ffmpeg, which is not in the path")
    if window and (out is not None or records is not None):
        raise InputError("--window: a window writes neither --out nor --records; leave them away")
    asked = "--window: " if window else ""
    places = [os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")]
    if stroke is not None and not any(places):
        raise InputError(f"{asked}there is no display to show it on; use --out FILE.gif")
    if (out is not None or stroke is not None) and find_spec("pyvista") is None:
        raise ModuleNotFoundError("No module named 'pyvista'", name="pyvista")
    for path in (out, records, stroke):
        if path is not None and not path.resolve().parent.is_dir():
            raise InputError(f"no directory '{path.parent}' to write into")
    if stroke is not None:
        from verify.simulator.animation import display_is_open

        if not display_is_open():
            named = ", ".join(filter(None, places))
            raise InputError(f"{asked}the display '{named}' cannot be opened; use --out FILE.gif")


def _played(
    stage: "Stage", scene: "Scene", out: Path | None, count: int, zoom: float, records: Path | None
) -> dict[str, Any]:
    """Play without a window, write the files, and return the summary."""
    from verify.files import asked_place, write_whole
    from verify.simulator import PHASES, Session, quality_of
    from verify.simulator.animation import Frame
    from verify.simulator.session import Spread

    session = Session(stage)
    every = max(1, round(stage.steps / (count - 1)))
    frames = [Frame(0.0, session.picture(), session.blades())]
    while not session.finished:
        record = session.step()
        if out is not None and (record.step % every == 0 or session.finished):
            frames.append(Frame(record.time, session.picture(), session.blades(), session.hooks()))
    taken, quality = session.records, quality_of(session)
    blades = {cut.name: session.blade_forces(k) for k, cut in enumerate(scene.cuts)}
    step = Spread.of(record.total_seconds for record in taken)
    cutting = Spread.of(record.total_seconds for record in taken if record.newly_split)
    if out is not None:
        with asked_place(out):
            _draw(frames, stage, out, zoom)
    if records is not None:
        with asked_place(records):
            write_whole(records, _table(taken, blades))
    return {
        "case": scene.name,
        "steps": len(taken),
        "elements": len(stage.mesh.cells),
        "split": int(session.cutter.body.split_cells.sum()),
        "unknowns": int(session.displacement.size),
        "solver_error": _solver_error(session),
        "median_seconds": {
            **{phase: Spread.of(r.seconds[phase] for r in taken).median for phase in PHASES},
            "step": step.median,
        },
        "median_seconds_of_a_cutting_step": cutting.median,
        "seconds_of_95_percent_of_the_steps": step.most,
        "seconds_of_the_slowest_step": step.largest,
        "steps_within": step.within,
        **{name: getattr(quality, name) for name in _QUALITY},
        "cuts": [
            {
                "name": name,
                "cut_work": float(taken[-1].cut_work[k]),
                "largest_driving_force": _largest(blades[name][0]),
                "largest_resistance": _largest(blades[name][1]),
                "smoothed_over": stage.smoothing,
            }
            for k, name in enumerate(blades)
        ],
        "out": str(out) if out else None,
    }


def _solver_error(session: "Session") -> float | None:
    """How far iterations that end early have led astray, over the largest displacement."""
    from verify.simulator import Session, Stage

    if session.stage.tolerance <= Stage.tolerance:
        return None
    exact = Session(replace(session.stage, tolerance=Stage.tolerance), account=False)
    exact.run()
    off = exact.displacement - session.displacement
    return float(abs(off).max() / abs(exact.displacement).max())


def _draw(frames: "list[Frame]", stage: "Stage", out: Path, zoom: float) -> None:
    """Draw the last frame, or all as fast as it happened."""
    from verify.simulator.animation import view_of, write_animation, write_film, write_picture

    view = view_of(frames, skin=stage.skin, zoom=zoom)
    if out.suffix == ".png":
        write_picture(frames[-1], view, out)
        return
    rate = min(50.0, len(frames) / stage.duration)  # no faster than a screen shows
    (write_film if out.suffix == ".mp4" else write_animation)(frames, view, out, rate)


def _largest(forces: "Floats") -> float | None:
    known = forces[forces == forces]  # not NaN
    return float(known.max()) if len(known) else None


def _table(records: "list[StepRecord]", blades: "dict[str, tuple[Floats, Floats]]") -> str:
    """Return what every step cost and did as CSV, with the forces on each blade."""
    rows = []
    for step, r in enumerate(records):
        row: dict[str, Any] = {"step": r.step, "time": r.time, **r.seconds}
        row |= {"split": r.split, "unknowns": r.unknowns}
        row["mean_delay"] = r.delay.mean() if len(r.delay) else ""
        row |= {name: getattr(r, name) for name in _ACCOUNT}
        for k, (name, forces) in enumerate(blades.items()):
            row[f"cut_work_{name}"] = r.cut_work[k]
            for what, force in zip(_FORCES, forces, strict=True):
                row[f"{what}_{name}"] = force[step] if force[step] == force[step] else ""  # NaN
        rows.append(row)
    return csv_text(list(rows[0]), rows)


def _words(summary: dict[str, Any]) -> list[str]:
    median = summary["median_seconds"]["step"]
    shares = ", ".join(f"{share:.0%} within {n}" for n, share in summary["steps_within"].items())
    lines = [
        f"{summary['case']}: {summary['steps']} steps, {summary['split']} of "
        f"{summary['elements']} elements split, {summary['unknowns']} unknowns",
        f"a step took {median * 1e3:.2f} ms (median, compilation and account included): {shares}",
        f"volume off by {summary['volume_error']:.0e}, {summary['loose_edges']} loose edges, "
        f"{summary['inverted_elements']} elements and {summary['inverted_facets']} facets inside "
        f"out, {summary['stray_facets']} facets astray",
    ]
    if (error := summary["solver_error"]) is not None:
        lines.append(f"iterations that end early moved it by {error:.1e} of its displacement")
    lines += [
        f"blade of {cut['name']}: took {cut['cut_work']:.3g} J, driving force at most "
        f"{cut['largest_driving_force']:.3g} N over {1e3 * cut['smoothed_over']:.3g} mm of its way"
        for cut in summary["cuts"]
        if cut["largest_driving_force"]
    ]
    return [*lines, *([f"drawn: {summary['out']}"] if summary["out"] else [])]

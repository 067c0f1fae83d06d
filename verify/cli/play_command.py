"""``verify play``: a cutting scene step by step, drawn off-screen or shown in a window."""

import argparse
import csv
import io
import json
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Scene, load_scene
from verify.whole_files import asked_place, write_whole

if TYPE_CHECKING:
    from verify.simulator import Stage, StepRecord


def execute(arguments: argparse.Namespace) -> int:
    """Play a case."""
    out: Path | None = arguments.out
    if arguments.frames < 2:
        raise InputError(f"--frames {arguments.frames}: expected at least 2")
    if out is not None and out.suffix not in (".gif", ".mp4", ".png"):
        raise InputError(f"--out {out}: expected a name that ends in .gif, .mp4 or .png")
    if out is not None and out.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError("--out: MP4 needs the program ffmpeg, which is not in the path")
    for path in (out, arguments.records):
        if path is not None and not path.resolve().parent.is_dir():
            raise InputError(f"no directory '{path.parent}' to write into")
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    if arguments.window and not has_display:
        raise InputError("--window: there is no display; use --out FILE.gif")
    if out is None and not has_display and arguments.records is None:
        raise InputError("there is no display to show it on; use --out FILE.gif")
    scene = load_scene(arguments.case)
    from verify.simulator import stage_of

    try:
        stage = stage_of(scene)
    except UnsupportedSceneError as reason:
        raise InputError(f"cannot be played: {reason}", str(scene.file or scene.name)) from None
    if arguments.window or (out is None and has_display):
        from verify.simulator.window import play_in_window

        play_in_window(stage, scene.title, arguments.stroke)
        return 0
    return _play(stage, scene, arguments)


def _play(stage: "Stage", scene: Scene, arguments: argparse.Namespace) -> int:
    from verify.simulator import PHASES, Session, quality_of
    from verify.simulator.animation import (
        Frame,
        Underlay,
        view_of,
        write_animation,
        write_film,
        write_picture,
    )
    from verify.simulator.session import Spread

    session = Session(stage)
    every = max(1, round(stage.steps / (arguments.frames - 1)))
    frames = [Frame(0.0, session.picture(), session.blades())]
    while not session.finished:
        record = session.step()
        if arguments.out is not None and (record.step % every == 0 or session.finished):
            frames.append(Frame(record.time, session.picture(), session.blades(), session.hooks()))
    records, quality = session.records, quality_of(session)
    step = Spread.of(record.total_seconds for record in records)
    cutting = Spread.of(record.total_seconds for record in records if record.newly_split)
    if arguments.out is not None:
        skin = scene.geometry.kind == "skin"
        under = Underlay(frames[0].picture, scene.material.thickness or 0.0) if skin else None
        view = view_of(frames, underlay=under, zoom=arguments.zoom)
        with asked_place(arguments.out):
            if arguments.out.suffix == ".png":
                write_picture(frames[-1], view, arguments.out)
            else:
                # as fast as it happened, but no faster than a screen shows
                rate = min(50.0, len(frames) / stage.duration)
                write = write_film if arguments.out.suffix == ".mp4" else write_animation
                write(frames, view, arguments.out, rate)
    if arguments.records is not None:
        with asked_place(arguments.records):
            write_whole(arguments.records, _table(records))
    summary = {
        "case": scene.name,
        "steps": len(records),
        "elements": len(stage.mesh.cells),
        "split": int(session.cutter.body.split_cells.sum()),
        "unknowns": int(session.displacement.size),
        "median_seconds": {
            **{phase: Spread.of(r.seconds[phase] for r in records).median for phase in PHASES},
            "step": step.median,
        },
        "median_seconds_of_a_cutting_step": cutting.median,
        "seconds_of_95_percent_of_the_steps": step.most,
        "seconds_of_the_slowest_step": step.largest,
        "steps_within": step.within,
        "volume_error": quality.volume_error,
        "loose_edges": quality.loose_edges,
        "inverted_elements": quality.inverted_elements,
        "inverted_facets": quality.inverted_facets,
        "stray_facets": quality.stray_facets,
        "largest_stretch": quality.largest_stretch,
        "out": str(arguments.out) if arguments.out else None,
    }
    print(json.dumps(summary, indent=2) if arguments.json else _words(summary))
    return 0


def _table(records: "list[StepRecord]") -> str:
    """Return what every step cost and did as CSV."""
    from verify.simulator import PHASES

    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(
        ["step", "time", *PHASES, "split", "unknowns", "mean_delay", "kinetic", "strain",
         "potential", "work", "dissipated", "contacts"]
    )  # fmt: skip
    for r in records:
        delay = r.delay.mean() if len(r.delay) else ""
        table.writerow(
            [r.step, r.time, *r.seconds.values(), r.split, r.unknowns, delay, r.kinetic, r.strain,
             r.potential, r.work, r.dissipated, r.contacts]
        )  # fmt: skip
    return text.getvalue()


def _words(summary: dict[str, Any]) -> str:
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
    return "\n".join([*lines, *([f"drawn: {summary['out']}"] if summary["out"] else [])])

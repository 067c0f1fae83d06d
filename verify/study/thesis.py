"""The study of the thesis: its tables measured again, judged, and as plain data.

What ways to cut do to errors and explicit steps is judged by the ranked run, and by the studies of
slivers and claims.
"""

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from verify.runner.tasks import Task
from verify.simulator.thesis import (
    CUTS,
    SPEEDS,
    TETRAHEDRA,
    Delay,
    Frames,
    RealTime,
    count_face,
    count_strips,
    delays,
    published_rows,
    published_source,
    real_time,
    step_times,
    with_other_frames,
)
from verify.study.study import Making, Study
from verify.study.thesis_verdicts import Measured, verdicts

_ROWS = (10, 50, 100, 500, 1000)  # of Table 4.3


@dataclass(frozen=True, kw_only=True)
class ThesisStudy(Study):
    """What the study found.

    Attributes
    ----------
    measured : Measured
    quick : bool
    """

    measured: Measured
    quick: bool

    def as_record(self) -> dict[str, Any]:
        """Return all of it as plain data, the thesis' rows beside."""
        tables = {name: published_rows(name) for name in ("4.3", "4.4", "4.5", "4.6")}
        found = asdict(self)
        measured = found.pop("measured")
        published = {"source": published_source(), "tables": tables}
        return {**found, **measured, "published": published}

    def rows(self) -> list[dict[str, Any]]:
        """Return the entries of the tables, one a line: what it is here and in the thesis."""
        m, names = self.measured, ("table", "row", "column", "here", "thesis", "unit")
        entries = [
            *(("4.3", row.cuts, name, added, row.thesis.get(name.split()[0], ""), "nodes added")
              for row in m.face for name, added in row.added.items()),
            *(("4.4", row.tetrahedra, f"{row.cuts} cuts", row.per_second, row.thesis_per_second,
               "s per simulated s") for row in m.steps),
            *(("4.5", row.tetrahedra, f"{row.cuts} cuts", row.nodes, row.thesis_nodes, "nodes")
              for row in m.steps),
            *(("4.6", row.tetrahedra, row.speed_name, row.delay, row.thesis, "s")
              for row in m.delays),
        ]  # fmt: skip
        return [dict(zip(names, entry, strict=True)) for entry in entries]


def thesis_study(making: Making, quick: bool) -> ThesisStudy:
    """Measure the tables, and judge them.

    Parameters
    ----------
    making : Making
    quick : bool
        Fewer rows of each table.

    Raises
    ------
    ChildProcessError
        If a table cannot be measured; finished parts are kept.
    """
    tables = _tables(quick)
    own = dict(zip(tables, making.parts("thesis", list(tables.values())), strict=True))
    (hand, contended), (late, frames) = own.pop("hand"), own.pop("waits")
    measured = Measured(**own, delays=late, frames=frames, hand=hand, contended=contended)
    return ThesisStudy(findings=verdicts(measured), measured=measured, quick=quick)


def _tables(quick: bool) -> dict[str, Task]:
    """Return the parts that the simulator measures, by their names in `Measured`."""
    tetrahedra = TETRAHEDRA[::4] if quick else TETRAHEDRA
    cuts, rows = (CUTS[::2], _ROWS[:3]) if quick else (CUTS, _ROWS)
    frames = {"tetrahedra": tetrahedra, "other": TETRAHEDRA[0 if quick else -1],
              "frames": (1 / 240, 1 / 15, 0.5)}  # fmt: skip
    lengths = (1, 2, 7, 50) if quick else (1, 2, 3, 7, 50, 500)
    return {
        "steps": Task("Tables 4.4 and 4.5, time of a step", step_times,
                      {"tetrahedra": tetrahedra, "cuts": cuts}),
        "hand": Task("real time", timed_hand, {}),
        "strips": Task("Table 4.3, strips", count_strips, {"lengths": lengths}),
        "face": Task("Table 4.3, face", count_face, {"rows": rows}),
        "waits": Task("Table 4.6, delays", waits, frames),
    }  # fmt: skip


def timed_hand() -> tuple[RealTime, str]:
    """Measure the hand, and say so if the machine has more to do than it has cores."""
    hand = real_time()
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    busy = f"the machine was busy: load {load:.1f} on {cores} cores" if load > cores else ""
    return hand, busy


def waits(
    tetrahedra: Sequence[int], other: int, frames: Sequence[float]
) -> tuple[list[Delay], list[Frames]]:
    """Measure delays over sizes of meshes, and at the fastest speed with frames of other lengths.

    Parameters
    ----------
    tetrahedra : sequence of int
    other : int
        Size of the mesh on which frames are of other lengths.
    frames : sequence of float
        Those lengths, s.
    """
    found = delays(tetrahedra)
    fast = next(row.speed for row in found if row.speed_name == SPEEDS[-1])
    return found, with_other_frames(other, fast, frames)

"""The study of the thesis: everything measured, judged, and as plain data."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

from verify.result import CaseResult
from verify.scene import Scene, load_scenes
from verify.simulator.thesis.added_nodes import count_face, count_strips
from verify.simulator.thesis.delays import (
    SPEEDS,
    delays,
    published_rows,
    published_source,
    with_other_frames,
)
from verify.simulator.thesis.real_time import CUTS, TETRAHEDRA, real_time, step_times
from verify.study.record import Study
from verify.study.thesis.measured import Measured, compare_methods, sliver_systems
from verify.study.thesis.verdicts import verdicts_on_cost, verdicts_on_mechanics

# exact without tips, exact with tips inside elements, and references in the plane and in space
CASES = (
    "statics/f3_inclined", "statics/griffith_inside", "statics/tissue_strip",
    "statics/buried_cut", "controls/thin_skin",
)  # fmt: skip
SOLVERS = (
    "xfem", "conforming", "subdivision", "snapping", "snapping_subdivision", "removal",
    "removal_refined", "virtual_node", "virtual_node_arbitrary", "mass_spring", "uncut",
)  # fmt: skip
_FAMILIES = ("slivers/plane_edges", "slivers/space_faces")
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
        return [
            *(
                _line("4.3", row.cuts, name, added, row.thesis.get(name.split()[0]), "nodes added")
                for row in self.measured.face
                for name, added in row.added.items()
            ),
            *(
                _line("4.4", row.tetrahedra, f"{row.cuts} cuts", row.per_second,
                      row.thesis_per_second, "s per simulated s")
                for row in self.measured.steps
            ),
            *(
                _line("4.5", row.tetrahedra, f"{row.cuts} cuts", row.nodes, row.thesis_nodes,
                      "nodes")
                for row in self.measured.steps
            ),
            *(
                _line("4.6", row.tetrahedra, row.speed_name, row.delay, row.thesis, "s")
                for row in self.measured.delays
            ),
        ]  # fmt: skip


def _line(
    table: str, row: int, column: str, here: float, thesis: float | None, unit: str
) -> dict[str, Any]:
    return {
        "table": table, "row": row, "column": column, "here": here,
        "thesis": "" if thesis is None else thesis, "unit": unit,
    }  # fmt: skip


def thesis_study(
    scenes: Sequence[Scene],
    results: Sequence[CaseResult],
    quick: bool,
    announce: Callable[[str], None],
    seconds: float = 0.0,
) -> ThesisStudy:
    """Measure the tables, and judge them together with solved cases.

    Parameters
    ----------
    scenes, results : sequences
        Cases that the methods have solved, and what the runner found.
    quick : bool
        Fewer rows of each table.
    announce : callable
        Told what is under way.
    seconds : float
        That solving the cases took, for the record.
    """
    start = perf_counter()
    announce("time of a step (Tables 4.4 and 4.5)")
    steps = step_times(TETRAHEDRA[::4] if quick else TETRAHEDRA, CUTS[::2] if quick else CUTS)
    announce("real time")
    hand = real_time()
    contended = _contention()
    announce("unknowns (Table 4.3)")
    strips = count_strips((1, 2, 7, 50) if quick else (1, 2, 3, 7, 50, 500))
    face = count_face(_ROWS[:3] if quick else _ROWS)
    announce("delays (Table 4.6)")
    waited = delays(TETRAHEDRA[::4] if quick else TETRAHEDRA)
    fast = next(row.speed for row in waited if row.speed_name == SPEEDS[-1])
    frames = with_other_frames(TETRAHEDRA[0 if quick else -1], fast, (1 / 240, 1 / 15, 0.5))
    announce("slivers and limits")
    families = _FAMILIES[:1] if quick else _FAMILIES
    measured = Measured(
        strips=strips,
        face=face,
        steps=steps,
        delays=waited,
        frames=frames,
        hand=hand,
        methods=compare_methods(scenes, results),
        slivers=sliver_systems([one for name in families for one in load_scenes(name)]),
        contended=contended,
    )
    findings = [*verdicts_on_cost(measured), *verdicts_on_mechanics(measured)]
    return ThesisStudy(
        findings=findings, seconds=seconds + perf_counter() - start, measured=measured, quick=quick
    )


def _contention() -> str:
    """Say so if the machine has more to do than it has cores."""
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    return f"the machine was busy: load {load:.1f} on {cores} cores" if load > cores else ""

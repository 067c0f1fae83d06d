"""The study of the thesis: everything measured, judged, and as plain data."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from verify.judge.models import coarsest
from verify.runner.tasks import Task
from verify.scene import load_scene, scene_content
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
from verify.study.thesis_measured import (
    METHODS,
    Measured,
    compare_methods,
    critical_steps,
    sliver_systems,
)
from verify.study.thesis_verdicts import verdicts_on_cost, verdicts_on_mechanics

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


def thesis_study(making: Making, quick: bool) -> ThesisStudy:
    """Solve the cases by all methods, measure the tables, and judge both.

    Parameters
    ----------
    making : Making
    quick : bool
        Fewer cases, methods, levels, and rows of each table.

    Raises
    ------
    ChildProcessError
        If a table cannot be measured; finished parts are kept.
    """
    names, solvers = (CASES[:2], SOLVERS[:4]) if quick else (CASES, SOLVERS)
    scenes = [coarsest(load_scene(name), 2 if quick else 3) for name in names]
    making.announce(f"{len(solvers)} solvers on {', '.join(names)}, into thesis-cases")
    results = making.run(scenes, "thesis-cases", solvers, 1 if quick else 3)
    families = _FAMILIES[:1] if quick else _FAMILIES
    tables = _tables(quick)
    slivers = [
        Task(f"slivers, {name}, {method}", sliver_systems, {"family": name, "method": method})
        for method in METHODS
        for name in families
    ]
    steps = [
        Task(f"critical steps, {scene.name}", critical_steps,
             {"content": scene_content(scene), "solvers": solvers}, solvers)
        for scene in scenes
    ]  # fmt: skip
    found = making.parts("thesis", [*tables.values(), *slivers, *steps])
    rest = iter(found[len(tables) :])
    own = dict(zip(tables, found, strict=False))
    (hand, contended), (late, frames) = own.pop("hand"), own.pop("waits")
    measured = Measured(
        **own,
        delays=late,
        frames=frames,
        hand=hand,
        contended=contended,
        slivers=[one for _ in slivers for one in next(rest)],
        methods=compare_methods(results, [one for _ in steps for one in next(rest)]),
    )
    findings = [*verdicts_on_cost(measured), *verdicts_on_mechanics(measured)]
    return ThesisStudy(findings=findings, measured=measured, quick=quick)


def _tables(quick: bool) -> dict[str, Task]:
    """Return the parts that the simulator measures, by their names in `Measured`."""
    tetrahedra = TETRAHEDRA[::4] if quick else TETRAHEDRA
    cuts, rows = (CUTS[::2], _ROWS[:3]) if quick else (CUTS, _ROWS)
    frames = {"tetrahedra": tetrahedra, "other": TETRAHEDRA[0 if quick else -1],
              "frames": (1 / 240, 1 / 15, 0.5)}  # fmt: skip
    lengths = (1, 2, 7, 50) if quick else (1, 2, 3, 7, 50, 500)
    asked: dict[str, tuple[str, Callable[..., Any], dict[str, Any]]] = {
        "steps": ("Tables 4.4 and 4.5, time of a step", step_times,
                  {"tetrahedra": tetrahedra, "cuts": cuts}),
        "hand": ("real time", timed_hand, {}),
        "strips": ("Table 4.3, strips", count_strips, {"lengths": lengths}),
        "face": ("Table 4.3, face", count_face, {"rows": rows}),
        "waits": ("Table 4.6, delays", waits, frames),
    }  # fmt: skip
    return {key: Task(*one) for key, one in asked.items()}


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

"""Measurements of the thesis, made again: nodes added, delays of opening, cost of steps.

Table 4.3 and Figure 4.11: nodes that each method adds while incisions grow. Table 4.6 and Figure
4.26: how long the tool takes to cross an element of the hand. Tables 4.4 and 4.5 and Figure 4.25:
cost of a simulated second against numbers of cuts and sizes of meshes, and of each step while the
hand is cut and pulled open. `thesis.json` holds the numbers of the thesis itself (Gutiérrez
Preciado, CINVESTAV, 2009).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from time import perf_counter, thread_time

import numpy as np
from scipy.sparse import csr_array

from verify.methods import cut_by
from verify.methods.cut_body import CutBody
from verify.provenance import kernel_seconds
from verify.scene import Scene, Skin, load_scene
from verify.simulator import PHASES, Session, Stage, quality_of, stage_of
from verify.simulator.semi_progressive import Crossings, SemiProgressiveCutter
from verify.simulator.session import LIMITS
from verify.xfem.arrays import Floats
from verify.xfem.block_pattern import block_pattern
from verify.xfem.cuts import Cut, Polyline, ToolPath
from verify.xfem.element import isotropic
from verify.xfem.explicit import critical_step
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3)  # of an edge: nodes as near as that are snapped
_HEIGHT = 0.43  # of the strip: away from nodes and from the middles of edges


@dataclass(frozen=True)
class StripCount:
    """A strip of triangles, cut along from border to border.

    Attributes
    ----------
    pattern : str
        Of the diagonals.
    triangles : int
        That are cut through.
    enriched : int
        Nodes that XFEM enriches.
    """

    pattern: str
    triangles: int
    enriched: int


@dataclass(frozen=True)
class FaceCount:
    """Nodes added on the face.

    Attributes
    ----------
    asked : int
        Row of Table 4.3.
    cuts : int
        Elements that were split when at least so many were.
    strokes : int
        That the tool had begun.
    added : dict of str to int
        By method; ``xfem played`` is counted on the membrane, semi-progressively, all others on its
        plan. The blade is parallel to the line of sight, so that the same edges are crossed at the
        same places.
    smallest : dict of str to float
        Smallest volume of an element or a piece of one over the volume of its element.
    step : dict of str to float
        Critical explicit step of the plan as a free sheet, masses lumped, over the step of the
        uncut sheet.
    shape : dict of str to float
        `least_shape` of the cut plan over the uncut plan's.
    thesis : dict of str to int
        The thesis' increments.
    """

    asked: int
    cuts: int
    strokes: int
    added: dict[str, int]
    smallest: dict[str, float]
    step: dict[str, float]
    shape: dict[str, float]
    thesis: dict[str, int]


def count_strips(lengths: Sequence[int]) -> list[StripCount]:
    """Cut strips of so many squares, divided by diagonals in each of the patterns."""
    counts = []
    for pattern in ("right", "left", "alternating", "crossed"):
        for length in lengths:
            mesh = rectangle_mesh((length, 1), (0.0, 0.0), (float(length), 1.0), pattern)
            cut = Polyline([[-1.0, _HEIGHT], [length + 1.0, _HEIGHT]])
            phantom = cut_mesh(mesh, [cut])
            through = int((np.bincount(phantom.parent) > 1).sum())
            counts.append(StripCount(pattern, through, phantom.node_count - len(mesh.points)))
    return counts


def count_face(rows: Sequence[int]) -> list[FaceCount]:
    """Let incisions grow over the face until so many elements are split.

    Parameters
    ----------
    rows : sequence of int
        Of Table 4.3, ascending, without 0.
    """
    stage = stage_of(load_scene("thesis/face_thousand_cuts"))
    # plan and membrane have one positive direction: the membrane is a graph over x and y
    plan = SimplexMesh(stage.mesh.points[:, :2], stage.mesh.cells)
    uncut = _step_of_body(cut_by("uncut", plan, []))
    thesis = {int(row[0]): row for row in published_rows("4.3")}
    counts = []
    for asked, (cuts, played, time) in zip(rows, _growth(stage, rows), strict=True):
        lines = [Polyline(tips) for tips in _tips_until(stage.strokes, time)]
        bodies = {
            "xfem": cut_by("virtual_node_arbitrary", plan, lines),
            "subdivision": cut_by("subdivision", plan, lines),
            "snapping": cut_by("snapping", plan, lines),
        }
        for threshold in THRESHOLDS:
            name = f"snapping_subdivision {threshold:g}"
            bodies[name] = cut_by("snapping_subdivision", plan, lines, threshold=threshold)
        sizes = {name: body.counts for name, body in bodies.items()}
        added = {"xfem played": played}
        added |= {name: size.nodes - size.nodes_before for name, size in sizes.items()}
        step = {name: _step_of_body(body) / uncut for name, body in bodies.items()}
        smallest = {name: body.smallest_fraction for name, body in bodies.items()}
        shape = {
            name: least_shape(body.phantom.mesh) / least_shape(plan)
            for name, body in bodies.items()
        }
        own = thesis[asked]
        said = {"xfem": int(own[3]), "snapping_subdivision": int(own[4])}
        counts.append(FaceCount(asked, cuts, len(lines), added, smallest, step, shape, said))
    return counts


def _growth(stage: Stage, rows: Sequence[int]) -> list[tuple[int, int, float]]:
    """Measure elements split, nodes added and time when so many elements were split."""
    cutter = SemiProgressiveCutter(stage.mesh)
    for path in stage.strokes:
        cutter.begin(path)
    found: list[tuple[int, int, float]] = []
    frame = 0.25 * stage.time_step
    for k in range(1, 4 * stage.steps + 1):
        if len(found) == len(rows):
            break
        cutter.advance(k * frame)
        split = int(np.count_nonzero(cutter.body.split_cells))
        while len(found) < len(rows) and split >= rows[len(found)]:
            added = cutter.phantom_mesh().node_count - len(stage.mesh.points)
            found.append((split, added, k * frame))
    if len(found) < len(rows):
        raise ValueError(f"the strokes split {split} elements; expected {rows[-1]}")
    return found


def _tips_until(strokes: Sequence[ToolPath], time: float) -> list[Floats]:
    """Return a plan (k, 2) of the way of each tip, of the strokes that have begun."""
    tips = []
    for path in strokes:
        if path.times[0] >= time:
            continue
        last = [np.interp(time, path.times, path.blades[:, 0, i]) for i in range(2)]
        before = path.times < min(time, path.times[-1])
        tips.append(np.concatenate([path.blades[before, 0, :2], [last]]))
    return tips


def _step_of_body(body: CutBody) -> float:
    """Compute the critical step 2/ω_max of a free sheet of Table 4.1 that has been cut, in s."""
    material = body.material(isotropic(1.0e4, 0.3, "plane stress"))
    pattern = block_pattern(body.resisting.cells, body.resisting.node_count)
    blocks = InternalForce(body.resisting, material, "linear").stiffness(pattern)
    return critical_step(csr_array(pattern.matrix(blocks)), side_wise_mass(body.phantom, 1000.0))


def least_shape(mesh: SimplexMesh) -> float:
    """Return the least ratio of inradius to circumradius, times the dimension: 1 if regular.

    The error of a linear element's gradient is bounded by h²/2r (Ciarlet): half the ratio, twice
    the bound.
    """
    slopes = mesh.gradients  # of lengths 1/height; r = 1/Σ 1/height
    inverse = np.linalg.norm(slopes, axis=2).sum(axis=1)
    squares = (mesh.edge_vectors**2).sum(axis=2)
    centres = 0.5 * np.einsum("ki,kij->kj", squares, slopes[:, 1:])  # from the first corner
    return float((mesh.dim / inverse / np.linalg.norm(centres, axis=1)).min())


def shape_left(method: str, mesh: SimplexMesh, cuts: Sequence[Cut]) -> float:
    """Cut a mesh by a method, and return `least_shape` over the uncut mesh's."""
    return least_shape(cut_by(method, mesh, cuts).phantom.mesh) / least_shape(mesh)


@cache
def _tables() -> dict[str, dict[str, list[list[float]]]]:
    text = files("verify.simulator").joinpath("thesis.json").read_text(encoding="utf-8")
    tables: dict[str, dict[str, list[list[float]]]] = json.loads(text)
    return tables


def published_rows(table: str) -> list[list[float]]:
    """Return the rows of a table as printed, such as ``"4.3"``."""
    return [list(row) for row in _tables()[table]["rows"]]


def published_source() -> str:
    """Return where they were published."""
    return str(_tables()["source"])


# m, across the hand: the middle first, then ever denser; none along another
_ACROSS = (
    0.003, -0.021, 0.025, -0.009, 0.013, -0.031, 0.034, -0.015, 0.019, -0.003, 0.008, -0.026,
    0.029, -0.012, 0.0155,
)  # fmt: skip
_SLANT, _OVER, _ABOVE = 0.003, 0.005, 0.04  # m
_DEPTH = (0.0, 0.0, -0.07)  # m
_FRAMES = 200  # of a stroke: less than an element each


@dataclass(frozen=True)
class CutHand:
    """Strokes that cut so many elements.

    Attributes
    ----------
    strokes : list of ToolPath
        The last one ends where the number was reached; all together last as long as asked.
    cuts : int
        Elements that strokes have split; one that two strokes split counts twice.
    """

    strokes: list[ToolPath]
    cuts: int


def hand(elements: int) -> Stage:
    """Return the straight incision of the thesis' hand on about so many tetrahedra."""
    scene: Scene = load_scene("thesis/hand_straight")
    assert isinstance(scene.geometry, Skin)
    geometry = scene.geometry.model_copy(update={"elements": elements})
    return stage_of(scene.model_copy(update={"geometry": geometry}))


def stroke_along(stage: Stage, place: float, begin: float, duration: float) -> ToolPath:
    """Make the stroke from wrist to fingers, through both borders.

    Parameters
    ----------
    stage : Stage
    place : float
        x where it crosses the middle, m.
    begin, duration : float
        s.
    """
    lower, upper = stage.mesh.points[:, 1].min() - _OVER, stage.mesh.points[:, 1].max() + _OVER
    tips = [[place - _SLANT, lower, _ABOVE], [place + _SLANT, upper, _ABOVE]]
    return ToolPath.of_tip(tips, [begin, begin + duration], _DEPTH)


def cut_hand(stage: Stage, targets: Sequence[int], duration: float) -> list[CutHand]:
    """Find the strokes, one after the other, that cut so many elements.

    Parameters
    ----------
    stage : Stage
    targets : sequence of int
        Ascending; 0 is no stroke.
    duration : float
        Of all strokes of a target together, s.

    Raises
    ------
    ValueError
        If the strokes do not cut so many.
    """
    cutter = SemiProgressiveCutter(stage.mesh)
    found = [CutHand([], 0) for target in targets if target == 0]
    wanted = [target for target in targets if target > 0]
    for number, place in enumerate(_ACROSS):
        path = stroke_along(stage, place, float(number), 1.0)
        cutter.begin(path)
        for frame in range(1, _FRAMES + 1):
            share = frame / _FRAMES
            cutter.advance(number + share)
            cuts = len(cutter.crossings.cell)
            while wanted and cuts >= wanted[0]:
                paths = [stroke.path for stroke in cutter.strokes]
                found.append(CutHand(_squeezed(paths, number + share, duration), cuts))
                wanted.pop(0)
            if not wanted:
                return found
    raise ValueError(f"the strokes cut {cuts} elements; expected {wanted[0]}")


def _squeezed(paths: Sequence[ToolPath], end: float, duration: float) -> list[ToolPath]:
    """Play paths until a time within a duration."""
    squeezed = []
    for path in paths:
        stop = min(float(path.times[-1]), end)
        share = (stop - path.times[0]) / (path.times[-1] - path.times[0])
        tips = path.blades[0] + np.array([0.0, share])[:, None, None] * (
            path.blades[-1] - path.blades[0]
        )
        squeezed.append(ToolPath(tips, np.array([path.times[0], stop]) * (duration / end)))
    return squeezed


SPEEDS = ("slow", "normal", "fast")
_PLACES = (-0.021, 0.003, 0.025)  # m
_FRAME = 1.0 / 60.0  # s


@dataclass(frozen=True)
class Delay:
    """One entry of Table 4.6.

    Attributes
    ----------
    tetrahedra : int
    speed_name : str
    speed : float
        Of the tool, m/s.
    elements : int
        That were crossed.
    edge : float
        Mean edge of the mesh, m.
    delay : float
        Mean time from the first edge of an element to the last one, s.
    seen : float
        Mean time from the first edge to the frame of 1/60 s in which the element opens, s.
    thesis : float
        s.
    """

    tetrahedra: int
    speed_name: str
    speed: float
    elements: int
    edge: float
    delay: float
    seen: float
    thesis: float


@dataclass(frozen=True)
class Frames:
    """The same stroke on a slower or faster machine, that is with other frames.

    Attributes
    ----------
    frame : float
        s.
    elements : int
        Split by the end.
    difference : float
        Largest difference of a delay to that with frames of 1/60 s, relative to the longest.
    seen_difference : float
        Largest time by which the element opens on the screen after it was crossed, in frames.
    """

    frame: float
    elements: int
    difference: float
    seen_difference: float


def delays(tetrahedra: Sequence[int]) -> list[Delay]:
    """Cross the hand in three parallel strokes at once, at each of three speeds.

    The thesis does not say how fast its user was. Each speed is the one at which the delay on
    the coarsest mesh is the thesis'; all other entries follow from it.
    """
    table = {int(row[0]): row[1:4] for row in published_rows("4.6")}
    found: list[Delay] = []
    speeds: dict[str, float] = {}
    for size in tetrahedra:
        stage = hand(size)
        edge = float(np.linalg.norm(stage.mesh.edge_vectors, axis=2).mean())
        if not speeds:
            at_one = float(_crossed(stage, 0.1, _FRAME).delay.mean()) * 0.1
            speeds = {n: at_one / table[size][k] for k, n in enumerate(SPEEDS)}
        for column, name in enumerate(SPEEDS):
            crossings = _crossed(stage, speeds[name], _FRAME)
            found.append(
                Delay(
                    size,
                    name,
                    speeds[name],
                    len(crossings.cell),
                    edge,
                    float(crossings.delay.mean()),
                    float((crossings.seen - crossings.entry).mean()),
                    table[size][column],
                )
            )
    return found


def with_other_frames(tetrahedra: int, speed: float, frames: Sequence[float]) -> list[Frames]:
    """Cross the hand at one speed with frames of other lengths than 1/60 s."""
    stage = hand(tetrahedra)
    usual = _crossed(stage, speed, _FRAME)
    order = np.lexsort([usual.cell, usual.stroke])
    found = []
    for frame in frames:
        other = _crossed(stage, speed, frame)
        same = np.lexsort([other.cell, other.stroke])
        if not np.array_equal(other.cell[same], usual.cell[order]):
            raise ValueError(f"frames of {frame} s split other elements than frames of 1/60 s")
        off = np.abs(other.delay[same] - usual.delay[order]).max() / usual.delay.max()
        late = float((other.seen - other.leave).max() / frame)
        found.append(Frames(frame, len(other.cell), float(off), late))
    return found


def _crossed(stage: Stage, speed: float, frame: float) -> Crossings:
    cutter = SemiProgressiveCutter(stage.mesh)
    length = float(np.linalg.norm(np.diff(stroke_along(stage, 0.0, 0.0, 1.0).blades[:, 0], axis=0)))
    duration = length / speed
    for place in _PLACES:
        cutter.begin(stroke_along(stage, place, 0.0, duration))
    for step in range(1, int(np.ceil(duration / frame)) + 2):
        cutter.advance(step * frame)
    return cutter.crossings


TETRAHEDRA = (200, 400, 600, 800, 1000)
CUTS = (0, 50, 100, 150, 200)
_STEP = 0.5  # s: the thesis' own
_CUTTING, _MEASURED = 2, 21  # steps
_GRAVITY = np.array([0.0, 0.0, -9.8])


@dataclass(frozen=True)
class StepTime:
    """One entry of Tables 4.4 and 4.5.

    Attributes
    ----------
    asked_tetrahedra, asked_cuts : int
        Row and column.
    tetrahedra, cuts : int
        As they are here; an element that two strokes split counts twice.
    nodes : int
        With unknowns of their own.
    step : float
        Median processor time of a step of 0.5 s with all surfaces, s.
    slowest : float
        Of the steps measured, s.
    per_second : float
        Processor time per simulated second at that step, s.
    thesis_per_second : float
        Table 4.4, s.
    thesis_nodes : int
        Table 4.5.
    """

    asked_tetrahedra: int
    asked_cuts: int
    tetrahedra: int
    cuts: int
    nodes: int
    step: float
    slowest: float
    per_second: float
    thesis_per_second: float
    thesis_nodes: int


def step_times(tetrahedra: Sequence[int], cuts: Sequence[int]) -> list[StepTime]:
    """Play the hand at each size, cut so often, and time its steps.

    Steps that cut are not among them: the thesis recorded what a second takes *after* cuts.
    """
    times = {int(row[0]): row[1:] for row in published_rows("4.4")}
    nodes = {int(row[0]): row[1:] for row in published_rows("4.5")}
    stage = replace(hand(tetrahedra[0]), hooks=[], gravity=_GRAVITY)
    _measure(stage, cut_hand(stage, [cuts[-1]], _STEP)[0])  # compiles
    found = []
    for size in tetrahedra:
        stage = replace(hand(size), hooks=[], gravity=_GRAVITY)
        for asked, made in zip(cuts, cut_hand(stage, cuts, _STEP), strict=True):
            steps, count = _measure(stage, made)
            step, column = float(np.median(steps)), CUTS.index(asked)
            found.append(
                StepTime(
                    size,
                    asked,
                    len(stage.mesh.cells),
                    made.cuts,
                    count,
                    step,
                    max(steps),
                    step / _STEP,
                    times[size][column],
                    int(nodes[size][column]),
                )
            )
    return found


def _measure(stage: Stage, made: CutHand) -> tuple[list[float], int]:
    steps = _CUTTING + _MEASURED
    played = replace(stage, strokes=made.strokes, time_step=_STEP, duration=steps * _STEP)
    session = Session(played, account=False, clock=thread_time)
    records = session.run()
    if not np.isfinite(session.state.displacement).all():
        raise ValueError(f"motion of {made.cuts} cuts is not finite")
    seconds = [record.total_seconds for record in records[_CUTTING:]]
    return seconds, session.phantom.node_count


_TETRAHEDRA = 1000
_STROKES = ((-0.022, 1.8), (0.024, 3.0))  # m, s: after the incision, while it is pulled open
_STROKE, _DURATION = 1.1, 4.6  # s
_LOOK = 10  # steps
_REPLAYS = 5


@dataclass(frozen=True)
class RealTime:
    """The hand, played.

    Attributes
    ----------
    tetrahedra, cuts, unknowns, steps, cutting_steps : int
        Cuts are split elements, unknowns displacement components, both at the end.
    within : dict
        Share of all steps within each of the `LIMITS`, in processor time of one thread, of each
        step the median over replays.
    within_wall : dict
        Likewise in wall time, the other work of the machine included.
    resting, cutting : dict
        Median by phase, and of the whole step, of steps without and with newly split elements:
        processor time, s.
    slowest, slowest_wall : float
        Of all steps, processor and wall time, s.
    kernel : float
        Processor time of the calibration kernel beside it, s.
    volume_error, loose_edges, inverted : float, int, int
        Worst over every tenth step: see `verify.simulator.quality.Quality`.
    energy_gain : float
        Largest excess of the mechanical energy over the work done, relative to that work.
    """

    tetrahedra: int
    cuts: int
    unknowns: int
    steps: int
    cutting_steps: int
    within: dict[str, float]
    within_wall: dict[str, float]
    resting: dict[str, float]
    cutting: dict[str, float]
    slowest: float
    slowest_wall: float
    kernel: float
    volume_error: float
    loose_edges: int
    inverted: int
    energy_gain: float


def real_time() -> RealTime:
    """Cut the hand as in the case, cut it twice more along its whole length, and time each step."""
    stage = hand(_TETRAHEDRA)
    more = [stroke_along(stage, place, begin, _STROKE) for place, begin in _STROKES]
    stage = replace(stage, strokes=[*stage.strokes, *more], duration=_DURATION)
    volume, loose, inverted, gain = _soundness(stage)  # compiles the code timed below
    # each replay is the same work step by step: the median over them is what a step costs
    replays, walls = [], []
    for _ in range(_REPLAYS):
        session = Session(stage, account=False, clock=thread_time)
        while not session.finished:
            start = perf_counter()
            session.step()
            walls.append(perf_counter() - start)
        replays.append([[r.seconds[name] for name in PHASES] for r in session.records])
    wall = np.median(np.reshape(walls, (_REPLAYS, -1)), axis=0)
    by_phase = np.median(replays, axis=0)
    kernel = float(np.median(kernel_seconds(clock=thread_time)))
    total = by_phase.sum(axis=1)
    cutting = np.array([record.newly_split > 0 for record in session.records])
    phases = dict(zip(PHASES, by_phase.T, strict=True)) | {"step": total}
    return RealTime(
        tetrahedra=len(stage.mesh.cells),
        cuts=session.records[-1].split,
        unknowns=session.records[-1].unknowns,
        steps=len(total),
        cutting_steps=int(cutting.sum()),
        within=_shares(total),
        within_wall=_shares(wall),
        resting={name: float(np.median(values[~cutting])) for name, values in phases.items()},
        cutting={name: float(np.median(values[cutting])) for name, values in phases.items()},
        slowest=float(total.max()),
        slowest_wall=float(wall.max()),
        kernel=kernel,
        volume_error=volume,
        loose_edges=loose,
        inverted=inverted,
        energy_gain=gain,
    )


def _shares(seconds: Floats) -> dict[str, float]:
    return {name: float(np.mean(seconds <= limit)) for name, limit in LIMITS.items()}


def _soundness(stage: Stage) -> tuple[float, int, int, float]:
    """Play with the account kept and the body measured every few steps."""
    session = Session(stage)
    seen = []
    while not session.finished:
        session.step()
        if len(session.records) % _LOOK == 0 or session.finished:
            seen.append(quality_of(session))
    largest = max(record.work for record in session.records)
    gain = max(record.mechanical - record.work for record in session.records) / largest
    return (
        max(quality.volume_error for quality in seen),
        max(quality.loose_edges for quality in seen),
        max(quality.inverted_elements + quality.inverted_facets for quality in seen),
        float(gain),
    )

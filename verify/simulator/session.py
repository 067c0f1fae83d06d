"""A simulated scene, played step by step, with a record of each step.

Only the phases of a step are timed: all that a simulator does in it. The record itself, the account
of energies and the measures of `verify.simulator.quality` are kept beside it.

Elements open by the rule of all solvers (`swept`): in the step in which the blade begins to sweep
the cut in the support of one of their nodes. Tie forces then fade with the swept share
(`verify.xfem.release`). A blade that is led by hand has no way ahead: elements open when it has
crossed them through, and let go at once.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from verify.accelerated import FAST
from verify.compare.blade import driving_force
from verify.geometry.simplices import measures
from verify.geometry.swept_shares import SweptShares, swept_measure
from verify.simulator.semi_progressive import SemiProgressiveCutter, Stroke
from verify.simulator.stage import Grips, Stage, gripped, held_facets
from verify.simulator.surfaces import Contacts, Picture, SurfaceCollider, Surfaces
from verify.solvers.body_of_scene import sections
from verify.xfem.arrays import Floats, Ints
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.cuts import ToolPath
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import LinearSolver
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.release import (
    TieForces,
    acceleration_at_corners,
    parting_cuts,
    tie_forces,
)

# in the order in which a step goes through them
PHASES = ("cutting", "assembly", "motion", "mapping", "collision")
_LATEST = 1000  # steps: the advance over which a force is smoothed is in them
LIMITS = {"1 ms": 1e-3, "2 ms": 2e-3, "1/60 s": 1.0 / 60.0}  # touch, and sight


@dataclass(frozen=True)
class StepRecord:
    """One step.

    Attributes
    ----------
    step : int
        From 1 on.
    time : float
        At its end, s.
    seconds : dict
        Wall time of each of the `PHASES`: cutting (which elements, their parts and unknowns, the
        surfaces split), assembly (mass, supports and solver of the body where it has changed),
        motion (forces, factorisation, solve), mapping (positions of all surfaces), collision
        (boxes refitted, the tool queried).
    split : int
        Elements split so far.
    newly_split : int
        In this step.
    unknowns : int
        Unknown displacement components.
    delay : (k,) float array
        Of the elements split in this step: from the first edge that the tool passed to the last
        one, s of the scene (Table 4.6).
    kinetic : float
        J (in the plane per metre of thickness).
    potential : float
        Of the weight, J.
    strain, work : float
        Energy, and what hooks, supports and the tool have done on the body since the start, J; NaN
        where no account is kept.
    dissipated : float
        By damping and by the scheme since the start, J; likewise.
    cut_work : (strokes,) float array
        Work that the forces have taken which held what each stroke has cut, since the start, J.
    advance, area : (strokes,) float array
        How far the blade of each stroke has come, m, and what it has swept in the body, m² (in
        the plane m; NaN of strokes whose way is not known).
    contacts : int
        Facets of the collision surface that the tool touches.
    """

    step: int
    time: float
    seconds: dict[str, float]
    split: int
    newly_split: int
    unknowns: int
    delay: Floats
    kinetic: float
    strain: float
    potential: float
    work: float
    dissipated: float
    cut_work: Floats
    advance: Floats
    area: Floats
    contacts: int

    @property
    def total_seconds(self) -> float:
        """Wall time of the step."""
        return sum(self.seconds.values())

    @property
    def mechanical(self) -> float:
        """Kinetic, strain and gravity energy, J."""
        return self.kinetic + self.strain + self.potential

    @property
    def balance(self) -> float:
        """All energy there is and that was lost, less the work, J: constant to round-off."""
        return self.mechanical + self.dissipated + float(self.cut_work.sum()) - self.work


@dataclass(frozen=True)
class Spread:
    """Distribution of some seconds.

    Attributes
    ----------
    count : int
    median, most, largest : float
        Half of them, 95 % of them, and all of them are at most that, s; NaN if there are none.
    within : dict
        Share within each of the `LIMITS`.
    """

    count: int
    median: float
    most: float
    largest: float
    within: dict[str, float]

    @classmethod
    def of(cls, seconds: Iterable[float]) -> "Spread":
        """Sum up seconds."""
        found = np.array(list(seconds))
        if len(found) == 0:
            return cls(0, float("nan"), float("nan"), float("nan"), {})
        median, most, largest = np.quantile(found, (0.5, 0.95, 1.0))
        within = {name: float(np.mean(found <= limit)) for name, limit in LIMITS.items()}
        return cls(len(found), float(median), float(most), float(largest), within)


class Session:
    """A played scene.

    Parameters
    ----------
    stage : Stage
    account : bool
        Whether to keep the account of the energies. Without it the session runs the hot path of a
        simulator, which is timed.
    clock : callable
        What phases are timed by: wall time in s, or `time.thread_time` where other work on the
        machine shall not be counted.

    Attributes
    ----------
    cutter : SemiProgressiveCutter
    surfaces : Surfaces
    state : MotionState
        Of the unknowns, as they are now.
    phantom : PhantomMesh
        The body as it is now.
    records : list of StepRecord

    Raises
    ------
    XfemError
        If a stroke is not in the space of the mesh, or supports do not fit.
    """

    def __init__(
        self,
        stage: Stage,
        account: bool = True,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        self.stage, self._account, self._clock = stage, account, clock
        self.cutter = SemiProgressiveCutter(stage.mesh)
        ways = KnownWays(stage.mesh, stage.strokes) if stage.opening == "swept" else None
        self._ways = ways if stage.strokes else None
        for path in stage.strokes:
            stroke = self.cutter.begin(path)
            if ways is not None:
                ways.open(stroke)
        self.cut_work = np.zeros(len(stage.strokes))
        self.surfaces = Surfaces(stage, self.cutter)
        self.collider = SurfaceCollider(self.surfaces.touchable)
        self.records: list[StepRecord] = []
        self._start: dict[int, Floats] = {}
        self._crossed = 0
        self._spent = np.zeros(2)  # work and dissipation until the body was last made anew
        self._seconds = dict.fromkeys(PHASES, 0.0)
        self._held = [held_facets(stage.mesh, hold.nodes) for hold in stage.holds]
        self.phantom: PhantomMesh
        self._assemble()
        self.state = self.body.rest()
        self._ledger = BalanceRecorder(self.body, self.state)

    @property
    def time(self) -> float:
        """Time of the scene, s."""
        return self.state.time

    def blade_forces(self, stroke: int, trailing: bool = False) -> tuple[Floats, Floats]:
        """Compute driving force of a blade after each step, and resistance against it, in newtons.

        The driving force is the energy that the body loses per advance: positive pulls the blade
        on. The resistance is toughness times width, less the driving force. In the plane both are
        per metre of thickness; they are smoothed over `Stage.smoothing`.

        Parameters
        ----------
        stroke : int
        trailing : bool
            Whether to return only the last step, over the advance before it.

        Returns
        -------
        driving, resistance : (steps,) or (1,) float array
            NaN while the blade rests; the resistance also where there is no toughness.
        """
        taken, length = self.records[-_LATEST if trailing else 0 :], self.stage.smoothing
        way, work, area = np.array(
            [(r.advance[stroke], r.cut_work[stroke], r.area[stroke]) for r in taken]
        ).T
        tough = self.stage.toughness[stroke] if stroke < len(self.stage.toughness) else None
        left = (np.nan if tough is None else tough) * area - work
        if not trailing:
            return driving_force(way, work, length), driving_force(way, left, length)
        last = way >= way[-1] - length
        found = [driving_force(way[last], x[last], 2.0 * length)[-1:] for x in (work, left)]
        return found[0], found[1]

    @property
    def finished(self) -> bool:
        """Whether the duration of the stage is over."""
        return len(self.records) >= self.stage.steps

    def run(self) -> list[StepRecord]:
        """Play to the end."""
        while not self.finished:
            self.step()
        return self.records

    def begin(self, path: ToolPath) -> None:
        """Begin another stroke, to be extended through `cutter.extend` if the tool is live."""
        self.cutter.begin(path)
        self.cut_work = np.append(self.cut_work, 0.0)
        tie, tool = self.body.tie, self._grips.tool
        self._assemble()
        self.body.tie, self._grips.tool = tie, tool

    def step(self) -> StepRecord:
        """Take one step.

        Raises
        ------
        StepFailedError
            If the solver fails or the motion is not finite.
        """
        self._seconds = dict.fromkeys(PHASES, 0.0)
        end = self.state.time + self.stage.time_step
        self._cut(end)
        self._grip(end)
        with self._timed("motion"):
            if not self._account:
                self.integrator.advance(self.state)
            else:
                self._ledger.record(self.state, self.integrator.step(self.state))
            if isinstance(tie := self.body.tie, TieForces):
                change, now = self.stage.time_step * self.state.velocity, self.state.time
                self.cut_work += tie.work_by_cut(change, now, len(self.cut_work))
                self.body.tie = tie.still(now)
        with self._timed("mapping"):
            self.surfaces.move(self.displacement)
        with self._timed("collision"):
            contacts = self._collide()
        record = self._record(contacts)
        self.records.append(record)
        return record

    @property
    def displacement(self) -> Floats:
        """(N, s) displacement of all unknowns of the cut body, m."""
        return self.state.displacement

    def picture(self) -> Picture:
        """Draw the body as it is now."""
        return self.surfaces.picture(self.phantom, self.displacement)

    def blades(self) -> list[tuple[Floats, Floats]]:
        """Return the tip and other end of each blade under way, m."""
        now = self.state.time
        return [_blade_at(path, now) for path in self._under_way()]

    def hooks(self) -> list[tuple[Floats, Floats]]:
        """Place at the edge of the cut of each hook that has gripped, m, and its vector."""
        found = []
        for number in self._start:
            hook = self.stage.hooks[number]
            if len(nodes := gripped(self.phantom, hook)):
                edge = hook.at_edge(self.stage.strokes[hook.stroke])
                found.append((edge + self.displacement[nodes].mean(axis=0), hook.vector))
        return found

    def _cut(self, until: float) -> None:
        """Lead the blades to a time, and let body and surfaces follow what they have cut."""
        with self._timed("cutting"):
            increment = self.cutter.advance(until)
        if increment is None:
            return
        with self._timed("assembly"):
            state, body = self.state, self.body
            before = MotionState(state.displacement, state.velocity, state.time)
            state.displacement = increment.inherit(state.displacement)
            state.velocity = increment.inherit(state.velocity)
            self._start = {hook: increment.inherit(at) for hook, at in self._start.items()}
            source = np.append(np.arange(increment.nodes_before), increment.source)
            dragged, former = self._grips.tool is not None, self.integrator
            self._assemble()
            self.integrator.follow(former, source)
        with self._timed("cutting"):
            self.surfaces.update(increment)
        if dragged:  # on the facets and unknowns that there are now
            with self._timed("collision"):
                self.surfaces.move(self.displacement)
                self._collide()
        if self._ways is not None:
            with self._timed("assembly"):
                fading = self._ways.fading(self.phantom.node_parent, self.stage.time_step)
                parted = body.near(source[np.flatnonzero(np.bincount(source)[source] > 1)])
                acceleration = acceleration_at_corners(parted, before)
                self.body.tie = tie_forces(
                    body, before, acceleration, self.body, source, fading, parting_cuts
                )
        self._begin_account()

    def _begin_account(self) -> None:
        if self._account:
            self._spent = self._spent_so_far()
            self._ledger = BalanceRecorder(self.body, self.state)

    def _grip(self, time: float) -> None:
        """Let the hooks that begin before a time grip the body where it is now."""
        hooks = enumerate(self.stage.hooks)
        beginning = [n for n, hook in hooks if n not in self._start and hook.begin < time]
        if not beginning:
            return
        for number in beginning:
            self._start[number] = self.state.displacement.copy()
        with self._timed("assembly"):
            stage, weights = self.stage, self.body.mass.weights
            grips = Grips(self.phantom, stage.holds, stage.hooks, weights, self._start, self._held)
            body, grips.tool = self.body.held_by(grips.supports), self._grips.tool
            body.load, former = grips.force, self.integrator
            self._follow(body, grips, former.solver)
            self.integrator.follow(former, np.arange(body.shape[0]))
        self._begin_account()

    def _assemble(self) -> None:
        """Make the body anew as it is cut now, with what holds it from now on."""
        stage, phantom = self.stage, self.cutter.phantom_mesh()
        mass = side_wise_mass(phantom, stage.density)
        grips = Grips(phantom, stage.holds, stage.hooks, mass.weights, self._start, self._held)
        force = InternalForce(phantom, stage.material, kernels=FAST)
        weight = mass.weight(stage.gravity)
        body = DynamicBody(force, mass, weight, grips.force, grips.supports, stage.damping)
        if force.has_one_pass:
            force.prepare(body.pattern)
        self._follow(body, grips, body.step_solver(stage.tolerance))

    def _follow(self, body: DynamicBody, grips: Grips, solver: LinearSolver) -> None:
        """Move with another body from now on."""
        self.body, self._grips, self.phantom = body, grips, body.force.phantom
        self.integrator = RealTimeEuler(body, self.stage.time_step, solver)

    def _collide(self) -> int:
        """Let the collision surface follow, and ask where the tools touch it."""
        self.collider.follow(self.surfaces.touchable_positions)
        if self.collider.positions.shape[1] == 2:
            return 0  # a blade in the plane is a point
        touched = [
            (self.collider.touched(*_blade_at(path, self.time), self.stage.tool_radius), path)
            for path in self._under_way()
        ]
        self._drag(touched)
        return sum(len(contacts.facet) for contacts, _ in touched)

    @property
    def _paths(self) -> list[ToolPath]:
        return [stroke.path for stroke in self.cutter.strokes]

    def _under_way(self) -> list[ToolPath]:
        now = self.state.time
        return [path for path in self._paths if path.times[0] <= now <= path.times[-1]]

    def _drag(self, touched: list[tuple[Contacts, ToolPath]]) -> None:
        """Let the blade drag what it touches along, from the next step on."""
        self._grips.tool = None
        surface = self.surfaces.touchable
        if self.stage.tool_force == 0.0:
            return
        load, h = np.zeros(self.displacement.shape), self.stage.time_step
        for contacts, path in touched:
            here, before = (_blade_at(path, self.state.time - back)[0] for back in (0.0, h))
            length = float(np.linalg.norm(here - before))
            if len(contacts.facet) == 0 or length == 0.0:
                continue
            force = self.stage.tool_force / (length * len(contacts.facet)) * (here - before)
            forces = np.tile(force, (len(contacts.facet), 1))
            surface.add_forces(contacts.facet, contacts.at, forces, load)
        self._grips.tool = load

    def _spent_so_far(self) -> Floats:
        account = self._ledger.close()
        work = account.load_work[-1] + account.support_work[-1]
        lost = account.algorithmic[-1] + account.damping[-1]
        return self._spent + np.array([work, lost])

    def _record(self, contacts: int) -> StepRecord:
        delay = self.cutter.crossings.delay[self._crossed :]
        self._crossed += len(delay)
        state, body = self.state, self.body
        kinetic = 0.5 * float(np.sum(state.velocity * body.mass.apply(state.velocity)))
        assert body.weight is not None
        known = self._ways.areas(state.time) if self._ways is not None else np.empty(0)
        work, lost = self._spent_so_far() if self._account else (np.nan, np.nan)
        return StepRecord(
            step=len(self.records) + 1,
            time=state.time,
            seconds=dict(self._seconds),
            split=int(np.count_nonzero(self.cutter.body.split_cells)),
            newly_split=len(delay),
            unknowns=int(np.prod(body.shape)),
            delay=delay,
            kinetic=kinetic,
            strain=self._ledger.strain if self._account else np.nan,
            potential=-float(np.sum(body.weight * state.displacement)),
            work=float(work),
            dissipated=float(lost),
            cut_work=self.cut_work.copy(),
            advance=np.array([max(path.travel_at(state.time), 0.0) for path in self._paths]),
            area=np.append(known, np.full(len(self.cut_work) - len(known), np.nan)),
            contacts=contacts,
        )

    @contextmanager
    def _timed(self, phase: str) -> Iterator[None]:
        start = self._clock()
        yield
        self._seconds[phase] += self._clock() - start


def _blade_at(path: ToolPath, time: float) -> tuple[Floats, Floats]:
    """Return the tip and other end of a blade at a time."""
    after = min(max(int(np.searchsorted(path.times, time)), 1), len(path.times) - 1)
    begin, end = path.times[after - 1], path.times[after]
    share = min(max((time - begin) / (end - begin), 0.0), 1.0) if end > begin else 0.0
    blade = (1.0 - share) * path.blades[after - 1] + share * path.blades[after]
    return blade[0], blade[-1]


class KnownWays:
    """Strokes whose paths are known: when they open elements, and how forces fade.

    Parameters
    ----------
    mesh : SimplexMesh
    paths : sequence of ToolPath
        In the order of the strokes.
    """

    def __init__(self, mesh: SimplexMesh, paths: Sequence[ToolPath]) -> None:
        gone = SemiProgressiveCutter(mesh)
        for path in paths:
            gone.begin(path)
        gone.advance(np.inf)
        phantom = gone.phantom_mesh()
        self._shares, self._strokes = SweptShares(len(mesh.cells)), gone.strokes
        self._opens, self._passed = [], []
        for k, path in enumerate(paths):
            cells = np.unique(phantom.parent[phantom.label[:, k] != 0])
            cut, passed_at = sections(phantom, cells, k), _passes(path)
            self._opens.append(self._shares.add(cut, passed_at).let_go)
            times = passed_at(cut.points.reshape(-1, mesh.space)).reshape(cut.points.shape[:2])
            self._passed.append((np.sort(times), measures(cut.points)))

    def open(self, stroke: Stroke) -> None:
        """Let a stroke that has not begun open elements ahead of its blade."""
        stroke.open_ahead(self._opens[stroke.number], self._strokes[stroke.number])

    def areas(self, time: float) -> Floats:
        """Compute area (strokes,) that each blade has swept in the body, m² (in the plane m)."""
        return np.array([swept_measure(*passed, time) for passed in self._passed])

    def fading(
        self, place: Ints, step: float
    ) -> Callable[[Ints, float], Callable[[float], Floats]]:
        """Return what makes the factors of the forces on dof nodes, from the start of a step on.

        Parameters
        ----------
        place : (N,) int array
            Mesh node of each dof node.
        step : float
            What opens in it is released at its start, s.
        """
        return lambda nodes, time: self._shares.fading(place[nodes], time, step).at


def _passes(path: ToolPath) -> Callable[[Floats], Floats]:
    return lambda points: path.time_at(path.sweep.probed(points)[:, 2])

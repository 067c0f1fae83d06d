"""A scene on its way: one step cuts, moves, maps and collides, and says what that has cost."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from verify.replay.grips import Grips, held_facets
from verify.replay.stage import Stage
from verify.replay.step_record import PHASES, StepRecord
from verify.replay.surfaces import Picture, Surfaces
from verify.xfem.collision.surface_collider import Contacts, SurfaceCollider
from verify.xfem.cholesky import Cholesky
from verify.xfem.corotational import InternalForce
from verify.xfem.cutting.growing_body import Increment
from verify.xfem.cutting.semi_progressive import SemiProgressiveCutter
from verify.xfem.dynamics import DynamicBody, RealTimeEuler
from verify.xfem.energy_ledger import EnergyLedger
from verify.xfem.mass import side_wise_mass
from verify.xfem.tool_path import ToolPath
from verify.xfem.virtual import VirtualMesh

__all__ = ["Session"]

_Floats = NDArray[np.float64]

_NONE = np.empty(0, dtype=np.int64)


class Session:
    """A played scene.

    Parameters
    ----------
    stage : Stage
    account : bool
        Whether to keep the account of the energies. Without it the hot path is that of a
        simulator: that is what is timed.
    clock : callable
        What phases are timed by: wall time in s, or `time.thread_time` where other work on the
        machine shall not be counted.

    Attributes
    ----------
    cutter : SemiProgressiveCutter
    surfaces : Surfaces
    state : MotionState
        Of the unknowns, as they are now.
    virtual : VirtualMesh
        The body as it is now.
    records : list of StepRecord

    Raises
    ------
    XfemError
        If a stroke is not in the space of the mesh, or supports do not fit.
    """

    def __init__(
        self, stage: Stage, account: bool = True, clock: Callable[[], float] = perf_counter
    ) -> None:
        self.stage, self._account, self._clock = stage, account, clock
        self.cutter = SemiProgressiveCutter(stage.mesh)
        for path in stage.strokes:
            self.cutter.begin(path)
        self.surfaces = Surfaces(stage, self.cutter)
        self.collider = SurfaceCollider(self.surfaces.touchable)
        self.records: list[StepRecord] = []
        self._start: dict[int, _Floats] = {}
        self._tool_load: _Floats | None = None
        self._crossed = 0
        self._spent = np.zeros(2)  # work and dissipation until the body was last made anew
        self._seconds = dict.fromkeys(PHASES, 0.0)
        self._held = [held_facets(stage.mesh, hold.nodes) for hold in stage.holds]
        self._solver: Cholesky | None = None
        self._assemble(_NONE)
        self.state = self.body.rest()
        self._ledger = EnergyLedger(self.body, self.state)

    @property
    def time(self) -> float:
        """Time of the scene, s."""
        return self.state.time

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
        self._assemble(_NONE)

    def step(self) -> StepRecord:
        """Take one step.

        Raises
        ------
        StepFailedError
            If the solver fails or the motion is not finite.
        """
        self._seconds = dict.fromkeys(PHASES, 0.0)
        end = self.state.time + self.stage.time_step
        with self._timed("cutting"):
            increment = self.cutter.advance(end)
            if increment is not None:
                self._inherit(increment)
                self.surfaces.update(increment)
        if self._hooks_begun(end) or increment is not None:
            with self._timed("assembly"):
                self._assemble(_NONE if increment is None else increment.source)
            if self._account:
                self._spent = self._spent_so_far()
                self._ledger = EnergyLedger(self.body, self.state)
        elif self._solver is not None and self._solver.is_worn:
            # what can wait until a step in which nothing is split
            with self._timed("assembly"):
                self._solver = Cholesky(self.body.pattern, self.body.shape[1])
                self.integrator.solver = self._solver
        with self._timed("motion"):
            if not self._account:
                self.integrator.advance(self.state)
            else:
                self._ledger.record(self.state, self.integrator.step(self.state))
        with self._timed("mapping"):
            self.surfaces.move(self.state.displacement)
        with self._timed("collision"):
            contacts = self._collide()
        record = self._record(increment, contacts)
        self.records.append(record)
        return record

    def picture(self) -> Picture:
        """Draw the body as it is now."""
        return self.surfaces.picture(self.virtual, self.state.displacement)

    def blades(self) -> list[tuple[_Floats, _Floats]]:
        """Tip and other end of each blade under way, m."""
        now = self.state.time
        return [_blade_at(path, now) for path in self._under_way()]

    def _inherit(self, increment: Increment) -> None:
        self.state.displacement = increment.inherit(self.state.displacement)
        self.state.velocity = increment.inherit(self.state.velocity)
        self._start = {hook: increment.inherit(values) for hook, values in self._start.items()}

    def _hooks_begun(self, time: float) -> bool:
        before = len(self._start)
        for number, hook in enumerate(self.stage.hooks):
            if number not in self._start and hook.begin < time:
                self._start[number] = self.state.displacement.copy()
        return len(self._start) > before

    def _assemble(self, source: NDArray[np.int64]) -> None:
        """Make the body anew: mass, supports, loads, sparsity and solver.

        `source` (k,) are the unknowns from which those come that are new since the last time.
        """
        stage = self.stage
        self.virtual: VirtualMesh = self.cutter.virtual_mesh()
        mass = side_wise_mass(self.virtual, stage.density)
        self._grips = Grips(
            self.virtual, stage.holds, stage.hooks, mass.weights, self._start, self._held
        )
        self._tool_load = None
        self.body = DynamicBody(
            InternalForce(self.virtual, stage.material),
            mass,
            weight=mass.weight(stage.gravity),
            load=self._load,
            supports=self._grips.supports,
            damping=stage.damping,
        )
        if self._solver is None:
            self._solver = Cholesky(self.body.pattern, stage.mesh.space)
        else:
            self._solver = self._solver.extended(self.body.pattern, source)
        self.integrator = RealTimeEuler(self.body, stage.time_step, self._solver)

    def _load(self, time: float) -> _Floats:
        force = self._grips.force(time)
        return force if self._tool_load is None else force + self._tool_load

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

    def _under_way(self) -> list[ToolPath]:
        now = self.state.time
        paths = [stroke.path for stroke in self.cutter.strokes]
        return [path for path in paths if path.times[0] <= now <= path.times[-1]]

    def _drag(self, touched: list[tuple[Contacts, ToolPath]]) -> None:
        """Let the blade drag what it touches along, from the next step on."""
        self._tool_load = None
        surface = self.surfaces.touchable
        if self.stage.tool_force == 0.0:
            return
        load, h = np.zeros(self.body.shape), self.stage.time_step
        for contacts, path in touched:
            here, before = (_blade_at(path, self.state.time - back)[0] for back in (0.0, h))
            length = float(np.linalg.norm(here - before))
            if len(contacts.facet) == 0 or length == 0.0:
                continue
            force = self.stage.tool_force / (length * len(contacts.facet)) * (here - before)
            for facet, at in zip(contacts.facet, contacts.at, strict=True):
                surface.facet_force(int(facet), at, force, load)
        self._tool_load = load

    def _spent_so_far(self) -> _Floats:
        account = self._ledger.close()
        work = account.load_work[-1] + account.support_work[-1]
        lost = account.algorithmic[-1] + account.damping[-1]
        return self._spent + np.array([work, lost])

    def _record(self, increment: Increment | None, contacts: int) -> StepRecord:
        crossings = self.cutter.crossings if increment is not None else None
        delay = np.empty(0) if crossings is None else crossings.delay[self._crossed :]
        self._crossed += len(delay)
        state, body = self.state, self.body
        kinetic = 0.5 * float(np.sum(state.velocity * body.mass.apply(state.velocity)))
        assert body.weight is not None
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
            strain=float(body.force.evaluate(state.displacement)[1]),
            potential=-float(np.sum(body.weight * state.displacement)),
            work=float(work),
            dissipated=float(lost),
            contacts=contacts,
        )

    @contextmanager
    def _timed(self, phase: str) -> Iterator[None]:
        start = self._clock()
        yield
        self._seconds[phase] = self._clock() - start


def _blade_at(path: ToolPath, time: float) -> tuple[_Floats, _Floats]:
    """Tip and other end of a blade at a time."""
    count = path.blades.shape[1]
    place = [
        [np.interp(time, path.times, path.blades[:, k, i]) for i in range(path.blades.shape[2])]
        for k in (0, count - 1)
    ]
    return np.array(place[0]), np.array(place[1])

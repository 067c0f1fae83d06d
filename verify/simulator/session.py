"""A scene on its way: one step cuts, moves, maps and collides, and says what that has cost."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.cholesky import Cholesky
from verify.simulator.body_parts import BodyParts, held_nodes
from verify.simulator.collision.surface_collider import Contacts, SurfaceCollider
from verify.simulator.cutting.growing_body import Increment
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.grips import Grips, gripped, held_facets
from verify.simulator.stage import Stage
from verify.simulator.staged_cut import MOST, Followed, Pieces, StagedCut
from verify.simulator.step_record import PHASES, StepRecord
from verify.simulator.surfaces import Picture, Surfaces
from verify.simulator.touched_memory import touch_memory
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import ToolPath
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.phantom import PhantomMesh
from verify.xfem.real_time import RealTimeEuler

__all__ = ["Session"]

_Floats = NDArray[np.float64]

# steps before a hook begins: in these two pieces are done in each, in the last no cut is begun
_SOON, _LAST = 8, 3


class Session:
    """A played scene.

    Parameters
    ----------
    stage : Stage
    account : bool
        Whether to keep the account of the energies. Without it the hot path is that of a
        simulator: that is what is timed.
    spread : bool
        Whether what a cut asks for is spread over steps, of which each does one of the pieces of
        `StagedCut`. At most `MOST` elements are split by a cut; the others wait for the next one. A
        replay is the same on any machine. Before a hook begins two pieces are done in each step, so
        that little is left when it does. Until the mechanics follow, new unknowns move as those
        from which they come, so that nothing jumps.
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
        spread: bool = False,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        touch_memory()
        self.stage, self._account, self._clock = stage, account, clock
        self._spread, self._led = spread, float("-inf")  # time up to which the blades have been led
        self._work: Pieces | None = None  # what is left to be done of a cut
        self._ahead: Increment | None = None  # of which the mechanics do not know yet
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
        self._staged = StagedCut(
            self.cutter, self.surfaces, self._parts_after, self._body_of, self._end_of_step,
            self._timed,
        )  # fmt: skip
        self.phantom: PhantomMesh
        self._assemble()
        self.state = self.body.rest()
        self._ledger = BalanceRecorder(self.body, self.state)

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
        self.settle()
        return self.records

    def begin(self, path: ToolPath) -> None:
        """Begin another stroke, to be extended through `cutter.extend` if the tool is live."""
        self._finish()
        self.cutter.begin(path)
        self._assemble()

    def settle(self) -> None:
        """Finish what is left of cuts whose work is spread: the blades are where they are now."""
        self._finish()
        while self.cutter.waits or self._led < self.time:
            self._work = self._cut(self._next_stroke(self.time))
            self._finish()

    def step(self) -> StepRecord:
        """Take one step.

        Raises
        ------
        StepFailedError
            If the solver fails or the motion is not finite.
        """
        self._seconds = dict.fromkeys(PHASES, 0.0)
        end = self._end_of_step()
        hooks = self._hooks_to_begin(end)
        if hooks:
            self._finish()
        busy = self._work is not None
        if self._work is None and (hooks or not self._hook_is_due(_LAST)):
            self._work = self._cut(self._next_stroke(end))
        busy = self._advance() or busy
        if self._hook_is_due(_SOON):
            self._advance()
        if not self._spread:
            self._finish()
        if hooks:
            self.settle()  # a hook grips the body as it is cut by then
            self._grip(hooks)
        with self._timed("motion"):
            if not self._account:
                self.integrator.advance(self.state)
            else:
                self._ledger.record(self.state, self.integrator.step(self.state))
        with self._timed("mapping"):
            self.surfaces.move(self.displacement)
        with self._timed("collision"):
            contacts = self._collide()
        record = self._record(contacts, busy)
        self.records.append(record)
        return record

    @property
    def displacement(self) -> _Floats:
        """(N, s) displacement of all unknowns of the cut body, known to the mechanics or not, m."""
        known = self.state.displacement
        return known if self._ahead is None else self._ahead.inherit(known)

    def picture(self) -> Picture:
        """Draw the body as it is now."""
        return self.surfaces.picture(self.phantom, self.displacement)

    def blades(self) -> list[tuple[_Floats, _Floats]]:
        """Tip and other end of each blade under way, m."""
        now = self.state.time
        return [_blade_at(path, now) for path in self._under_way()]

    def hooks(self) -> list[tuple[_Floats, _Floats]]:
        """Place at the edge of the cut of each hook that has gripped, m, and its vector."""
        found = []
        for number in self._start:
            hook = self.stage.hooks[number]
            if len(nodes := gripped(self.phantom, hook)):
                edge = hook.at_edge(self.stage.strokes[hook.stroke])
                found.append((edge + self.displacement[nodes].mean(axis=0), hook.vector))
        return found

    def _next_stroke(self, end: float) -> float:
        """How far to lead the blades: where work is spread, two strokes are not cut in one go."""
        if self.cutter.waits:
            return self._led
        until = end
        if self._spread:
            begins = [stroke.path.times[0] for stroke in self.cutter.strokes]
            later = [t for t in begins if t > np.nextafter(self._led, np.inf)]
            until = min([end, *np.nextafter(later, -np.inf)])
        self._led = until
        return float(until)

    def _advance(self) -> bool:
        """Do the next piece of the work of a cut; whether there are more."""
        if self._work is None:
            return False
        try:
            self._ahead = next(self._work)
        except StopIteration as done:
            self._work = None
            if done.value is not None:
                self._follow_cut(done.value)
            return False
        return True

    def _follow_cut(self, followed: Followed) -> None:
        increment, body, grips, solver = followed
        with self._timed("assembly"):
            self._inherit(increment)
            self._follow(body, grips, solver)
        self._begin_account()

    def _cut(self, until: float) -> Pieces:
        return self._staged.pieces(until, MOST if self._spread else None, self._solver)

    def _finish(self) -> None:
        while self._advance():
            pass

    def _begin_account(self) -> None:
        if self._account:
            self._spent = self._spent_so_far()
            self._ledger = BalanceRecorder(self.body, self.state)

    def _inherit(self, increment: Increment) -> None:
        self.state.displacement = increment.inherit(self.state.displacement)
        self.state.velocity = increment.inherit(self.state.velocity)
        self._start = {hook: increment.inherit(values) for hook, values in self._start.items()}

    def _hooks_to_begin(self, time: float) -> list[int]:
        hooks = enumerate(self.stage.hooks)
        return [n for n, hook in hooks if n not in self._start and hook.begin < time]

    def _hook_is_due(self, steps: int) -> bool:
        """Whether work that is spread must be done soon: a hook finishes it as it begins."""
        if not self._spread:
            return False
        return bool(self._hooks_to_begin(self._end_of_step() + steps * self.stage.time_step))

    def _grip(self, hooks: list[int]) -> None:
        """Let hooks grip the body where it is now."""
        for number in hooks:
            self._start[number] = self.state.displacement.copy()
        with self._timed("assembly"):
            stage, weights = self.stage, self.body.mass.weights
            grips = Grips(self.phantom, stage.holds, stage.hooks, weights, self._start, self._held)
            self._follow(self.body.held_by(grips.supports), grips, self._solver)
        self._begin_account()

    def _parts(self, phantom: PhantomMesh, start: dict[int, _Floats]) -> BodyParts:
        return BodyParts.of(self.stage, phantom, start, self._held)

    def _parts_after(self, increment: Increment, phantom: PhantomMesh) -> BodyParts:
        start = {hook: increment.inherit(at) for hook, at in self._start.items()}
        return self._parts(phantom, start)

    def _body_of(self, parts: BodyParts) -> DynamicBody:
        return parts.body(self._load)

    def _end_of_step(self) -> float:
        return self.state.time + self.stage.time_step

    def _assemble(self) -> None:
        """Make the body anew that is there already, with what holds it from now on."""
        parts = self._parts(self.cutter.phantom_mesh(), self._start)
        body = self._body_of(parts)
        solver = Cholesky(body.pattern, self.stage.mesh.space, held_nodes(body))
        self._follow(body, parts.grips, solver)

    def _follow(self, body: DynamicBody, grips: Grips, solver: Cholesky) -> None:
        """Move with another body from now on."""
        self.body, self._grips, self.phantom = body, grips, body.force.phantom
        self._tool_load, self._ahead = None, None
        self._solver = solver
        self.integrator = RealTimeEuler(body, self.stage.time_step, solver)

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
        load, h = np.zeros(self.displacement.shape), self.stage.time_step
        for contacts, path in touched:
            here, before = (_blade_at(path, self.state.time - back)[0] for back in (0.0, h))
            length = float(np.linalg.norm(here - before))
            if len(contacts.facet) == 0 or length == 0.0:
                continue
            force = self.stage.tool_force / (length * len(contacts.facet)) * (here - before)
            for facet, at in zip(contacts.facet, contacts.at, strict=True):
                surface.facet_force(int(facet), at, force, load)
        known = len(self.state.displacement)
        if self._ahead is not None:
            # what pulls at an unknown that still moves as another one does, pulls at that
            np.add.at(load, self._ahead.source, load[known:])
        self._tool_load = load[:known]

    def _spent_so_far(self) -> _Floats:
        account = self._ledger.close()
        work = account.load_work[-1] + account.support_work[-1]
        lost = account.algorithmic[-1] + account.damping[-1]
        return self._spent + np.array([work, lost])

    def _record(self, contacts: int, busy: bool) -> StepRecord:
        delay = self.cutter.crossings.delay[self._crossed :]
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
            busy=busy,
        )

    @contextmanager
    def _timed(self, phase: str) -> Iterator[None]:
        start = self._clock()
        yield
        self._seconds[phase] += self._clock() - start


def _blade_at(path: ToolPath, time: float) -> tuple[_Floats, _Floats]:
    """Tip and other end of a blade at a time."""
    after = min(max(int(np.searchsorted(path.times, time)), 1), len(path.times) - 1)
    begin, end = path.times[after - 1], path.times[after]
    share = min(max((time - begin) / (end - begin), 0.0), 1.0) if end > begin else 0.0
    blade = (1.0 - share) * path.blades[after - 1] + share * path.blades[after]
    return blade[0], blade[-1]

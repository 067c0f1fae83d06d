"""Motion on a conforming mesh whose facets open on the way, whole cuts or behind a blade."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.boundary_values import constrained_values
from reference.dynamics import Scheme, generalised_alpha, implicit_euler, inherit
from reference.dynamics_body import MovingBody
from reference.dynamics_cuts import opening_times, partly_opened
from reference.dynamics_ledger import Ledger
from reference.dynamics_step import State, Stepper
from reference.dynamics_ties import facing_nodes
from reference.fracture.pressure import MIXED
from reference.moduli import wave_speed
from reference.space import ConformingSpace, conforming_space
from reference.tied_solver import lasting_ties
from reference.weak_place import naming_weak_places
from verify.declared_mass import CONSISTENT
from verify.scene import Equilibrium, InitialField, Moving, Scene, ToolPathCut
from verify.scene.cuts import Cut
from verify.scene.initial import starts_open
from verify.solvers.runs import Record

Array = NDArray[np.float64]
_SAME = 1e-12  # of the duration: times that close are one
_PASSED = 1e-9  # of the duration: what is passed so little later counts as passed
_MOST_TIES = 6000  # of which the dense factor has 0.3 GB
_SOLVES = 20  # that take as long as a factorisation
SCHEMES = ("newmark", "energy_momentum", "implicit_euler", "generalised_alpha")


@dataclass(frozen=True)
class Marching:
    """How a motion is integrated.

    Attributes
    ----------
    name : str
        One of `SCHEMES`.
    largest : float
        Largest time step, s; a stop that is closer cuts it short.
    spectral_radius : float
        Of generalised-α at infinite frequency.
    delay : float
        By which facets on tool paths open late, s.
    halvings : int
        How often every step is halved that would be taken.
    """

    name: str
    largest: float
    spectral_radius: float = 0.8
    delay: float = 0.0
    halvings: int = 0

    def count(self, span: float) -> int:
        """Count the equal steps over a time between two stops, s.

        The steps are halved and not `largest`: where stops cut it short that would change nothing.
        """
        return max(1, int(np.ceil(span / self.largest * (1 - 1e-9)))) * 2**self.halvings

    def scheme(self) -> tuple[Scheme, bool]:
        """Give the scheme, and whether the internal force is the mean of a step."""
        if self.name == "implicit_euler":
            return implicit_euler(), False
        radius = self.spectral_radius if self.name == "generalised_alpha" else 1.0
        return generalised_alpha(radius), self.name == "energy_momentum"


def natural_step(scene: Scene, size: float) -> float:
    """Time in which a pressure wave crosses an element of a size, s."""
    return size / wave_speed(scene.material)


def move(
    scene: Scene,
    space: ConformingSpace,
    exact: Any,
    marching: Marching,
    record: Record,
    comm: Any = None,
    pressure: bool = False,
    trial: bool = False,
) -> dict[str, Any]:
    """Integrate the motion of a dynamic scene; return its fields of `Solution`.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
        With all cuts open.
    exact : ExactSolution or None
    marching : Marching
    record : Record
        Gets timings, iterations and notes.
    comm : MPI communicator, optional
        Of the ranks that share the work, each with the whole answer; default: each by itself.
    pressure : bool
        Whether linear kinematics have the pressure as an unknown.
    trial : bool
        Whether to stop after the first step: what compiles, compiles in it.

    Raises
    ------
    InputError
        If a support or load acts nowhere, a piece that is to be in equilibrium is not held, or
        part of one so weakly that round-off is all there is.
    RuntimeError
        If a step or the initial equilibrium is not found.
    """
    return _Mover(scene, space, exact, marching, record, comm, pressure).run(trial)


class _Mover:
    """One motion, from stop to stop: outputs, openings of whole cuts, kinks of histories."""

    def __init__(
        self,
        scene: Scene,
        space: ConformingSpace,
        exact: Any,
        marching: Marching,
        record: Record,
        comm: Any,
        pressure: bool,
    ) -> None:
        self.scene, self.space, self.exact = scene, space, exact
        self.comm, self.marching, self.record = comm, marching, record
        pressure = pressure and scene.analysis.kinematics == "linear"
        self.unknowns = MIXED if pressure else "displacement"
        self.times = np.array(scene.analysis.output_times)
        self.end = float(self.times[-1])
        phases = ("loading", "initial state", "steps", "accounting")
        record.timings |= dict.fromkeys(phases, 0.0)
        with record.timed("loading"):
            self.body = MovingBody(scene, space, exact, pressure)
            self.facing = facing_nodes(space)
            self.opening = self._snapped(opening_times(scene, space.mesh, marching.delay))
            self.closed = np.ones(len(self.opening), dtype=bool)
            self.planned = self._plan()
        self.ledger = Ledger()
        self.steppers: dict[float, Stepper] = {}
        self.steps = self.openings = 0
        scheme, _ = marching.scheme()
        # of others the old acceleration has no part in the step, or only with the forces of then
        self.softly = scene.analysis.damping[1] > 0.0 and scheme.alpha_m != scheme.alpha_f

    def run(self, trial: bool) -> dict[str, Any]:
        """Run to the end, or for one step; return the fields."""
        record = self.record
        with naming_weak_places(self.scene, self.space, self.body.ties):
            with record.timed("initial state"):
                state = self._initial()
            states = self._march(state, trial)
        shape = (len(states), -1, self.space.dimension)
        linear = self.scene.analysis.kinematics == "linear"
        for stepper in self.steppers.values():
            stepper.close()
        newton = sum(stepper.solves for stepper in self.steppers.values())
        record.iterations |= {"steps": self.steps, "newton": newton}
        record.notes |= self._notes()
        return {
            "times": self.times[: len(states)],
            "displacement": np.reshape([state.displacement for state in states], shape),
            "velocity": np.reshape([state.velocity for state in states], shape),
            "acceleration": np.reshape([state.acceleration for state in states], shape)
            if linear
            else None,
            "mass": CONSISTENT,
            "ledger": self.ledger.columns(),
            "unknowns": self.space.node_points.size,
        }

    def _plan(self) -> bool:
        """Choose between one factorisation with all that is ever tied, and one per opening.

        The first takes as many solves as there are ties, once. Where nothing is factorised at
        first neither is planned.
        """
        if self.scene.analysis.kinematics != "linear" or self.body.iterates:
            return False
        lasting = lasting_ties(self.facing, self.opening)
        ties = lasting.size // 2 * self.space.dimension
        step = self.marching.largest / 2**self.marching.halvings
        openings = len(np.unique(np.ceil(self.opening / step)))
        if not 0 < ties <= min(_MOST_TIES, _SOLVES * openings):
            return False
        self.body.plan(lasting)
        return True

    def _snapped(self, times: Array) -> Array:
        """Give output times for those that are the same up to round-off."""
        if not len(times):
            return times
        nearest = self.times[np.abs(self.times[:, None] - times).argmin(axis=0)]
        return np.where(np.abs(nearest - times) <= _SAME * self.end, nearest, times)

    def _open(self, time: float) -> bool:
        """Open what is due at a time; say whether anything was."""
        due = self.closed & (self.opening <= time + _PASSED * self.end)
        if not due.any():
            return False
        with self.record.timed("loading"):
            self._tie(self.closed & ~due)
        self.openings += 1
        return True

    def _tie(self, closed: NDArray[np.bool_]) -> None:
        self.closed = closed
        self.body.tie(self.facing[closed].reshape(-1, 2))
        for stepper in self.steppers.values() if not self.planned else ():
            stepper.close()

    def _initial(self) -> State:
        """State at the time 0, before what opens then."""
        initial, body, d = self.scene.initial, self.body, self.space.dimension
        balanced = isinstance(initial, Equilibrium)
        if not (starts_open(initial) and self._open(0.0)):
            self._tie(self.closed)
        u, v = np.zeros((2, self.space.node_points.size))
        if isinstance(initial, Moving):
            v = initial.velocities(self.space.node_points.reshape(-1, d)).ravel()
        elif isinstance(initial, InitialField):
            fields = initial.state(self.space.node_points, self.space.beside_nodes(), self.exact)
            u, v = (body.ties.mean(field.ravel()) for field in fields)
        elif balanced:
            u = self._equilibrium()
        if not balanced:
            u[body.held] = body.prescribed(0.0)[0]
        v[body.held] = body.prescribed(0.0)[1]
        return State(u, v, np.zeros_like(u), 0.0)

    def _equilibrium(self) -> Array:
        """Displacement at which the body is at rest with what is closed, which must hold it."""
        before = self.space
        if self.closed.any():
            mesh = partly_opened(self.space.mesh, ~self.closed)
            before = conforming_space(mesh, self.space.degree, self.comm)
        constrained_values(self.scene, before, self.exact)  # says which piece is not held
        if self.scene.analysis.kinematics == "linear" or before is self.space:
            return self.body.equilibrium()
        found = MovingBody(self.scene, before, self.exact).equilibrium()
        return inherit(before, self.space, found.reshape(-1, self.space.dimension)).ravel()

    def _march(self, state: State, trial: bool) -> list[State]:
        """Step from stop to stop; return the states at the outputs."""
        own = [float(getattr(cut, "opens_at", 0.0)) for cut in self.scene.cuts if not _grows(cut)]
        breaks = self._breaks()
        stops = np.unique([0.0, *self._snapped(np.array(own)), *self.times, *breaks])
        outputs = []
        self.ledger.open(self.body, state)
        for k, stop in enumerate(stops):
            state.time = float(stop)  # without the round-off of the sum of steps
            begun = self._open(state.time) or k == 0
            if begun:
                self._begin(state)
            if stop in self.times:
                outputs.append(self._balanced(state, begun))
                self.ledger.enter(self.body, state)
            if k == len(stops) - 1:
                break
            if not begun and np.abs(breaks - stop).min(initial=np.inf) <= _SAME * self.end:
                self._begin(state)
                begun = True
            self._advance(state, float(stops[k + 1]), begun, 1 if trial else None)
            if trial:
                break
        return outputs

    def _advance(self, state: State, end: float, begun: bool, most: int | None) -> None:
        """Step to a time by equal steps, and open on the way what was passed."""
        span = end - state.time
        count = self.marching.count(span)
        size = float(f"{span / count:.14g}")  # the same up to round-off: one stepper
        if size not in self.steppers:
            scheme, averaged = self.marching.scheme()
            self.steppers[size] = Stepper(self.body, scheme, averaged, size)
        for n in range(most or count):
            if n and self._open(state.time):
                self._begin(state, balanced=not self.softly)
                begun = True
            if begun and self.softly:
                with self.record.timed("loading"):
                    forces = self._unbalanced(state, state.time + _SAME * self.end)
                    self.steppers[size].restart(state, forces)
            self._step(self.steppers[size], state)
            begun = False

    def _begin(self, state: State, balanced: bool = True) -> None:
        """Take up what jumps: velocities of supports and, if balanced, accelerations."""
        body = self.body
        with self.record.timed("loading"):
            state.velocity[body.held] = body.prescribed(state.time)[1]
            self.ledger.started(body, state)
            if balanced:
                state.acceleration = self._acceleration(state, state.time + _SAME * self.end)

    def _balanced(self, state: State, begun: bool) -> State:
        """Copy a state, with the acceleration that balances its forces.

        Where accelerations and forces are those of the same share of a step, it has it already:
        what is in balance at the start of a step is at its end.
        """
        found = state.copy()
        scheme, _ = self.marching.scheme()
        linear = self.scene.analysis.kinematics == "linear"
        if linear and not begun and scheme.alpha_m != scheme.alpha_f:
            found.acceleration = self._acceleration(state, state.time)
        return found

    def _acceleration(self, state: State, time: float) -> Array:
        """Acceleration of a state in balance with the loads at a time."""
        return self.body.accelerations(self._unbalanced(state, time))

    def _unbalanced(self, state: State, time: float) -> Array:
        """Sum the forces of a state at a time that inertia has to balance, N."""
        body = self.body
        law, (mass, stiffness) = body.law, self.scene.analysis.damping
        forces = body.external(time) - law.force(state.displacement)
        forces -= mass * (body.mass @ state.velocity)
        if stiffness:
            forces -= stiffness * law.viscous(state.displacement, state.velocity)
        return forces

    def _step(self, stepper: Stepper, state: State) -> None:
        with self.record.timed("steps"):
            before = state.copy()
            forces = stepper.step(state)
        with self.record.timed("accounting"):
            self.ledger.record(self.body, before, state, forces)
        self.steps += 1

    def _breaks(self) -> Array:
        """Return times at which the history of a load or support has a kink or jumps."""
        parts = [*self.scene.supports, *self.scene.loads]
        found = np.array([t for part in parts for t, _ in getattr(part, "history", None) or ()])
        slack = _SAME * self.end
        return self._snapped(found[(found > slack) & (found < self.end - slack)])

    def _notes(self) -> dict[str, str]:
        sizes = sorted(self.steppers)
        said = " … ".join(f"{s:.6g} s" for s in dict.fromkeys((sizes[0], sizes[-1])))
        notes = {"scheme": self.marching.name, "mass": "consistent", "time step": said}
        if any(map(_grows, self.scene.cuts)):
            notes["openings"] = str(self.openings)
        return {**notes, "unknowns": self.unknowns}


def _grows(cut: Cut) -> bool:
    return isinstance(cut, ToolPathCut)

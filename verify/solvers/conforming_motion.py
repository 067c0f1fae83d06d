"""Motion on a conforming mesh: stages between the openings of cuts, steps between the outputs."""

from dataclasses import dataclass, field
from itertools import pairwise
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.dynamics import Scheme, generalised_alpha, implicit_euler, inherit
from reference.dynamics_body import MovingBody
from reference.dynamics_cuts import partly_opened
from reference.dynamics_ledger import Ledger
from reference.dynamics_step import State, Stepper
from reference.fracture.pressure import MIXED
from reference.meshing import ConformingMesh
from reference.space import ConformingSpace, conforming_space
from reference.weak_place import naming_weak_places
from verify.scene import Equilibrium, InitialField, Moving, Scene
from verify.scene.initial import starts_open

__all__ = ["SCHEMES", "ConformingMotion", "TimeScheme", "move", "natural_step"]

Array = NDArray[np.float64]
_SAME = 1e-12  # of the duration: times that close are one
# the scheme, and whether the internal force is the mean of a step
SCHEMES: dict[str, tuple[Scheme, bool]] = {
    "newmark": (generalised_alpha(), False),
    "energy_momentum": (generalised_alpha(), True),
    "implicit_euler": (implicit_euler(), False),
    "generalised_alpha": (generalised_alpha(0.8), False),
}


class TimeScheme(NamedTuple):
    """One of `SCHEMES`, and the spectral radius at infinite frequency if it is generalised-α."""

    name: str
    spectral_radius: float = 0.8

    def found(self) -> tuple[Scheme, bool]:
        """Return the scheme, and whether the internal force is the mean of a step."""
        if self.name == "generalised_alpha":
            return generalised_alpha(self.spectral_radius), False
        return SCHEMES[self.name]


@dataclass
class ConformingMotion:
    """A computed motion, on the space with all cuts open.

    Attributes
    ----------
    space : ConformingSpace
    times : (t,) array
        s.
    displacement, velocity : (t, n, d) arrays
        m, m/s.
    acceleration : (t, n, d) array, optional
        m/s², that balances the forces of the same time; of linear kinematics only.
    ledger : dict of str to (t,) array
    timings : dict of str to float
    iterations : dict of str to int
    notes : dict of str to str
    """

    space: ConformingSpace
    times: Array
    displacement: Array
    velocity: Array
    acceleration: Array | None
    ledger: dict[str, Array]
    timings: dict[str, float]
    iterations: dict[str, int]
    notes: dict[str, str] = field(default_factory=dict)


def natural_step(scene: Scene, size: float) -> float:
    """Time in which a pressure wave crosses an element of a size, s."""
    material = scene.material
    assert material.density is not None  # the scene has checked it
    e, nu = material.young, material.poisson
    modulus = e * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    return float(size / np.sqrt(modulus / material.density))


def move(
    scene: Scene,
    mesh: ConformingMesh,
    degree: int,
    exact: Any,
    scheme: TimeScheme,
    largest: float,
    comm: Any = None,
    pressure: bool = False,
    trial: bool = False,
) -> ConformingMotion:
    """Integrate the motion of a dynamic scene.

    Parameters
    ----------
    scene : Scene
    mesh : ConformingMesh
        With all cuts open.
    degree : {1, 2}
    exact : ExactSolution or None
    scheme : TimeScheme
    largest : float
        Largest time step, s.
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
    return _Mover(scene, mesh, degree, exact, scheme, largest, comm, pressure).run(trial)


class _Mover:
    """One motion, stage by stage."""

    def __init__(
        self,
        scene: Scene,
        mesh: ConformingMesh,
        degree: int,
        exact: Any,
        scheme: TimeScheme,
        largest: float,
        comm: Any,
        pressure: bool,
    ) -> None:
        self.scene, self.mesh, self.degree, self.exact = scene, mesh, degree, exact
        self.comm = comm
        self.pressure = pressure and scene.analysis.kinematics == "linear"
        self.scheme, self.largest = scheme, largest
        self.times = np.array(scene.analysis.output_times)
        self.opens = [self._snapped(float(getattr(cut, "opens_at", 0.0))) for cut in scene.cuts]
        self.spaces: dict[tuple[bool, ...], ConformingSpace] = {}
        self.ledger = Ledger()
        phases = ("loading", "initial state", "steps", "accounting")
        self.timings = dict.fromkeys(phases, 0.0)
        self.steps = self.solves = 0
        self.sizes: set[float] = set()

    def run(self, trial: bool) -> ConformingMotion:
        """Run all stages and carry the fields of each to the mesh with all cuts open."""
        initial = self.scene.initial
        open_before = starts_open(initial)
        space = self._space(0.0 if open_before else -1.0)
        clock = perf_counter()
        with naming_weak_places(self.scene, space):
            state = self._initial(self._body(space))
        self.timings["initial state"] += perf_counter() - clock
        starts = sorted({0.0, *self.opens})
        outputs: list[tuple[ConformingSpace, State]] = []
        for k, start in enumerate(starts):
            clock = perf_counter()
            opened = self._space(start)
            state = _carried(space, opened, state)
            space, body = opened, self._body(opened)
            self.timings["loading"] += perf_counter() - clock
            last = k == len(starts) - 1
            end = float(self.times[-1]) if last else starts[k + 1]
            wanted = self.times[(self.times >= start) & ((self.times < end) | last)]
            with naming_weak_places(self.scene, space):
                stage = self._stage(body, state, start, end, wanted, trial)
            outputs += [(space, output) for output in stage]
            if trial:
                break
        final = self._space(np.inf)
        states = [_carried(space, final, state) for space, state in outputs]
        shape = (len(states), -1, self.mesh.dimension)
        return ConformingMotion(
            final,
            self.times[: len(states)],
            np.reshape([state.displacement for state in states], shape),
            np.reshape([state.velocity for state in states], shape),
            np.reshape([state.acceleration for state in states], shape)
            if self.scene.analysis.kinematics == "linear"
            else None,
            self.ledger.columns(),
            self.timings,
            {"steps": self.steps, "newton": self.solves},
            self._notes(),
        )

    def _snapped(self, time: float) -> float:
        """Return the output time that is the same up to round-off, if there is one."""
        nearest = float(self.times[np.abs(self.times - time).argmin()])
        return nearest if abs(nearest - time) <= _SAME * self.times[-1] else time

    def _space(self, time: float) -> ConformingSpace:
        """Space with the cuts open that open up to a time."""
        opened = tuple(opens <= time for opens in self.opens)
        if opened not in self.spaces:
            mesh = partly_opened(self.scene, self.mesh, opened)
            self.spaces[opened] = conforming_space(mesh, self.degree, self.comm)
        return self.spaces[opened]

    def _body(self, space: ConformingSpace) -> MovingBody:
        return MovingBody(self.scene, space, self.exact, self.pressure)

    def _initial(self, body: MovingBody) -> State:
        """State at the time 0, before what opens then."""
        initial, d = self.scene.initial, self.mesh.dimension
        u, v = np.zeros((2, body.space.node_points.size))
        if isinstance(initial, Moving):
            v = initial.velocities(body.space.node_points.reshape(-1, d)).ravel()
        elif isinstance(initial, InitialField):
            fields = initial.state(body.space.node_points, body.space.beside_nodes(), self.exact)
            u, v = (field.ravel() for field in fields)
        elif isinstance(initial, Equilibrium):
            u = body.equilibrium()
        if not isinstance(initial, Equilibrium):
            u[body.held] = body.prescribed(0.0)[0]
        v[body.held] = body.prescribed(0.0)[1]
        return State(u, v, np.zeros_like(u), 0.0)

    def _stage(
        self,
        body: MovingBody,
        state: State,
        start: float,
        end: float,
        wanted: Array,
        trial: bool,
    ) -> list[State]:
        """Step from one opening to the next; return the states at the times that are wanted."""
        scheme, averaged = self.scheme.found()
        breaks = self._breaks(start, end)
        stops = np.unique([start, end, *wanted, *breaks])
        steppers: dict[float, Stepper] = {}
        outputs = []
        self.ledger.open(body, state)
        self._begin(body, state)
        if start in wanted:
            outputs.append(state.copy())
            self.ledger.enter(body, state)
        for a, b in pairwise(stops):
            count = max(1, int(np.ceil((b - a) / self.largest * (1 - 1e-9))))
            size = float(f"{(b - a) / count:.14g}")  # the same up to round-off: one stepper
            self.sizes.add(size)
            if size not in steppers:
                steppers[size] = Stepper(body, scheme, averaged, size)
            if np.abs(np.array(breaks) - a).min(initial=np.inf) <= _SAME * self.times[-1]:
                self._begin(body, state)
            for _ in range(1 if trial else count):
                self._step(body, steppers[size], state)
            if trial:
                break
            state.time = float(b)  # without the round-off of the sum of steps
            if b in wanted:
                outputs.append(self._balanced(body, state, scheme))
                self.ledger.enter(body, state)
        self.solves += sum(stepper.solves for stepper in steppers.values())
        for stepper in steppers.values():
            stepper.close()
        return outputs

    def _begin(self, body: MovingBody, state: State) -> None:
        """Take up what jumps at this time: velocities of supports, accelerations."""
        state.velocity[body.held] = body.prescribed(state.time)[1]
        self.ledger.started(body, state)
        size = _SAME * float(self.times[-1])
        state.acceleration = self._acceleration(body, state, state.time + size)

    def _balanced(self, body: MovingBody, state: State, scheme: Scheme) -> State:
        """Copy a state, with the acceleration that balances its forces.

        Where accelerations and forces are those of the same share of a step, it has it already:
        what is in balance at the start of a step is at its end.
        """
        found = state.copy()
        if self.scene.analysis.kinematics == "linear" and scheme.alpha_m != scheme.alpha_f:
            found.acceleration = self._acceleration(body, state, state.time)
        return found

    def _acceleration(self, body: MovingBody, state: State, time: float) -> Array:
        """Acceleration of a state in balance with the loads at a time."""
        law, (mass, stiffness) = body.law, self.scene.analysis.damping
        forces = body.external(time) - law.force(state.displacement)
        forces -= mass * (body.mass @ state.velocity)
        if stiffness:
            forces -= stiffness * law.viscous(state.displacement, state.velocity)
        return body.accelerations(forces)

    def _step(self, body: MovingBody, stepper: Stepper, state: State) -> None:
        clock = perf_counter()
        before = state.copy()
        forces = stepper.step(state)
        stepped = perf_counter()
        self.ledger.record(body, before, state, forces)
        self.timings["steps"] += stepped - clock
        self.timings["accounting"] += perf_counter() - stepped
        self.steps += 1

    def _breaks(self, start: float, end: float) -> list[float]:
        """Return times in between at which the history of a load or support has a kink or jumps."""
        parts = [*self.scene.supports, *self.scene.loads]
        found = [t for part in parts for t, _ in getattr(part, "history", None) or ()]
        slack = _SAME * float(self.times[-1])
        return [self._snapped(t) for t in found if start + slack < t < end - slack]

    def _notes(self) -> dict[str, str]:
        sizes = sorted(self.sizes)
        said = " … ".join(f"{s:.6g} s" for s in dict.fromkeys((sizes[0], sizes[-1])))
        unknowns = MIXED if self.pressure else "displacement"
        notes = {"scheme": self.scheme.name, "mass": "consistent", "time step": said}
        return {**notes, "unknowns": unknowns}


def _carried(space: ConformingSpace, other: ConformingSpace, state: State) -> State:
    """Carry a state over to the same mesh with more of its cuts open."""
    if other is space:
        return state
    d = space.dimension
    fields = (state.displacement, state.velocity, state.acceleration)
    u, v, a = (inherit(space, other, f.reshape(-1, d)).ravel() for f in fields)
    return State(u, v, a, state.time)

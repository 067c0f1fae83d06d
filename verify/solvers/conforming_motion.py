"""Motion on a conforming mesh whose facets open on the way, whole cuts or behind a blade."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.boundary_conditions import constrained_values
from reference.deformation import wave_speed
from reference.dynamics_body import MovingBody, Release, facet_openings, inherit, partly_opened
from reference.dynamics_step import (
    Ledger,
    Scheme,
    ShortWaves,
    State,
    Stepper,
    generalised_alpha,
    implicit_euler,
    momenta_of,
)
from reference.fracture.cells import MIXED
from reference.inside_out import naming_weak_places
from reference.nodal_algebra import facing_nodes, lasting_ties
from reference.space import ConformingSpace, conforming_space
from verify.geometry.simplices import nearest_cut
from verify.scene import Equilibrium, InitialField, Moving, Scene, ToolPathCut
from verify.scene.tables import starts_open
from verify.solution import ContactPressure
from verify.solution_checks import CONSISTENT
from verify.solvers.runs import (
    LedgerRows,
    Record,
    march,
    notes_of_steps,
    pressure_at_end,
    timeline_of,
    work_of_blades,
)

Array = NDArray[np.float64]
_JUST = 1e-12  # of the duration: loads are taken that much later, after a jump
_MOST_TIES = 6000  # of which the dense factor has 0.3 GB
_SOLVES = 20  # that take as long as a factorisation
_HALVINGS = 4  # of a step that is not solved
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
        As of `timeline.march`.
    opening : {"late", "swept"}
        When facets behind a blade open; see docs/theory/dynamics.md.
    element : float
        Size of the elements, m.
    """

    name: str
    largest: float
    spectral_radius: float = 0.8
    delay: float = 0.0
    halvings: int = 0
    opening: str = "late"
    element: float = np.nan

    def scheme(self) -> tuple[Scheme, bool]:
        """Give the scheme, and whether the internal force is the mean of a step."""
        if self.name == "implicit_euler":
            return implicit_euler(), False
        radius = self.spectral_radius if self.name == "generalised_alpha" else 1.0
        return generalised_alpha(radius), self.name == "energy_momentum"


def natural_step(scene: Scene, size: float) -> float:
    """Time in which a pressure wave crosses an element of a size, s."""
    return size / wave_speed(scene.material)


@dataclass(eq=False)
class TiedMotion:
    """A body on a mesh with all its cuts, tied where they are closed: a `timeline.Mover`.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
        With all cuts open.
    exact : ExactSolution or None
    marching : Marching
    record : Record
        Gets timings, iterations and notes.
    comm : MPI communicator or None
        Of the ranks that share the work, each with the whole answer; None: each by itself.
    pressure : bool
        Whether linear kinematics have the pressure as an unknown.

    Raises
    ------
    InputError
        If a support or load acts nowhere.
    """

    scene: Scene
    space: ConformingSpace
    exact: Any
    marching: Marching
    record: Record
    comm: Any
    pressure: bool

    def __post_init__(self) -> None:
        scene, space, marching, record = self.scene, self.space, self.marching, self.record
        self.timeline = timeline_of(scene, kinks=True)
        pressure = self.pressure and scene.analysis.kinematics == "linear"
        self.unknowns = MIXED if pressure else "displacement"
        phases = ("loading", "initial state", "steps", "accounting")
        record.timings |= dict.fromkeys(phases, 0.0)
        with record.timed("loading"):
            self.body = MovingBody(scene, space, self.exact, pressure)
            self.facing = facing_nodes(space)
            swept = marching.opening == "swept"
            self.opening = facet_openings(scene, space, self.facing, swept, marching.delay)
            self.closed = np.ones(self.opening.times.shape, dtype=bool)
            self._plan()
        self.ledger, self.rows = Ledger(), LedgerRows()
        blades = any(isinstance(cut, ToolPathCut) for cut in scene.cuts)
        self.waves = ShortWaves(self.body, marching.element) if blades else None
        self.steppers: dict[float, Stepper] = {}
        self.outputs: list[State] = []
        self.pressures: list[Array] = []  # of contact, at the outputs
        self.openings = 0
        self.halved = 0  # steps that were not solved as a whole
        self.begun = False  # whether something has jumped since the last step
        self.scheme, self.averaged = marching.scheme()
        # of others the old acceleration has no part in the step, or only with the forces of then
        self.softly = scene.analysis.damping[1] > 0.0 and (
            self.scheme.alpha_m != self.scheme.alpha_f
        )

    def run(self, trial: bool) -> dict[str, Any]:
        """March to the end, or for one step; return the fields of `Solution`.

        Raises
        ------
        InputError
            If a piece that is to be in equilibrium is not held, or part of one so weakly that
            round-off is all there is.
        RuntimeError
            If a step or the initial equilibrium is not found.
        """
        record, marching = self.record, self.marching
        with naming_weak_places(self.scene, self.space, self.body.ties):
            with record.timed("initial state"):
                self.state = self._initial()
            self.ledger.open(self.body, self.state)
            sizes = march(self.timeline, self, marching.halvings, trial)
        for stepper in self.steppers.values():
            stepper.close()
        newton = sum(stepper.solves for stepper in self.steppers.values())
        record.iterations |= {"steps": sizes.total(), "newton": newton}
        element = self._along_blades()
        steps = notes_of_steps(self.scene, sizes, marching.name, CONSISTENT, element)
        record.notes |= {**steps, "unknowns": self.unknowns}
        if self.halved:
            record.notes["steps in halves"] = f"{self.halved}, which were not solved as a whole"
        if self.waves is not None:
            record.notes["openings"] = str(self.openings)
        linear = self.scene.analysis.kinematics == "linear"
        return {
            "times": self.timeline.outputs[: len(self.outputs)],
            "displacement": self._over_time("displacement"),
            "velocity": self._over_time("velocity"),
            "acceleration": self._over_time("acceleration") if linear else None,
            "mass": CONSISTENT,
            "ledger": self.rows.columns(),
            "quantities": self.waves.found() if self.waves is not None else {},
            "unknowns": self.space.node_points.size,
            "contact": self._contact(),
        }

    def _along_blades(self) -> float:
        """Find the largest element on the way of the blades, m: meshes are graded to their ends."""
        corners = self.space.mesh.realised_cut
        cuts = self.scene.final_cuts
        blades = [isinstance(cut, ToolPathCut) for cut in self.scene.cuts]
        if not any(blades) or not len(corners):
            return self.marching.element
        mine = np.array(blades)[nearest_cut(corners, [cut.pieces() for cut in cuts])]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)[mine]
        return float(min(self.marching.element, edges.max(initial=0.0) or np.inf))

    def _contact(self) -> ContactPressure | None:
        if (faces := self.body.contact) is None:
            return None
        return ContactPressure(faces.points, faces.weights, np.array(self.pressures))

    @property
    def time(self) -> float:
        """Time of the state, s."""
        return self.state.time

    @property
    def largest(self) -> float:
        """Largest time step, s."""
        return self.marching.largest

    def open(self, time: float) -> bool:
        """Untie what the cuts have passed at a time."""
        self.state.time = time  # without the round-off of the sum of steps
        return self._untie(self.opening.times, time)

    def begin(self) -> None:
        """Take up what jumps: velocities of supports, and accelerations."""
        body, state = self.body, self.state
        with self.record.timed("loading"):
            taken = np.zeros_like(state.velocity)
            taken[body.held] = body.prescribed(state.time)[1] - state.velocity[body.held]
            if taken.any():  # without an impulse on free nodes
                taken += body.accelerations(-(body.mass @ taken))
                state.velocity = state.velocity + taken
            self.ledger.started(body, state)
            unbalanced = self._unbalanced(self._later)
            state.acceleration = body.accelerations(unbalanced, state.time)
        self.begun = True

    def put_out(self) -> None:
        """Keep the state, with the acceleration that balances its forces.

        Where a scheme takes accelerations and forces at the same share of a step, it has it
        already: balance at the start of a step gives balance at its end. But beside supports that
        move accelerations by the average rule change their sign from step to step.
        """
        found = self.state.copy()
        linear = self.scene.analysis.kinematics == "linear"
        if fault := self.body.inside_out(found.displacement):
            raise RuntimeError(f"at {found.time:.6g} s {fault}")
        other = self.body.moves or self.scheme.alpha_m != self.scheme.alpha_f
        if linear and other and not self.begun:
            unbalanced = self._unbalanced(found.time)
            found.acceleration = self.body.accelerations(unbalanced, found.time)
        self.outputs.append(found)
        self.pressures.append(self._pressure)
        ledger, momenta = self.ledger, momenta_of(self.body, self.state)
        done = ledger.done | work_of_blades(self.scene.cuts, ledger.work_by_cut)
        energies = ledger.state(self.body, self.state)
        self.rows.enter(energies, done, *momenta, ledger.turned + 0.0 * momenta[1])

    def step(self, size: float, halvings: int = _HALVINGS) -> None:
        """Advance the state by a time, s, and account for it.

        A step that is not solved is taken in halves, and these again: a node that a blade has let
        go beside its end moves fast in small elements.
        """
        if size not in self.steppers:
            self.steppers[size] = Stepper(self.body, self.scheme, self.averaged, size)
        if self.begun and self.softly:
            with self.record.timed("loading"):
                self.steppers[size].restart(self.state, self._unbalanced(self._later))
        self.begun = False
        with self.record.timed("steps"):
            before, whole = self.state.copy(), True
            try:
                forces = self.steppers[size].step(self.state)
            except RuntimeError:
                if not halvings:
                    raise
                whole = False
        if not whole:
            self.halved += halvings == _HALVINGS
            for _ in range(2):
                self.step(0.5 * size, halvings - 1)
            return
        with self.record.timed("accounting"):
            self.ledger.record(self.body, before, self.state, forces)
            if self.waves is not None:
                self.waves.enter(self.state)

    def _plan(self) -> None:
        """Choose between one factorisation with all that is ever tied, and one per opening.

        The first takes as many solves as there are ties, once. Where nothing is factorised at
        first neither is planned.
        """
        if self.scene.analysis.kinematics != "linear" or self.body.iterates:
            return
        if self.body.contact is not None:  # whose compliance changes with the ties
            return
        lasting = lasting_ties(self.facing, self.opening.times)
        ties = lasting.size // 2 * self.space.dimension
        step = self.marching.largest / 2**self.marching.halvings
        openings = len(np.unique(np.ceil(self.opening.times / step)))
        if 0 < ties <= min(_MOST_TIES, _SOLVES * openings):
            self.body.plan(lasting)

    def _untie(self, times: Array, time: float) -> bool:
        """Untie the pairs of nodes whose times have come; hold those that are let go."""
        due = self.closed & (times <= time + self.timeline.close)
        if not due.any():
            return False
        before = self._apart()
        with self.record.timed("loading"):
            if self.opening.shares is None or times is self.opening.passed:
                self._tie(self.closed & ~due)
            else:
                self._release(due, time)
        freed = self._apart() & ~before  # they pressed nobody before
        self.body.pressures = [np.where(freed, np.nan, one) for one in self.body.pressures]
        self.openings += 1
        return True

    def _apart(self) -> NDArray[np.bool_]:
        """Whether the faces at each place of contact pressure (m,) are not tied."""
        if (faces := self.body.contact) is None:
            return np.zeros(0, dtype=bool)
        one, other = self.body.ties.leader[faces.pairs].T
        return np.asarray(one != other)

    def _release(self, due: NDArray[np.bool_], time: float) -> None:
        """Untie the nodes that are due, and hold them by their tie forces of before."""
        body, shares = self.body, self.opening.shares
        assert shares is not None
        before = body.ties.leader
        acceleration = body.accelerations(self._unbalanced(self._later), time)
        self._tie(self.closed & ~due)
        nodes, cut = self.opening.parted(before, body.ties.leader, self.facing, due)
        forces = body.mass @ acceleration - self._unbalanced(self._later)
        forces[body.held] = 0.0
        fading = shares.fading(self.opening.place[nodes], time, self.timeline.close)
        forces = forces.reshape(-1, self.space.dimension)[nodes]
        body.tie_forces.add(Release(nodes, forces, fading.at, cut), time)

    def _tie(self, closed: NDArray[np.bool_]) -> None:
        self.closed = closed
        self.body.tie(self.facing[closed])
        for stepper in self.steppers.values() if not self.body.planned else ():
            stepper.close()

    def _initial(self) -> State:
        """State at the time 0, before what opens then."""
        initial, body, d = self.scene.initial, self.body, self.space.dimension
        balanced = isinstance(initial, Equilibrium)
        if not (starts_open(initial) and self._untie(self.opening.passed, 0.0)):
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
        """Find the equilibrium of the body with the closed part of its cuts, which must hold it."""
        before = self.space
        if self.closed.any():
            mesh = partly_opened(self.space.mesh, ~self.closed.any(axis=1))
            before = conforming_space(mesh, self.space.degree, self.comm)
        constrained_values(self.scene, before, self.exact)  # says which piece is not held
        if self.scene.analysis.kinematics == "linear" or before is self.space:
            return self.body.equilibrium()
        found = MovingBody(self.scene, before, self.exact).equilibrium()
        return inherit(before, self.space, found.reshape(-1, self.space.dimension)).ravel()

    @property
    def _later(self) -> float:
        """Time just after the state's, when what jumps then has jumped."""
        return self.state.time + _JUST * float(self.timeline.outputs[-1])

    def _unbalanced(self, time: float) -> Array:
        """Sum the forces of the state at a time that inertia has to balance, N."""
        body, state = self.body, self.state
        law, (mass, stiffness) = body.law, self.scene.analysis.damping
        forces = body.external(time) - law.force(state.displacement)
        forces -= mass * (body.mass @ state.velocity)
        if body.contact is not None:
            slopes = body.contact.slopes(state.displacement, state.displacement)
            forces += slopes.T @ self._pressure
        if stiffness:
            forces -= stiffness * law.viscous(state.displacement, state.velocity)
        return forces

    @property
    def _pressure(self) -> Array:
        """Pressure of contact (m,) at the time of the state, Pa."""
        lag = 0.5 if self.averaged else self.scheme.alpha_f
        return pressure_at_end(self.body.pressures, lag)

    def _over_time(self, name: str) -> Array:
        """Return a field (t, n, d) at the outputs."""
        shape = (len(self.outputs), -1, self.space.dimension)
        return np.reshape([getattr(state, name) for state in self.outputs], shape)

"""Motion of a body on virtual nodes, made anew whenever its cuts open further, and its account."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Equilibrium, Scene, ToolPathCut
from verify.scene.tables import starts_open
from verify.solution import Regularisation
from verify.solution_checks import CONSISTENT
from verify.solvers.body_of_scene import Openings
from verify.solvers.runs import (
    LedgerRows,
    Record,
    march,
    notes_of_steps,
    pressure_at_end,
    timeline_of,
    work_of_blades,
)
from verify.solvers.xfem_system import (
    SCHEMES,
    body_in_motion,
    contact_of,
    faces_of,
    initial_state,
    largest_step,
)
from verify.xfem.aggregation import AggregatedMass
from verify.xfem.arrays import XfemError
from verify.xfem.body import DynamicBody, Integrator, MotionState
from verify.xfem.energy_balance import BalanceRecorder, EnergyBalance
from verify.xfem.explicit import acceleration_of
from verify.xfem.implicit import NewtonIntegrator
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import Mass
from verify.xfem.phantom import PhantomMesh
from verify.xfem.release import (
    TieForces,
    acceleration_at_corners,
    ancestors,
    parting_cuts,
    tie_forces,
)

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_NO_ROUND_OFF = 1e-6  # of a force
_STAGE = {
    "load_work": "work_of_loads",
    "support_work": "work_of_supports",
    "damping": "damping",
    "algorithmic": "algorithmic",
    "unbalanced": "unbalanced",
    "cut_work": "cut_work",
}


class StagedLedger(LedgerRows):
    """Ledger over the stages between openings; work goes on from stage to stage.

    Parameters
    ----------
    removal : bool
        Whether openings take material away: its energy and mass have entries of their own.
    """

    def __init__(self, removal: bool = False) -> None:
        super().__init__()
        self._done = dict.fromkeys(_STAGE.values(), 0.0)
        self._turned: float | _Floats = 0.0  # angular impulse of tie forces, N m s
        self._projection = 0.0
        self._removed = dict.fromkeys(("removed_energy", "removed_mass") if removal else (), 0.0)
        self._penalty: list[float] = []

    def leave(self, ledger: EnergyBalance, instants: list[tuple[int, dict[str, float]]]) -> None:
        """Enter the rows of a stage that are asked for, and keep what it has done in all.

        Parameters
        ----------
        ledger : EnergyBalance
            Of the stage.
        instants : list of (int, dict)
            Rows that are asked for, and what blades have taken until then, as `work_of_blades`.
        """

        def done(k: int) -> dict[str, float]:
            found = {
                name: self._done[name] + float(getattr(ledger, column)[k])
                for column, name in _STAGE.items()
            }
            return {**found, "projection": self._projection}

        for k, taken in instants:
            state = {n: float(getattr(ledger, n)[k]) for n in ("kinetic", "strain", "gravity")}
            momenta = ledger.momentum[k], ledger.angular_momentum[k]
            turned = self._turned + ledger.cut_turn[k]
            self.enter(state, done(k) | taken | self._removed, *momenta, turned)
            self._penalty.append(float(ledger.penalty[k]))
        self._done, self._turned = done(-1), self._turned + ledger.cut_turn[-1]

    def open(
        self, body: DynamicBody, state: MotionState, further: DynamicBody, inherited: MotionState
    ) -> None:
        """Enter the energy that is lost where a body that is cut further takes over a state.

        Nothing without a sliver policy and with masses of one part each. Energy that a policy loses
        by its projection has an entry of its own, with the gain or loss of EVS and GEVS. Removed
        material takes its energy and its mass with it.
        """
        before, after = (
            float(BalanceRecorder(*of).close().mechanical[0])
            for of in ((body, state), (further, inherited))
        )
        if self._removed:
            self._removed["removed_energy"] += before - after
            self._removed["removed_mass"] += float(
                body.mass.weights.sum() - further.mass.weights.sum()
            )
        else:
            self._projection += before - after

    def columns(self) -> dict[str, _Floats]:
        """Return all entries (t,) by name; with share of a ghost penalty in the strain energy."""
        penalty = {"penalty": np.array(self._penalty)} if any(self._penalty) else {}
        return super().columns() | penalty


# dof nodes and the time at which they are let go, to factors over time
Fade = Callable[[_Ints, float], Callable[[float], _Floats]]


class OpeningBody(Protocol):
    """A body that the cuts of a scene open on the way: what every way to cut offers the motion.

    Attributes
    ----------
    openings : Openings
        When the cuts open.
    removal : bool
        Whether openings take material away.
    rule : str
        What a tool path opens, and when, for the report.
    mass : str
        Name of its mass, for the report.
    phase : str
        What the time of `events` and `at` is listed as.
    """

    openings: Openings
    removal: bool = False
    rule: str
    mass: str
    phase: str

    def events(self) -> _Floats:
        """Return the times at which something opens, s; asked for once, before all else."""

    def at(self, time: float, passed: bool = False) -> PhantomMesh:
        """Cut the body by the cuts that are open at a time, in s, or that blades have passed."""

    def inertia(self, phantom: PhantomMesh) -> tuple[InternalForce, Mass]:
        """Return elasticity and mass of a body that `at` has returned."""

    def inherited(self, old: PhantomMesh, state: MotionState, further: DynamicBody) -> MotionState:
        """Hand a state on to the body that is cut further."""

    def source(self, old: PhantomMesh, new: PhantomMesh) -> _Ints:
        """Find corner of an old body from which each corner of one that is cut further comes."""
        return ancestors(old, new)

    def fading(self, new: PhantomMesh) -> Fade | None:
        """Factors of the forces that hold released nodes of a body; None: all is let go at once."""

    def parting(self, new: PhantomMesh, nodes: _Ints, parent: _Ints) -> _Ints:
        """Cut that has parted each of some dof nodes, by the dof node that they were."""
        return parting_cuts(new, nodes, parent)

    def regularisations(self) -> list[Regularisation]:
        """Return what was changed in the body that was made last: nothing, or the body says it."""
        return []


@dataclass(frozen=True)
class Integration:
    """How a motion is integrated: the parameters of a solver that concern it."""

    scheme: str
    step_factor: float
    spectral_radius: float = 0.8
    step: float | None = None

    def __post_init__(self) -> None:
        given = self.step
        if given is not None and not (isinstance(given, int | float) and 0.0 < given < np.inf):
            raise InputError(f"step {given}; expected a positive number of seconds")
        if not 0.0 <= self.spectral_radius <= 1.0:
            raise InputError(f"spectral_radius {self.spectral_radius:g}; expected 0 to 1")


class _Output(NamedTuple):
    """A state at an output time, on the mesh with the cuts that are open then."""

    phantom: PhantomMesh
    state: MotionState
    acceleration: _Floats | None
    ends: list[_Floats]  # displacements at the ends of the last three steps, where faces may touch


@dataclass(eq=False)
class CutMotion:
    """A body on virtual nodes in motion, made anew when something opens: a `timeline.Mover`.

    Every output is on the mesh of the body with all its cuts: before a cut opens, what will be
    its two sides moves together.

    Parameters
    ----------
    scene : Scene
    opening : OpeningBody
    integration : Integration
    exact : object or None
        The exact solution that supports and loads may be taken from.
    record : Record
        Gets timings, iterations, notes and regularisations.
    """

    scene: Scene
    opening: OpeningBody
    integration: Integration
    exact: Any
    record: Record

    def __post_init__(self) -> None:
        scene, opening, record = self.scene, self.opening, self.record
        self.timeline = timeline_of(scene, kinks=True)
        phases = (opening.phase, "loading", "initial state", "steps", "accounting")
        record.timings |= dict.fromkeys(phases, 0.0)
        with record.timed(opening.phase):
            self._events = opening.events()
        closed_before = isinstance(scene.initial, Equilibrium) and not starts_open(scene.initial)
        self._ledger = StagedLedger(opening.removal)
        self._outputs: list[_Output] = []
        self._by_cut = np.zeros(len(opening.openings.asked))  # energy that each has taken, J
        self._spread = 0.0  # as of `Release`, the most
        self._solves = 0
        start = -np.inf if closed_before else self.timeline.close
        body = self._made(start, passed=True)
        at_once = opening.fading(body.force.phantom) is None
        self._entered = start if at_once else -np.inf  # events until then are taken up
        with record.timed("initial state"):
            state = initial_state(scene, body, self.exact)
        self._take(body, state)
        self._ends = [] if body.contact is None else 3 * [state.displacement.copy()]

    def run(self, trial: bool) -> tuple[PhantomMesh, dict[str, Any]]:
        """March, and carry the fields of all outputs to the finally cut mesh.

        Parameters
        ----------
        trial : bool
            As of `timeline.march`.

        Returns
        -------
        phantom : PhantomMesh
            With all cuts open; nothing follows a root cell.
        fields : dict
            Of `Solution`, of its unknowns.

        Raises
        ------
        InputError
            If the state of a body cannot be handed on to that which is cut further.
        XfemError, StepFailedError, NotInEquilibriumError
            From the library.
        """
        sizes = march(self.timeline, self, trial=trial)
        self._leave()
        self._say(sizes)
        with self.record.timed(self.opening.phase):
            phantom = self.opening.at(np.inf)
        self.record.regularisations += self.opening.regularisations()
        return phantom.corners, self._fields(phantom)

    @property
    def time(self) -> float:
        """Time of the state, s."""
        return self.state.time

    def open(self, time: float) -> bool:
        """Cut the body by the cuts as they are at a time, and carry the state over."""
        before, self._entered = self._entered, time + self.timeline.close
        if not np.any((self._events > before) & (self._events <= self._entered)):
            return False
        old, further = self.body.force.phantom, self._made(self._entered)
        state = self.opening.inherited(old, self.state, further)
        new = further.force.phantom
        if (fade := self.opening.fading(new.corners)) is not None:
            tie = tie_forces(
                self._at_corners(self.body),
                self._state_at_corners(),
                acceleration_at_corners(self.body, self.state),
                self._at_corners(further),
                self.opening.source(old, new),
                fade,
                self.opening.parting,
            )
            if tie is not None:
                further.tie = TieForces(new, tie.releases)
                self._spread = max(self._spread, *(one.spread for one in tie.releases))
        self._leave()
        self._ledger.open(self.body, self.state, further, state)
        source = self.opening.source(old, new)
        self._ends = [old.extend(one)[source] for one in self._ends]
        self._take(further, state)
        return True

    def begin(self) -> None:
        """Take up velocities of supports; integrators see other jumps by themselves."""
        velocity = self.body.taken_up(self.state)
        if velocity is not self.state.velocity:
            shown = bool(self._instants) and self._instants[-1][0] == self._taken
            self._recorder.take_up(velocity, again=not shown)
            self.state.velocity[:] = velocity
            self._integrators.clear()

    def put_out(self) -> None:
        """Keep the state, with its acceleration where that is to be had."""
        body = self.body
        linear = self.scene.analysis.kinematics == "linear"
        acceleration = acceleration_of(body, self.state) if linear else None
        output = _Output(body.force.phantom, self.state.copy(), acceleration, self._ends)
        self._outputs.append(output)
        taken = work_of_blades(self.opening.openings.asked, self._by_cut)
        self._instants.append((self._taken, taken))

    def step(self, size: float) -> None:
        """Advance the state by a time, s, and account for it."""
        if size not in self._integrators:
            self._integrators[size] = self._integrator(size)
        if isinstance(self.body.tie, TieForces):
            self.body.tie = self.body.tie.still(self.state.time)
        tie = self.body.tie if len(self._by_cut) > 1 else None  # one has all of `cut_work`
        before = self.state.displacement.copy() if tie is not None else self.state.displacement
        with self.record.timed("steps"):
            forces = self._integrators[size].step(self.state)
            if self.body.contact is not None:
                self._ends = [self.state.displacement.copy(), *self._ends[:2]]
        with self.record.timed("accounting"):
            self._recorder.record(self.state, forces)
            if isinstance(tie, TieForces):
                change, start = self.state.displacement - before, self.state.time - size
                for share, weight in forces.loaded_at:
                    self._by_cut += weight * tie.work_by_cut(
                        change, start + share * size, len(self._by_cut)
                    )
        self._taken += 1

    def _made(self, time: float, passed: bool = False) -> DynamicBody:
        with self.record.timed(self.opening.phase):
            phantom = self.opening.at(time, passed)
        with self.record.timed("loading"):
            return body_in_motion(self.scene, *self.opening.inertia(phantom), self.exact)

    def _at_corners(self, body: DynamicBody) -> DynamicBody:
        """Return a body with unknowns at all corners; itself where no cells are aggregated."""
        phantom = body.force.phantom
        if phantom.aggregation is None:
            return body
        made = body_in_motion(self.scene, *self.opening.inertia(phantom.corners), self.exact)
        if isinstance(body.tie, TieForces):
            made.tie = TieForces(phantom.corners, body.tie.releases)
        return made

    def _state_at_corners(self) -> MotionState:
        phantom, state = self.body.force.phantom, self.state
        fields = phantom.extend(state.displacement), phantom.extend(state.velocity)
        return MotionState(*fields, state.time)

    def _take(self, body: DynamicBody, state: MotionState) -> None:
        """Go on with a body and its state."""
        self.body, self.state = body, state
        self._recorder, self._integrators = BalanceRecorder(body, state), dict[float, Integrator]()
        self._instants, self._taken = list[tuple[int, dict[str, float]]](), 0
        own = self.integration
        self.largest, how = largest_step(  # as it is cut now
            self.scene, body, own.scheme, own.step_factor, own.step
        )
        self.record.notes["step from"] = how

    def _leave(self) -> None:
        """Enter what has happened to the body."""
        self._ledger.leave(self._recorder.close(), self._instants)
        newton = [o for o in self._integrators.values() if isinstance(o, NewtonIntegrator)]
        self._solves += sum(one.solves for one in newton)

    def _integrator(self, size: float) -> Integrator:
        scheme, radius = self.integration.scheme, self.integration.spectral_radius
        more = {"spectral_radius": radius} if scheme == "generalised_alpha" else {}
        try:
            return SCHEMES[scheme](self.body, size, **more)
        except XfemError as error:  # explicit, with a mass that is not diagonal
            raise UnsupportedSceneError(f"scheme = '{scheme}': {error}") from None

    def _fields(self, phantom: PhantomMesh) -> dict[str, Any]:
        """Carry all outputs to the unknowns of the body with all its cuts."""
        outputs = self._outputs
        olds = {id(one.phantom): one.phantom for one in outputs}
        sources = {key: self.opening.source(old, phantom) for key, old in olds.items()}

        def carried(name: str) -> _Floats | None:
            # before a cut opens nothing follows a root cell there: corners say it all
            values = [
                getattr(one if name == "acceleration" else one.state, name) for one in outputs
            ]
            if any(value is None for value in values):
                return None
            pairs = zip(outputs, values, strict=True)
            return np.array([o.phantom.extend(value)[sources[id(o.phantom)]] for o, value in pairs])

        displacement = carried("displacement")
        assert displacement is not None  # every state has one
        faces, contact = faces_of(self.scene, phantom.corners, moving=True), None
        if faces is not None:
            lag = 0.0 if self.integration.scheme == "implicit_euler" else 0.5
            ends = ([o.phantom.extend(u)[sources[id(o.phantom)]] for u in o.ends] for o in outputs)
            contact = contact_of(
                faces,
                (pressure_at_end([faces.freed_pressure(u) for u in three], lag) for three in ends),
            )
        return {
            "times": self.timeline.outputs[: len(outputs)],
            "contact": contact,
            "displacement": displacement,
            "velocity": carried("velocity"),
            "acceleration": carried("acceleration"),
            "mass": self._mass(phantom),
            "ledger": self._ledger.columns(),
            "unknowns": phantom.node_points.size,
        }

    def _mass(self, phantom: PhantomMesh) -> str | csr_array:
        """Make the mass of the corners of the body with all its cuts."""
        if self.opening.mass == CONSISTENT:
            return CONSISTENT
        _, mass = self.opening.inertia(phantom)
        return mass.of_corners.matrix if isinstance(mass, AggregatedMass) else mass.matrix

    def _say(self, sizes: Counter[float]) -> None:
        """Record steps and choices."""
        record = self.record
        record.iterations["steps"] = sizes.total()
        if self._solves:
            record.iterations["newton"] = self._solves
        scheme, size = self.integration.scheme, self.opening.openings.size
        record.notes |= notes_of_steps(self.scene, sizes, scheme, self.opening.mass, size)
        if any(isinstance(cut, ToolPathCut) for cut in self.scene.cuts):
            record.notes["a tool path opens"] = self.opening.rule
        if self._spread > _NO_ROUND_OFF:
            record.notes["jump of accelerations"] = (
                f"loads or masses are shared out anew at openings: up to {self._spread:.1%} of the "
                "largest force that holds what is released"
            )

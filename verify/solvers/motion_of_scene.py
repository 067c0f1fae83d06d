"""Motion of a cut body: stages between the openings of cuts, steps between the output times."""

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from verify.declared_mass import CONSISTENT
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Equilibrium, Scene, ToolPathCut
from verify.scene.initial import starts_open
from verify.solution import Regularisation
from verify.solvers.body_in_motion import body_in_motion, initial_state
from verify.solvers.body_of_scene import density_of, material_of
from verify.solvers.openings_of_scene import Openings, stops_of
from verify.solvers.runs import Record
from verify.solvers.xfem_account import Account
from verify.solvers.xfem_steps import integrator_of, largest_step
from verify.xfem.aggregation import AggregatedMass
from verify.xfem.body import DynamicBody, Integrator, MotionState
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.errors import XfemError
from verify.xfem.explicit import acceleration_of
from verify.xfem.implicit import NewtonIntegrator
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import Mass
from verify.xfem.phantom import PhantomMesh

_Floats = NDArray[np.float64]


class OpeningBody(Protocol):
    """A body that the cuts of a scene open on the way: what every way to cut offers the motion.

    Attributes
    ----------
    removal : bool
        Whether openings take material away.
    rule : str
        What a tool path opens, and when, for the report.
    mass : str
        Name of its mass, for the report.
    phase : str
        What the time of `events` and `at` is listed as.
    """

    removal: bool
    rule: str
    mass: str
    phase: str

    def events(self) -> _Floats:
        """Return the times at which something opens, s; asked for once, before all else."""

    def at(self, time: float) -> PhantomMesh:
        """Cut the body as far as the cuts have come at a time, in s."""

    def inertia(self, phantom: PhantomMesh) -> tuple[InternalForce, Mass]:
        """Return elasticity and mass of a body that `at` has returned."""

    def inherited(self, old: PhantomMesh, state: MotionState, further: DynamicBody) -> MotionState:
        """Hand a state on to the body that is cut further."""

    def source(self, old: PhantomMesh, new: PhantomMesh) -> NDArray[np.int64]:
        """Corner of an old body from which each corner of one that is cut further comes."""

    def regularisations(self) -> list[Regularisation]:
        """Return what was changed in the body that was made last."""


@dataclass(frozen=True)
class Marching:
    """How a motion is integrated: the parameters of a solver that concern it."""

    scheme: str
    step_factor: float
    spectral_radius: float = 0.8

    def __post_init__(self) -> None:
        if not 0.0 <= self.spectral_radius <= 1.0:
            raise InputError(f"spectral_radius {self.spectral_radius:g}; expected 0 to 1")


class _Output(NamedTuple):
    """A state at an output time, on the mesh with the cuts that are open then."""

    phantom: PhantomMesh
    state: MotionState
    acceleration: _Floats | None


class Motion:
    """One motion, stage by stage: a stage begins at a step at which something opens.

    Every output is on the mesh of the body with all its cuts: before a cut opens, what will be
    its two sides moves together.

    Parameters
    ----------
    scene : Scene
    openings : Openings
        When its cuts open.
    opening : OpeningBody
    marching : Marching
    exact : object or None
        The exact solution that supports and loads may be taken from.
    record : Record
        Gets timings, iterations, notes and regularisations.
    """

    def __init__(
        self,
        scene: Scene,
        openings: Openings,
        opening: OpeningBody,
        marching: Marching,
        exact: Any,
        record: Record,
    ) -> None:
        self.scene, self.opening, self.marching, self.exact = scene, opening, marching, exact
        self.record = record
        phases = (opening.phase, "loading", "initial state", "steps", "accounting")
        record.timings |= dict.fromkeys(phases, 0.0)
        self.times, self.due = openings.outputs, openings.due
        self.stops = stops_of(scene, openings)
        self.account = Account(opening.removal)
        self.steps = self.solves = 0
        self.step_sizes: set[float] = set()
        self.said = ""

    def run(self, trial: bool) -> tuple[PhantomMesh, dict[str, Any]]:
        """Run all stages and carry the fields of each to the finally cut mesh.

        Parameters
        ----------
        trial : bool
            Whether to stop after the first step: what compiles, compiles in it.

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
        with self.record.timed(self.opening.phase):
            events = self.opening.events()
        initial = self.scene.initial
        closed_before = isinstance(initial, Equilibrium) and not starts_open(initial)
        opened = -np.inf if closed_before else self.due
        phantom = self._cut(opened)
        body = self._body(phantom)
        with self.record.timed("initial state"):
            state = initial_state(self.scene, body, self.exact)
        fields: list[_Output] = []
        while True:
            due = state.time + self.due
            if np.any((events > opened) & (events <= due)):
                further = self._body(self._cut(due))
                inherited = self.opening.inherited(phantom, state, further)
                self.account.open(body, state, further, inherited)
                body, state = further, inherited
                phantom = body.force.phantom
            opened = due
            until = float(events[events > due].min(initial=np.inf))
            fields += self._stage(body, state, until, trial)
            if trial or state.time >= float(self.times[-1]) - self.due:
                return self._answer(fields)

    def _cut(self, time: float) -> PhantomMesh:
        with self.record.timed(self.opening.phase):
            return self.opening.at(time)

    def _body(self, phantom: PhantomMesh) -> DynamicBody:
        with self.record.timed("loading"):
            return body_in_motion(self.scene, *self.opening.inertia(phantom), self.exact)

    def _stage(
        self, body: DynamicBody, state: MotionState, until: float, trial: bool
    ) -> list[_Output]:
        """Step to the end, or to the first step that begins at `until` or later.

        Returns the states at the output times on the way.
        """
        ledger, largest = BalanceRecorder(body, state), self._largest_step(body)
        timings = self.record.timings
        integrators: dict[float, Integrator] = {}
        outputs, instants, taken = [], [], 0
        for a, b in pairwise([state.time, *self.stops[self.stops > state.time + self.due]]):
            if np.abs(self.times - a).min() <= self.due:
                outputs.append(self._kept(body, state))
                instants.append(taken)
            count = max(1, int(np.ceil((b - a) / largest * (1 - 1e-9))))
            size = float(f"{(b - a) / count:.14g}")  # the same up to round-off: one integrator
            if size not in integrators:
                integrators[size] = self._integrator(body, size)
            for _ in range(count):
                clock = perf_counter()
                forces = integrators[size].step(state)
                stepped = perf_counter()
                ledger.record(state, forces)
                timings["steps"] += stepped - clock
                timings["accounting"] += perf_counter() - stepped
                taken += 1
                if over := trial or state.time >= until - self.due:
                    break
            if over:
                break
        if state.time >= self.times[-1] - self.due:
            outputs.append(self._kept(body, state))
            instants.append(taken)
        self.account.enter(ledger.close(), instants)
        self.steps += taken
        self.step_sizes |= integrators.keys()
        newton = [one for one in integrators.values() if isinstance(one, NewtonIntegrator)]
        self.solves += sum(one.solves for one in newton)
        return outputs

    def _largest_step(self, body: DynamicBody) -> float:
        mesh, marching = body.force.phantom.mesh, self.marching
        largest, self.said = largest_step(
            body,
            material_of(self.scene, mesh),
            density_of(self.scene, mesh),
            marching.scheme,
            marching.step_factor,
            self.scene.analysis.time_step,
        )
        return largest

    def _kept(self, body: DynamicBody, state: MotionState) -> _Output:
        """Copy a state, with its acceleration where that is to be had."""
        alone = body.mass.diagonal is not None or not body.moving
        linear = self.scene.analysis.kinematics == "linear"
        acceleration = acceleration_of(body, state) if linear and alone else None
        return _Output(body.force.phantom, state.copy(), acceleration)

    def _integrator(self, body: DynamicBody, size: float) -> Integrator:
        scheme = self.marching.scheme
        try:
            return integrator_of(body, size, scheme, self.marching.spectral_radius)
        except XfemError as error:  # explicit, with a mass that is not diagonal
            raise UnsupportedSceneError(f"scheme = '{scheme}': {error}") from None

    def _answer(self, fields: list[_Output]) -> tuple[PhantomMesh, dict[str, Any]]:
        phantom, record = self._cut(np.inf), self.record
        olds = {id(one.phantom): one.phantom for one in fields}
        sources = {key: self.opening.source(old, phantom) for key, old in olds.items()}

        def carried(one: _Output, values: _Floats) -> _Floats:
            # before a cut opens nothing follows a root cell there: corners say it all
            found: _Floats = one.phantom.extend(values)[sources[id(one.phantom)]]
            return found

        accelerations = [
            carried(one, one.acceleration) for one in fields if one.acceleration is not None
        ]
        record.iterations["steps"] = self.steps
        if self.solves:
            record.iterations["newton"] = self.solves
        record.notes |= self._notes()
        record.regularisations += self.opening.regularisations()
        return phantom.corners, {
            "times": self.times[: len(fields)],
            "displacement": np.array([carried(one, one.state.displacement) for one in fields]),
            "velocity": np.array([carried(one, one.state.velocity) for one in fields]),
            "acceleration": np.array(accelerations) if len(accelerations) == len(fields) else None,
            "mass": self._mass(phantom),
            "ledger": self.account.columns(),
            "unknowns": phantom.node_points.size,
        }

    def _mass(self, phantom: PhantomMesh) -> str | csr_array:
        """Mass of the corners of the body with all its cuts."""
        if self.opening.mass == CONSISTENT:
            return CONSISTENT
        _, mass = self.opening.inertia(phantom)
        return mass.of_corners.matrix if isinstance(mass, AggregatedMass) else mass.matrix

    def _notes(self) -> dict[str, str]:
        sizes = sorted(self.step_sizes)
        notes = {
            "scheme": self.marching.scheme,
            "mass": self.opening.mass,
            "time step": " … ".join(dict.fromkeys(f"{s:.6g} s" for s in (sizes[0], sizes[-1])))
            if sizes
            else "none",
            "step from": self.said,
        }
        if any(isinstance(cut, ToolPathCut) for cut in self.scene.cuts):
            notes["a tool path opens"] = self.opening.rule
        return notes

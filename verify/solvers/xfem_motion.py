"""Motion of a cut body: stages between the openings of cuts, steps between the output times."""

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.accelerated import FAST
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Equilibrium, Gravity, InitialField, Moving, Scene, ToolPathCut
from verify.scene.history import factor_at, first_factor
from verify.scene.initial import starts_open
from verify.solvers.body_of_scene import density_of, material_of
from verify.solvers.cuts_of_scene import cuts_of
from verify.solvers.loads_of_scene import forces_of, is_moving, nodal_forces
from verify.solvers.supports_of_scene import initial_path, motion_of_supports
from verify.solvers.xfem_account import Account
from verify.solvers.xfem_answer import Answer, penalised
from verify.solvers.xfem_openings import opening_times, stops_of
from verify.solvers.xfem_steps import MASSES, integrator_of, largest_step
from verify.xfem.body import DynamicBody, Integrator, MotionState, RayleighDamping
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.errors import XfemError
from verify.xfem.explicit import acceleration_of
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.implicit import NewtonIntegrator
from verify.xfem.inherit import ancestors, inherit_state
from verify.xfem.internal_force import InternalForce
from verify.xfem.kernels import Kernels
from verify.xfem.mass import Mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.moving_body import treat_moving_body
from verify.xfem.phantom import PhantomMesh, cut_mesh
from verify.xfem.slivers import SliverReport, treat_slivers
from verify.xfem.supports import check_bodies

__all__ = ["MotionChoice", "Mover", "move"]

_Floats = NDArray[np.float64]
_SAME = 1e-12  # of the duration: times that close are one
_DUE = 1e-9  # of the duration: steps added up are off by less than that


@dataclass(frozen=True)
class MotionChoice:
    """How a motion is computed: the parameters of the solver that concern it."""

    scheme: str
    mass: str
    step_factor: float
    tip: str
    slivers: str
    spectral_radius: float = 0.8
    kernels: Kernels = FAST

    def __post_init__(self) -> None:
        if not 0.0 <= self.spectral_radius <= 1.0:
            raise InputError(f"spectral_radius {self.spectral_radius:g}; expected 0 to 1")


def move(
    scene: Scene, mesh: SimplexMesh, size: float, exact: Any, choice: MotionChoice, trial: bool
) -> Answer:
    """Integrate the motion of a dynamic scene.

    Every output is on the mesh of the body with all its cuts: before a cut opens, what will be
    its two sides moves together.

    Parameters
    ----------
    scene : Scene
    mesh : SimplexMesh
    size : float
        Its element size, m.
    exact : object or None
        The exact solution that supports and loads may be taken from.
    choice : MotionChoice
    trial : bool
        Whether to stop after the first step: what compiles, compiles in it.

    Raises
    ------
    InputError
        If the state of a body cannot be handed on to that which is cut further.
    XfemError, StepFailedError, NotInEquilibriumError
        From the library.
    """
    return Mover(scene, mesh, size, exact, choice).run(trial)


class _Output(NamedTuple):
    """A state at an output time, on the mesh with the cuts that are open then."""

    phantom: PhantomMesh
    state: MotionState
    acceleration: _Floats | None


class Mover:
    """One motion, stage by stage.

    A stage begins at a step at which a cut opens, in all or in some of its cells. Other ways to
    cut override `_events`, `_cut_at`, `_law`, `_inherited` and `_source`.
    """

    removal = False  # whether openings take material away
    rule = "elements as a whole, when the blade has crossed them through"

    def __init__(
        self, scene: Scene, mesh: SimplexMesh, size: float, exact: Any, choice: MotionChoice
    ) -> None:
        self.scene, self.mesh, self.exact, self.choice = scene, mesh, exact, choice
        phases = ("enrichment", "loading", "initial state", "steps", "accounting")
        self.timings = dict.fromkeys(phases, 0.0)
        self.times = np.array(scene.analysis.output_times)
        self.due = _DUE * float(self.times[-1])
        opens = [self._snapped(float(getattr(cut, "opens_at", 0.0))) for cut in scene.cuts]
        order = np.argsort(opens, kind="stable")
        cuts = cuts_of(scene, size)
        # those that open first come first: what is cut further keeps what is cut already
        self.asked = [scene.cuts[k] for k in order]
        self.cuts, self.opens = [cuts[k] for k in order], [opens[k] for k in order]
        whole = [
            t
            for cut, t in zip(self.asked, self.opens, strict=True)
            if not isinstance(cut, ToolPathCut)
        ]
        self.stops = stops_of(scene, self.times, whole, self.due)
        self.account = Account(self.removal)
        self.slivers: SliverReport | None = None
        self.penalty: GhostPenalty | None = None
        self.steps = self.solves = 0
        self.step_sizes: set[float] = set()
        self.said = ""

    def run(self, trial: bool) -> Answer:
        """Run all stages and carry the fields of each to the finally cut mesh."""
        clock = perf_counter()
        events = self._events()
        self.timings["enrichment"] += perf_counter() - clock
        initial = self.scene.initial
        closed_before = isinstance(initial, Equilibrium) and not starts_open(initial)
        opened = -np.inf if closed_before else self.due
        phantom = self._cut(opened)
        body = self._body(phantom)
        state = self._initial(body)
        fields: list[_Output] = []
        while True:
            due = state.time + self.due
            if np.any((events > opened) & (events <= due)):
                further = self._body(self._cut(due))
                inherited = self._inherited(phantom, state, further)
                self.account.open(body, state, further, inherited)
                body, state = further, inherited
                phantom = body.force.phantom
            opened = due
            until = float(events[events > due].min(initial=np.inf))
            stage = self._stage(body, state, until, trial)
            fields += [_Output(phantom, *output) for output in stage]
            if trial or state.time >= float(self.times[-1]) - self.due:
                return self._answer(fields)

    def _snapped(self, time: float) -> float:
        """Return the output time that is the same up to round-off, if there is one."""
        nearest = float(self.times[np.abs(self.times - time).argmin()])
        return nearest if abs(nearest - time) <= _SAME * self.times[-1] else time

    def _events(self) -> _Floats:
        """Find the times at which something opens, for `_cut` as well."""
        tip: Any = self.choice.tip
        self.opening = opening_times(self.asked, cut_mesh(self.mesh, self.cuts, tip), self.opens)
        return np.unique(self.opening[~np.isnan(self.opening)])

    def _cut(self, time: float) -> PhantomMesh:
        """Cut the mesh where the cuts have opened it at a time."""
        clock = perf_counter()
        policy: Any = self.choice.slivers
        phantom = self._cut_at(time)
        if policy in ("merge", "drop"):
            held = motion_of_supports(self.scene, phantom, self.exact).fixed.any(axis=1)
            phantom, self.slivers = treat_slivers(phantom, policy, held=held)
        self.timings["enrichment"] += perf_counter() - clock
        return phantom

    def _cut_at(self, time: float) -> PhantomMesh:
        tip: Any = self.choice.tip
        return cut_mesh(self.mesh, self.cuts, tip, self.opening <= time)

    def _body(self, phantom: PhantomMesh) -> DynamicBody:
        """Give a cut mesh its elasticity, mass, supports and loads."""
        clock = perf_counter()
        scene, density = self.scene, density_of(self.scene, phantom.mesh)
        force, mass = self._inertia(phantom, density)
        weight = np.zeros_like(phantom.node_points)
        driven: list[tuple[_Floats, Any]] = []
        moving: list[tuple[int, Any]] = []
        for i, (load, forces) in enumerate(nodal_forces(scene, phantom, self.exact)):
            if isinstance(load, Gravity):  # on the mass as it is lumped, so that all falls alike
                weight += mass.weight(load.acceleration)
            elif is_moving(load, self.exact):
                moving.append((i, load.history))
            else:
                driven.append((forces, load.history))

        def load_at(time: float) -> _Floats:
            total = np.zeros_like(weight)
            for forces, history in driven:
                total += factor_at(history, time) * forces
            for i, history in moving:
                forces = forces_of(scene, i, phantom, self.exact, time)
                total += factor_at(history, time) * forces
            return total

        body = DynamicBody(
            force,
            mass,
            weight,
            load_at if driven or moving else None,
            motion_of_supports(scene, phantom, self.exact),
            RayleighDamping(*scene.analysis.damping),
        )
        self.timings["loading"] += perf_counter() - clock
        return body

    def _inertia(
        self, phantom: PhantomMesh, density: float | _Floats
    ) -> tuple[InternalForce, Mass]:
        """Return elasticity and mass of a cut mesh, with the penalty if there is to be one."""
        if self.choice.slivers != "penalise":
            try:
                mass = MASSES[self.choice.mass](phantom, density)
            except XfemError as error:  # a lumping of the thesis, where cuts cross
                raise UnsupportedSceneError(f"mass = '{self.choice.mass}': {error}") from None
            return self._law(phantom), mass
        kinematics = self.scene.analysis.kinematics
        material = material_of(self.scene, phantom.mesh)
        treated = treat_moving_body(
            phantom, material, density, "penalise", kinematics=kinematics,
            kernels=self.choice.kernels,
        )  # fmt: skip
        self.penalty = treated.ghost
        return treated.force, treated.mass

    def _law(self, phantom: PhantomMesh) -> InternalForce:
        """Return the elasticity of a cut mesh."""
        material = material_of(self.scene, phantom.mesh)
        kinematics = self.scene.analysis.kinematics
        return InternalForce(phantom, material, kinematics, self.choice.kernels)

    def _initial(self, body: DynamicBody) -> MotionState:
        """Return the state at the time 0, before what opens then."""
        clock = perf_counter()
        state, initial = body.rest(), self.scene.initial
        if isinstance(initial, Moving):
            free = ~body.fixed
            state.velocity[free] = initial.velocities(body.force.phantom.node_points)[free]
        elif isinstance(initial, InitialField):
            phantom, free = body.force.phantom, ~body.fixed
            u, v = initial.state(phantom.node_points, phantom.node_piece_points, self.exact)
            state.displacement[free], state.velocity[free] = u[free], v[free]
        elif isinstance(initial, Equilibrium):
            state.displacement[:] = self._equilibrium(body)
        self.timings["initial state"] += perf_counter() - clock
        return state

    def _equilibrium(self, body: DynamicBody) -> _Floats:
        phantom = body.force.phantom
        assert body.weight is not None
        load = body.weight.copy()
        for entry, forces in nodal_forces(self.scene, phantom, self.exact):
            if not isinstance(entry, Gravity):
                load += first_factor(entry.history) * forces

        path = initial_path(self.scene, phantom, self.exact)
        check_bodies(phantom, path(1.0))
        return static_equilibrium(
            body.force, body.fixed, lambda share: path(share).values, load
        ).displacement

    def _inherited(
        self, phantom: PhantomMesh, state: MotionState, further: DynamicBody
    ) -> MotionState:
        try:
            return inherit_state(phantom, further.force.phantom, state, further)
        except XfemError as error:
            raise InputError(
                f"the state at {state.time:g} s cannot be handed on to the body that is cut "
                f"further ({error}); slivers = 'keep' may help"
            ) from None

    def _stage(
        self, body: DynamicBody, state: MotionState, until: float, trial: bool
    ) -> list[tuple[MotionState, _Floats | None]]:
        """Step to the end, or to the first step that begins at `until` or later.

        Returns the states at the output times on the way.
        """
        scene, choice = self.scene, self.choice
        largest, self.said = largest_step(
            body,
            material_of(scene, body.force.phantom.mesh),
            density_of(scene, body.force.phantom.mesh),
            choice.scheme,
            choice.step_factor,
            scene.analysis.time_step,
        )
        ledger = BalanceRecorder(body, state)
        integrators: dict[float, Integrator] = {}
        outputs, instants, taken = [], [], 0
        for a, b in pairwise([state.time, *self.stops[self.stops > state.time + self.due]]):
            if np.abs(self.times - a).min() <= self.due:
                outputs.append(self._kept(body, state))
                instants.append(taken)
            count = max(1, int(np.ceil((b - a) / largest * (1 - 1e-9))))
            size = float(f"{(b - a) / count:.14g}")  # the same up to round-off: one integrator
            self.step_sizes.add(size)
            if size not in integrators:
                integrators[size] = self._integrator(body, size)
            for _ in range(count):
                clock = perf_counter()
                forces = integrators[size].step(state)
                stepped = perf_counter()
                ledger.record(state, forces)
                self.timings["steps"] += stepped - clock
                self.timings["accounting"] += perf_counter() - stepped
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
        newton = [one for one in integrators.values() if isinstance(one, NewtonIntegrator)]
        self.solves += sum(one.solves for one in newton)
        return outputs

    def _kept(self, body: DynamicBody, state: MotionState) -> tuple[MotionState, _Floats | None]:
        """Copy a state, with its acceleration where that is to be had."""
        alone = body.mass.diagonal is not None or not body.moving
        linear = self.scene.analysis.kinematics == "linear"
        return state.copy(), acceleration_of(body, state) if linear and alone else None

    def _integrator(self, body: DynamicBody, size: float) -> Integrator:
        try:
            return integrator_of(body, size, self.choice.scheme, self.choice.spectral_radius)
        except XfemError as error:  # explicit, with a mass that is not diagonal
            raise UnsupportedSceneError(f"scheme = '{self.choice.scheme}': {error}") from None

    def _source(self, old: PhantomMesh, new: PhantomMesh) -> NDArray[np.int64]:
        """Corner of an old body from which each corner of one that is cut further comes."""
        return ancestors(old, new)

    def _answer(self, fields: list["_Output"]) -> Answer:
        phantom = self._cut(np.inf)
        olds = {id(one.phantom): one.phantom for one in fields}
        sources = {key: self._source(old, phantom) for key, old in olds.items()}
        # before a cut opens nothing follows a root cell there: corners say it all
        shape = (len(fields), *phantom.corners.node_points.shape)
        displacement, velocity, acceleration = np.empty(shape), np.empty(shape), np.empty(shape)
        balanced = True
        for k, one in enumerate(fields):
            source = sources[id(one.phantom)]
            displacement[k] = one.phantom.extend(one.state.displacement)[source]
            velocity[k] = one.phantom.extend(one.state.velocity)[source]
            if one.acceleration is None:
                balanced = False
            else:
                acceleration[k] = one.phantom.extend(one.acceleration)[source]
        sizes = sorted(self.step_sizes)
        notes = {
            "scheme": self.choice.scheme,
            "mass": self.choice.mass,
            "time step": " … ".join(dict.fromkeys(f"{s:.6g} s" for s in (sizes[0], sizes[-1])))
            if sizes
            else "none",
            "step from": self.said,
        }
        if any(isinstance(cut, ToolPathCut) for cut in self.asked):
            notes["a tool path opens"] = self.rule
        iterations = {"steps": self.steps}
        if self.solves:
            iterations["newton"] = self.solves
        return Answer(
            phantom.corners,
            self.times[: len(fields)],
            displacement,
            velocity,
            acceleration if balanced else None,
            self.account.columns(),
            self.timings,
            iterations,
            notes,
            self.slivers,
            phantom.node_points.size,
            penalised(self.penalty),
        )

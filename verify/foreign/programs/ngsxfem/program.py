"""CutFEM in NGSolve with ngsxfem: two sides of a level set, ghost penalty, linear elasticity.

The level set is that of `cut_body`; a cut that ends inside an element ends at its nearer facet.
With ``space = xfe`` the unknowns are nodal values and those of ngsxfem's XFESpace. A motion is
integrated by the trapezoidal rule, with the mass that the integrals of both sides give.
"""

from functools import cache

import ngsolve as ng
import numpy as np
from cut_body import divided, forces, held_at_rest, prescribed, uniform_weight
from exchange_files import RefusedError, run
from forms import EnrichedForms, Forms, bits, mesh_of
from motion import run_engine


class PartedCase:
    """A case whose nodes are the values of a cut body's nodes, one for each part, for `motion`.

    Those of one node are one until the cut opens.

    Parameters
    ----------
    case : Case
    body : CutBody
    answer : SplitMesh
    forms : Forms
    ghost : float
        Factor of the ghost penalty, as long as the cut is open.
    """

    def __init__(self, case, body, answer, forms, ghost):
        if len({cut["opens_at"] for cut in case.content["cuts"]}) > 1:
            raise RefusedError("cuts that open one after another are not offered")
        for name in ("content", "problem", "dimension", "repetitions", "constant"):
            setattr(self, name, getattr(case, name))
        self.ghost, self._case, self._body, self._answer = ghost, case, body, answer
        self.used = answer.used(body.count)
        number = np.where(self.used, np.cumsum(self.used) - 1, 0)
        self.group = number[body.group]
        node = np.zeros(body.count, dtype=int)
        node[body.group] = np.arange(len(case.points))
        self.points = case.points[node[self.used]]
        whole = self.group[np.where(body.side == 0, 2, (body.side + 1) // 2)[:, None], case.cells]
        below, above = (self.group[side][case.cells[body.cut]] for side in (0, 1))
        self.cells = np.vstack([whole[~body.cut], below, above])
        self.forms = forms
        self.timings = {}

    def opening(self):
        """Return the time (N,) at which a node parts from its twin; −∞ without one."""
        _, place = np.unique(self.points, axis=0, return_inverse=True)
        twins = np.bincount(place.ravel())[place.ravel()] > 1
        times = [cut["opens_at"] for cut in self.content["cuts"]]  # all alike
        return np.where(twins, max(times, default=0.0), -np.inf)

    def held(self, time=0.0):
        """Which components of which values are held, and by how much at a time."""
        return tuple(field[self.used] for field in prescribed(self._case, self._body, time))

    def nodal_loads(self):
        """History and forces of each load."""
        found = []
        for load in self.problem["loads"]:
            if load["kind"] == "traction":
                force = forces(self._case, self._body, [load])[self.used]
            elif "uniform" in load:
                turned = self.forms.joined(self.group, len(self.points)).CreateTranspose()
                force = (turned * self.forms.load(load["uniform"])).Evaluate().FV().NumPy()
                force = force.reshape(self.dimension, -1).T.copy()
            else:
                raise RefusedError("body forces in formulas are not offered")
            found.append((load.get("history"), force))
        return found

    def answer(self, points, cells, cut_facets, **more):
        """Write the motion on the divided mesh."""
        answer, body = self._answer, self._body
        for name in ("displacement", "velocity", "acceleration"):
            values = np.zeros((len(more[name]), body.count, self.dimension))
            values[:, self.used] = more[name]
            more[name] = np.array([answer.values(frame) for frame in values])
        self._case.timings = self.timings
        facets = answer.facets(body.on_a_cut)
        self._case.answer(answer.points, answer.cells, cut_facets=facets, **more)


class Body:
    """Newmark's method with β = 1/4 and γ = 1/2; the engine of `motion`."""

    def __init__(self, case, stage):
        self.d, self.shape = case.dimension, stage.points.shape
        # while the cut is closed there are no cut elements, and nothing to penalise
        ghost = case.ghost if len(stage.points) == len(case.points) else 0.0
        joined = case.forms.joined(stage.node[case.group], len(stage.points))
        turned, density = joined.CreateTranspose(), float(case.constant("density")[0])

        def matrix(stiffness, mass, ghost=ghost):
            return turned @ case.forms.matrix(stiffness, mass * density, ghost) @ joined

        # made on demand, outside of the timed steps
        self.plain = cache(lambda: matrix(1.0, 0.0, 0.0)) if ghost else None
        self.matrix, self.free = matrix, bits(~stage.held.T.ravel())
        self.stiffness, self.mass, self.inverse = matrix(1.0, 0.0), matrix(0.0, 1.0), {}

    def _vector(self, values):
        found = self.stiffness.CreateColVector()
        found.FV().NumPy()[:] = values.T.ravel()
        return found

    def _values(self, vector):
        return vector.FV().NumPy().reshape(self.d, -1).T.copy()

    def _solved(self, key, matrix, right):
        if key not in self.inverse:
            self.inverse[key] = matrix().Inverse(self.free, inverse="sparsecholesky")
        found = self.stiffness.CreateColVector()
        found.data = self.inverse[key] * right
        return self._values(found)

    def _rest(self, u, force):
        """Return the forces that nothing balances."""
        found = self._vector(force)
        found.data -= self.stiffness * self._vector(u)
        return found

    def equilibrium(self, values, force):
        """Displacement at rest under forces and values of what is held."""
        rest = self._rest(values, force)
        return values + self._solved("static", lambda: self.stiffness, rest)

    def begin(self, u, v, force, dt):
        """Take over a state; its acceleration balances the forces."""
        self.u, self.v = u.copy(), v.copy()
        self.a = self._solved("mass", lambda: self.mass, self._rest(u, force))

    def step(self, dt, values, force):
        """Step by dt, to values and forces of its end."""
        guess = self.u + dt * self.v + 0.25 * dt**2 * self.a
        held = ~np.array(list(self.free), dtype=bool).reshape(self.d, -1).T
        a = np.where(held, (values - guess) / (0.25 * dt**2), 0.0)
        rest = self._rest(guess + 0.25 * dt**2 * a, force)
        rest.data -= self.mass * self._vector(a)
        a += self._solved(dt, lambda: self.matrix(0.25 * dt**2, 1.0), rest)
        self.v += 0.5 * dt * (self.a + a)
        self.u, self.a = guess + 0.25 * dt**2 * a, a

    def penalty(self):
        """Return the energy of the ghost penalty, J."""
        if self.plain is None:
            return 0.0
        u, force = self._vector(self.u), self.stiffness.CreateColVector()
        force.data = self.stiffness * u
        force.data -= self.plain() * u
        return 0.5 * ng.InnerProduct(u, force)

    def state(self):
        """Displacement, velocity and acceleration."""
        return [field.copy() for field in (self.u, self.v, self.a)]


def solve(case):
    """Divide the mesh along the cut; solve statics or a motion."""
    ghost = float(case.parameters.get("ghost", 0.01))
    if ghost < 0:
        raise RefusedError(f"ghost = {ghost}; expected a number from 0 on")
    enriched = case.parameters.get("space") == "xfe"
    if enriched and ghost:
        raise RefusedError(f"space = 'xfe' with ghost = {ghost}; expected ghost = 0")
    body, answer = divided(case)
    forms = (EnrichedForms if enriched else Forms)(case, body, mesh_of(case))
    method = "XFEM" if enriched else "CutFEM"
    notes = {"method": method, "ghost": str(ghost), "ngsolve": ng.__version__}
    if case.content["analysis"]["kind"] == "static":
        solve_static(case, body, answer, forms, ghost, notes)
        return
    notes |= {"scheme": "trapezoidal rule", "mass": "consistent, of each side; no ghost penalty"}
    parted = PartedCase(case, body, answer, forms, ghost)
    run_engine(parted, Body, "consistent", notes=notes)


def solve_static(case, body, answer, forms, ghost, notes):
    """Solve linear statics and write the answer."""
    d, (held, value) = case.dimension, held_at_rest(case, body, answer)
    if any(one.get("history") for one in case.problem["held"] + case.problem["loads"]):
        raise RefusedError("statics with histories are not offered")
    weight = uniform_weight(case)
    outer, joined = forces(case, body), forms.joined(body.group, body.count)
    turned = joined.CreateTranspose()

    def assembled():
        matrix = forms.matrix(1.0, 0.0, ghost)
        return turned @ matrix @ joined, (turned * forms.load(weight)).Evaluate()

    matrix, load = case.timed("assembly", assembled)
    used = answer.used(body.count)
    free = bits((~held & used[:, None]).T.ravel())

    def solved():
        u = load.CreateVector()
        u.FV().NumPy()[:] = value.T.ravel()
        rest = load.CreateVector()
        rest.FV().NumPy()[:] = load.FV().NumPy() + outer.T.ravel()
        rest.data -= matrix * u
        u.data += matrix.Inverse(free, inverse="sparsecholesky") * rest
        return u.FV().NumPy().reshape(d, -1).T.copy()

    u = case.timed("solve", solved)
    case.answer(
        answer.points, answer.cells, answer.values(u), unknowns=int(used.sum()) * d,
        cut_facets=answer.facets(body.on_a_cut), notes=notes,
    )  # fmt: skip


if __name__ == "__main__":
    run(solve)

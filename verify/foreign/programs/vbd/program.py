"""Vertex block descent as Newton has it: stable neo-Hookean tetrahedra, implicit Euler.

python program.py FOLDER LEVEL

The descent stops after ``iterations``, wherever it is; with ``step = "solved"`` the same steps are
solved by Newton's method, which shows what the descent has left out. At rest is where steps come
to that each begin at a standstill, ``rest`` of them, each as long as a shear wave takes through the
body; loads and supports rise over the first half.
"""

import newton
import numpy as np
import warp as wp
from exchange_files import RefusedError, run
from implicit_euler import ImplicitEuler
from motion import run_engine


class Body:
    """A soft body; the engine of `motion`."""

    def __init__(self, case, stage):
        self.stage, self.asked, self.model = stage, case.parameters, None
        self.static = case.content["analysis"]["kind"] == "static"
        self.held = stage.held.all(axis=1)
        if (stage.held.any(axis=1) != self.held).any():
            raise RefusedError("supports that hold some components of a point only")
        cells, edges = stage.cells.copy(), np.diff(stage.points[stage.cells], axis=1)
        turned = np.linalg.det(edges) < 0.0
        cells[turned] = cells[turned][:, [0, 1, 3, 2]]
        volume = np.abs(np.linalg.det(edges)) / 6.0
        density = case.constant("density")
        if np.isnan(density).any():
            raise RefusedError("no density: it comes to rest by steps in time")
        share = np.repeat(volume * density / 4.0, 4)
        self.mass = np.bincount(cells.ravel(), share, minlength=len(stage.points))
        law = case.constant("lame"), case.constant("shear")
        self.solid = ImplicitEuler(stage.points, cells, *law, self.mass, self.held)
        wave = np.sqrt((density / law[1]).max())
        self.through = np.ptp(stage.points, axis=0).max() * wave  # s
        if case.parameters["step"] == "descent":
            self.build(cells, *law)

    def build(self, cells, lame, shear):
        """Enter the body."""
        builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))  # all loads are forces
        builder.add_soft_mesh(
            pos=wp.vec3(), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(), density=1.0,
            vertices=[wp.vec3(*point) for point in self.stage.points],
            indices=cells.ravel().tolist(), k_mu=shear, k_lambda=lame, k_damp=0.0,
            add_surface_mesh_edges=False,
        )  # fmt: skip
        builder.particle_mass[:] = np.where(self.held, 0.0, self.mass).tolist()
        builder.color()
        self.model = builder.finalize(device="cpu")
        count = int(self.asked["iterations"])
        self.solver = newton.solvers.SolverVBD(self.model, iterations=count)
        self.now, self.next = self.model.state(), self.model.state()
        self.control = self.model.control()

    def equilibrium(self, values, force):
        """Displacement at rest under forces and values of what is held."""
        if not self.static:
            return self.solid.solve(values, force)
        count, self.u = int(self.asked["rest"]), np.zeros_like(values)
        for n in range(1, count + 1):
            share, self.v = min(1.0, 2 * n / count), np.zeros_like(values)
            self.step(self.through, share * values, share * force)
        return self.u

    def begin(self, u, v, force, dt):
        """Take over a state."""
        self.u, self.v = u.copy(), v.copy()

    def step(self, dt, values, force):
        """Substeps with the forces of the end of the step; supports move evenly."""
        count, start = int(self.asked["substeps"]), self.u[self.held]
        for n in range(1, count + 1):
            at = start + n / count * (values[self.held] - start)
            self.advance(dt / count, at, force)

    def advance(self, dt, at, force):
        """Take one step of implicit Euler."""
        guess = self.u + dt * self.v
        guess[self.held] = at
        if self.model is None:
            found = self.solid.solve(guess, force, 1.0 / dt**2, self.u + dt * self.v)
        else:
            self.u[self.held] = at
            placed = (self.stage.points + self.u, self.v, force)
            fields = (self.now.particle_q, self.now.particle_qd, self.now.particle_f)
            for field, values in zip(fields, placed, strict=True):
                field.assign(values.astype(np.float32))
            self.solver.step(self.now, self.next, self.control, None, dt)
            found = self.next.particle_q.numpy() - self.stage.points
            found[self.held] = at
        self.v = (found - self.u) / dt
        self.u = found

    def state(self):
        """Displacement, velocity, and acceleration if there is one."""
        return self.u.copy(), self.v.copy()


def solve(case):
    """Answer, and say by which model."""
    wp.config.quiet = True
    run_engine(case, Body, "lumped", notes={
        "version": newton.__version__, "scheme": "implicit Euler", "mass": "lumped",
        "model": "stable neo-Hookean",
        "iterations": str(case.parameters["iterations"]), "step": case.parameters["step"],
        "substeps": str(case.parameters["substeps"]),
    })  # fmt: skip


if __name__ == "__main__":
    run(solve, conforming=True)

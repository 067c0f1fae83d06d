"""Linear elements on a conforming mesh in numpy and scipy alone: a solver of somebody else.

It stands for the repository of a stranger: of the project it imports what
docs/guide/your-solver.md offers, and none of its solvers. A motion takes average acceleration. Two
copies of a node of the cut are one until the blade has passed all facets around them.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from verify.errors import InputError, UnsupportedSceneError
from verify.exchange import problem_of
from verify.solution import Solution


class Stranger:
    name = "stranger"

    def refuses(self, scene):
        if scene.dimension != 2 or not scene.material.is_uniform:
            return "only plane bodies of one material"
        if scene.analysis.kinematics != "linear":
            return "only linear kinematics"
        return None

    def levels(self, scene):
        return scene.mesh.count

    def solve(self, scene, level, repetitions=1):
        if refusal := self.refuses(scene):
            raise UnsupportedSceneError(refusal)
        seconds = []
        for _ in range(max(1, repetitions)):
            start = perf_counter()
            body = Body(problem_of(scene, level, conforming=True))
            answer = body.rest() if scene.analysis.kind == "static" else body.motion(scene)
            seconds.append(perf_counter() - start)
        return Solution(
            body.problem.points, body.problem.cells, cut_facets=body.problem.cut_facets,
            unknowns=body.problem.points.size, size=body.problem.size,
            timings={"solve": seconds}, **answer,
        )  # fmt: skip


@dataclass
class Body:
    problem: object

    def __post_init__(self):
        points, cells = self.problem.points, self.problem.cells
        edges = np.roll(points[cells], -2, axis=1) - np.roll(points[cells], -1, axis=1)
        # a normal of length |edge| over twice the area is the gradient of the corner opposite
        area = 0.5 * (edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
        gradient = np.stack([-edges[..., 1], edges[..., 0]], axis=2) / (2 * area[:, None, None])
        lam, shear = self.problem.lame()
        both = np.einsum("mia,mjb->miajb", gradient, gradient)
        block = lam * both + shear * both.transpose(0, 1, 4, 3, 2)
        dot = np.einsum("mia,mja->mij", gradient, gradient)
        block += shear * dot[:, :, None, :, None] * np.eye(2)[None, None, :, None, :]
        dofs = (2 * cells[..., None] + (0, 1)).reshape(len(cells), 6)
        row, column = np.repeat(dofs, 6), np.tile(dofs, 6).ravel()
        values = (block * np.abs(area)[:, None, None, None, None]).ravel()
        self.stiffness = csr_array(coo_array((values, (row, column)), shape=(points.size,) * 2))
        share = np.repeat(np.abs(area) / 3, 3)
        self.node_volume = np.bincount(cells.ravel(), share, len(points))
        self.force = self.problem.nodal_forces().ravel()
        held, values = self.problem.prescribed()
        self.held, self.values = held.ravel(), values.ravel()

    def rest(self, ties=None):
        ties = self._ties(np.zeros(len(self.problem.points), bool)) if ties is None else ties
        known = np.where(self.held, self.values, 0.0)
        free = _free(ties, self.held)
        K = (free.T @ self.stiffness @ free).tocsc()
        u = known + free @ splu(K).solve(free.T @ (self.force - self.stiffness @ known))
        energy = 0.5 * u @ (self.stiffness @ u)
        return {"displacement": u.reshape(1, -1, 2), "ledger": {"strain": np.array([energy])}}

    def motion(self, scene):
        """Move from rest; gravity and supports do not change."""
        mass = self.problem.density() * self.node_volume.repeat(2)
        step = scene.analysis.time_step
        opens = self._opens_at(scene.cuts[0])
        tied = opens > 0.0
        v, kept, solver = np.zeros(len(mass)), [], None
        u = v
        if scene.initial.kind == "equilibrium":
            u = self.rest(self._ties(tied))["displacement"].ravel()
        outputs = np.asarray(scene.analysis.output_times)
        for k in range(round(outputs[-1] / scene.analysis.time_step) + 1):
            time = k * scene.analysis.time_step
            if solver is None or (tied & (opens <= time)).any():
                tied = tied & (opens > time)
                free = _free(self._ties(tied), self.held)
                M = (free.T @ diags_array(mass) @ free).tocsc()
                K = (free.T @ self.stiffness @ free).tocsc()
                solver, start = splu(M + 0.25 * step**2 * K), splu(M)
            if len(kept) < len(outputs) and time >= outputs[len(kept)] - 1e-9 * step:
                kept.append((u, v))
            out = free.T @ (self.force - self.stiffness @ u)
            before = start.solve(out)
            ahead = free @ before * (0.25 * step**2) + step * v
            after = solver.solve(free.T @ (self.force - self.stiffness @ (u + ahead)))
            u = u + ahead + 0.25 * step**2 * (free @ after)
            v = v + 0.5 * step * (free @ (before + after))
        places, speeds = (
            np.array(one).reshape(len(kept), -1, 2) for one in zip(*kept, strict=True)
        )
        flat, moving = places.reshape(len(kept), -1), speeds.reshape(len(kept), -1)
        ledger = {
            "strain": 0.5 * np.einsum("ti,ti->t", flat, (self.stiffness @ flat.T).T),
            "kinetic": 0.5 * moving**2 @ mass,
            "external_work": (flat - flat[0]) @ self.force,
        }
        return {
            "displacement": places, "velocity": speeds, "times": outputs, "ledger": ledger,
            "mass": mass[::2],
        }  # fmt: skip

    def _twins(self):
        """Pairs (n, 2) of nodes that lie at one place: the copies of a node of the cut."""
        points = self.problem.points
        order = np.lexsort(points.T)
        same = (points[order[1:]] == points[order[:-1]]).all(axis=1)
        return np.column_stack([order[:-1][same], order[1:][same]])

    def _ties(self, tied):
        """Matrix from the nodes without those that are tied to their twin to all nodes."""
        count = len(self.problem.points)
        master = np.arange(count)
        for one, other in self._twins():
            if tied[one]:
                master[other] = master[one]
        own, column = np.unique(master, return_inverse=True)
        return csr_array((np.ones(count), (np.arange(count), column)), shape=(count, len(own)))

    def _opens_at(self, cut):
        """When each node (n,) is let go: -inf away from the cut, and if no blade makes it."""
        opens = np.full(len(self.problem.points), -np.inf)
        if not cut.on_the_way:
            return opens
        points = np.asarray(cut.points)
        along = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
        when = cut.starts_at + (self.problem.points - points[0]) @ along / cut.speed
        facets = self.problem.cut_facets
        ends = cut.starts_at + (facets - points[0]) @ along / cut.speed
        for node in self._twins().ravel():
            around = np.abs(ends - when[node]).min(axis=1) < 1e-9
            opens[node] = ends[around].max()
        return opens


def _free(ties, held):
    """Matrix from the unknowns that nothing holds to all displacements."""
    count = 2 * ties.shape[1]
    spread = coo_array(ties)
    row = (2 * spread.row[:, None] + (0, 1)).ravel()
    column = (2 * spread.col[:, None] + (0, 1)).ravel()
    both = csr_array((np.ones(len(row)), (row, column)), shape=(2 * ties.shape[0], count))
    fixed = both.T @ held.astype(float) > 0
    if fixed.all():
        raise InputError("nothing is free to move")
    return both[:, np.flatnonzero(~fixed)]

"""C6, second route: quadratic triangles on a mesh of its own, a blade, the scheme TR-BDF2.

Made from docs/benchmark/c6.md alone, with numpy, scipy and scikit-fem. `python c6_block.py 16 32`
prints the outputs of the page on meshes with 16 and 32 elements along the cut.
"""

import sys

import numpy as np
from scipy.sparse import block_diag, coo_matrix
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, LinearForm, MeshTri
from skfem.helpers import ddot, dot, sym_grad, trace
from skfem.models.elasticity import lame_parameters

SIDE, GRAVITY, DENSITY = 0.08, 9.8, 1000.0
LAME, SHEAR = lame_parameters(6e4, 0.3)
FIRST, LAST = np.array([-0.01, 0.037]), np.array([0.09, 0.0432])  # path of the blade
ALONG = (LAST - FIRST) / np.linalg.norm(LAST - FIRST)
NORMAL = np.array([-ALONG[1], ALONG[0]])
SPEED, START = 1.5, -0.003
STEPS = 8  # per element along the cut
GAMMA = 2.0 - np.sqrt(2.0)  # inner time of a step (Bank et al. 1985)
TIMES = 0.02, 0.04, 0.06, 0.12


@BilinearForm
def stiffness(u, v, _):
    """Plane strain, Hooke."""
    e = sym_grad(u)
    return 2.0 * SHEAR * ddot(e, sym_grad(v)) + LAME * trace(e) * trace(sym_grad(v))


@BilinearForm
def mass(u, v, _):
    """Consistent mass."""
    return DENSITY * dot(u, v)


@LinearForm
def weight(v, _):
    """Gravity, along −y."""
    return -DENSITY * GRAVITY * v[1]


def height_of_path(x):
    """Height of the path of the blade, m."""
    return FIRST[1] + (x - FIRST[0]) * ALONG[1] / ALONG[0]


class Half:
    """One side of the path: mesh, matrices, nodes on the path in order."""

    def __init__(self, n, above):
        rows = round(n * 0.5)
        x, s = np.meshgrid(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, rows + 1))
        path = height_of_path(SIDE * x)
        y = path + s * (SIDE - path) if above else s * path
        node = np.arange(x.size).reshape(x.shape)
        a, b, c, d = (
            part.ravel() for part in (node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1])
        )
        odd = (np.add.outer(np.arange(rows), np.arange(n)) % 2).ravel() == 1
        first = np.where(odd, [a, b, d], [a, b, c])
        second = np.where(odd, [b, c, d], [a, c, d])
        self.mesh = MeshTri(np.stack([SIDE * x.ravel(), y.ravel()]), np.hstack([first, second]))
        self.basis = Basis(self.mesh, ElementVector(ElementTriP2()), intorder=4)
        self.stiffness = stiffness.assemble(self.basis)
        self.mass = mass.assemble(self.basis)
        self.load = weight.assemble(self.basis)
        places = self.basis.doflocs
        x_dofs = np.unique(np.concatenate([self.basis.nodal_dofs[0], self.basis.facet_dofs[0]]))
        on_path = x_dofs[
            np.abs(places[1, x_dofs] - height_of_path(places[0, x_dofs])) < 1e-9 * SIDE
        ]
        on_path = on_path[np.argsort(places[0, on_path])]
        self.on_path = np.stack([on_path, on_path + 1], axis=1)  # (2n + 1, 2)
        self.top = self.basis.get_dofs(lambda p: p[1] > SIDE - 1e-9).all() if above else []

    def value(self, u, point):
        """Displacement at a point."""
        probe = self.basis.probes(np.array(point)[:, None])
        return probe @ u


class Block:
    """Both halves, with pairs of nodes on the path that are tied until they are let go."""

    def __init__(self, n):
        self.halves = Half(n, False), Half(n, True)
        below, above = self.halves
        self.size = below.basis.N + above.basis.N
        self.K, self.M = (
            block_diag([getattr(half, name) for half in self.halves], "csr")
            for name in ("stiffness", "mass")
        )
        self.f = np.concatenate([below.load, above.load])
        self.pairs = np.stack([below.on_path, above.on_path + below.basis.N], axis=1)
        self.held = np.asarray(above.top, dtype=int) + below.basis.N

    def unknowns(self, tied):
        """Matrix (size, unknowns) that gives tied pairs one value and held nodes none."""
        owner = np.arange(self.size)
        owner[self.pairs[tied, 0].ravel()] = self.pairs[tied, 1].ravel()
        owner[self.held] = -1
        kept = np.unique(owner[owner >= 0])
        rows = np.flatnonzero(owner >= 0)
        columns = np.searchsorted(kept, owner[rows])
        return coo_matrix((np.ones(len(rows)), (rows, columns)), (self.size, len(kept))).tocsr()


def unswept(node, way, n):
    """Share of ∫ N ds ahead of the blade, `way` elements from the left end of the path.

    N is 1 over the element of a node in the middle of one (odd number), and the linear hat over
    both elements of a node at their ends.
    """
    first = node // 2
    if node % 2:
        return 1.0 - np.clip(way - first, 0.0, 1.0)
    rising, falling = np.clip(way - first + 1.0, 0.0, 1.0), np.clip(way - first, 0.0, 1.0)
    left = 0.5 * (1.0 - rising**2) * (node > 0), 0.5 * (1.0 - falling) ** 2 * (node < 2 * n)
    return sum(left) * (1.0 if 0 < node < 2 * n else 2.0)


def motion(n):
    """Yield time, displacement, velocity and the work of the fading forces, step by step."""
    block = Block(n)
    enters = START + np.linalg.norm([0.0 - FIRST[0], height_of_path(0.0) - FIRST[1]]) / SPEED
    element = SIDE / n / ALONG[0] / SPEED  # s
    step = element / STEPS
    tied = np.ones(2 * n + 1, dtype=bool)
    Z = block.unknowns(tied)
    u = Z @ splu((Z.T @ block.K @ Z).tocsc()).solve(Z.T @ block.f)
    v, a = np.zeros(block.size), np.zeros(block.size)
    forces = {}  # of nodes that are let go: force on the lower one when it was
    time, work, k = enters, 0.0, 0
    yield block, time, u, v, work
    while time < TIMES[-1] + step:
        ways = (k + np.array([0.0, GAMMA, 1.0])) / STEPS
        if k % STEPS == 0 and k < STEPS * n:
            held = block.M @ a + block.K @ u - block.f - loads(block, forces, ways[0], n)
            for node in range(2 * k // STEPS, 2 * k // STEPS + 3):
                if tied[node]:
                    forces[node], tied[node] = held[block.pairs[node, 0]], False
            Z = block.unknowns(tied)
            M, K = Z.T @ block.M @ Z, Z.T @ block.K @ Z
            solve = splu((M + (0.5 * GAMMA * step) ** 2 * K).tocsc()).solve
        load = [loads(block, forces, way, n) for way in ways]
        h = 0.5 * GAMMA * step
        # trapezoidal rule to the inner time, then the backward formula over all three
        guess_v = v + h * a
        guess = u + h * v + h * guess_v
        inner_a = Z @ solve(Z.T @ (block.f + load[1] - block.K @ guess))
        inner_u, inner_v = guess + h**2 * inner_a, guess_v + h * inner_a
        guess_v = (inner_v - (1 - GAMMA) ** 2 * v) / (GAMMA * (2 - GAMMA))
        guess = (inner_u - (1 - GAMMA) ** 2 * u) / (GAMMA * (2 - GAMMA)) + h * guess_v
        a = Z @ solve(Z.T @ (block.f + load[2] - block.K @ guess))
        new_u, v = guess + h**2 * a, guess_v + h * a
        work -= 0.5 * (
            (load[0] + load[1]) @ (inner_u - u) + (load[1] + load[2]) @ (new_u - inner_u)
        )
        u, k = new_u, k + 1
        time = enters + k * step
        yield block, time, u, v, work


def loads(block, forces, way, n):
    """Forces (size,) that still hold what is let go."""
    load = np.zeros(block.size)
    for node, force in forces.items():
        share = unswept(node, way, n)
        if share:
            load[block.pairs[node, 0]] += share * force
            load[block.pairs[node, 1]] -= share * force
    return load


def outputs(n):
    """Return the outputs of the page on a mesh with n elements along the cut."""
    found, last = {}, None
    rows = None
    for block, time, u, v, work in motion(n):
        if rows is None:
            rows = _rows(block, n)
        now = time, {name: (row @ u, row @ v) for name, row in rows.items()}, work
        for number, asked in enumerate(TIMES, 1):
            if last and last[0] < asked <= now[0]:
                for name in rows:
                    value, rate = hermite(last, now, asked, name)
                    if name == "opening" and number < 4:
                        found[f"opening_{number}"] = value
                    elif name != "opening" and number == 4:
                        key = {"momentum": "momentum_below"}.get(name, name)
                        found[key] = rate if name == "momentum" else value
        last = now
    found["cut_work"] = last[2]
    return found


def _rows(block, n):
    below, above = block.halves
    opening = np.zeros(block.size)
    pair = block.pairs[round(2 * n * 0.01 / SIDE)]
    opening[pair[1]], opening[pair[0]] = NORMAL, -NORMAL
    rows = {"opening": opening}
    for name, x in (("fall_left", 0.01), ("fall_right", 0.07)):
        probe = below.basis.probes(np.array([[x], [0.01]])).toarray()
        rows[name] = np.concatenate([probe[1], np.zeros(above.basis.N)])
    vertical = np.zeros(block.size)
    vertical[below.basis.nodal_dofs[1]] = vertical[below.basis.facet_dofs[1]] = 1.0
    rows["momentum"] = block.M @ vertical
    return rows


def hermite(last, now, time, name):
    """Cubic between two times, and its rate."""
    step = now[0] - last[0]
    s = (time - last[0]) / step
    (u, v), (next_u, next_v) = last[1][name], now[1][name]
    value = (
        (1 + 2 * s) * (1 - s) ** 2 * u + s * (1 - s) ** 2 * step * v
        + s**2 * (3 - 2 * s) * next_u + s**2 * (s - 1) * step * next_v
    )  # fmt: skip
    rate = (
        6 * s * (1 - s) * (next_u - u) / step + (1 - s) * (1 - 3 * s) * v + s * (3 * s - 2) * next_v
    )
    return value, rate


def second_route():
    """Give {quantity: (value, half-width)}: a line in h through those of 16, 32 and 64 elements.

    By least squares, as waves shift single values. Half-width: half of what it adds to the finest
    mesh, for orders from 0.6 to 2.
    """
    found = [outputs(n) for n in (16, 32, 64)]
    line = np.linalg.pinv(np.stack([np.ones(3), [4.0, 2.0, 1.0]], axis=1))[0]
    limits = {name: line @ [one[name] for one in found] for name in found[0]}
    return {name: (limit, 0.5 * abs(found[-1][name] - limit)) for name, limit in limits.items()}


if __name__ == "__main__":
    for elements in map(int, sys.argv[1:] or ["16", "32"]):
        found = outputs(elements)
        print(elements, *(f"{name} {value:.7g}" for name, value in found.items()))

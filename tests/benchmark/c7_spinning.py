"""C7, second route: quadratic triangles on a mesh of its own, Verlet with a consistent mass.

Made from docs/benchmark/c7.md alone, with numpy and scipy. `python c7_spinning.py 4 8`
prints the outputs of the page with 4 and 8 rows of elements.
"""

import sys

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

SIZE = np.array([0.12, 0.08])
YOUNG, POISSON, DENSITY = 1e4, 0.3, 1000.0
SHEAR = YOUNG / (2 * (1 + POISSON))
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
VELOCITY, SPIN = np.array([0.5, 0.2]), 8.0
CUT = np.array([[-0.01, 0.03], [0.13, 0.051]])
OPENS, ENDS = 0.05, 1.0
ORDER = [(0, 1), (1, 2), (2, 0)]
# six points of degree 4 on the triangle (Strang and Fix): barycentric places and weights
_A, _B = 0.445948490915965, 0.091576213509771
POINTS = np.array(
    [[_A, _A, 1 - 2 * _A], [_A, 1 - 2 * _A, _A], [1 - 2 * _A, _A, _A],
     [_B, _B, 1 - 2 * _B], [_B, 1 - 2 * _B, _B], [1 - 2 * _B, _B, _B]]
)  # fmt: skip
WEIGHTS = np.array([0.223381589678011] * 3 + [0.109951743655322] * 3)


def height_of_cut(x):
    """Height of the line of the cut, m."""
    return CUT[0, 1] + (x - CUT[0, 0]) * (CUT[1, 1] - CUT[0, 1]) / (CUT[1, 0] - CUT[0, 0])


def grid(rows):
    """Quadratic triangles (e, 6) whose lines follow the cut: vertices, then middles of edges.

    Returns nodes (n, 2), triangles, the number of those below the cut, and the nodes on the cut.
    """
    nx, below = round(1.5 * rows), rows // 2
    i, j = np.meshgrid(np.arange(2 * nx + 1), np.arange(2 * rows + 1))
    x = SIZE[0] * i / (2 * nx)
    path, s = height_of_cut(x), j / (2 * below)
    up = (j - 2 * below) / (2 * (rows - below))
    y = np.where(s <= 1, s * path, path + up * (SIZE[1] - path))
    node = np.arange(i.size).reshape(i.shape)
    triangles = []
    for r in range(0, 2 * rows, 2):
        for c in range(0, 2 * nx, 2):
            a = node[r : r + 3, c : c + 3]
            if (r + c) // 2 % 2:
                triangles += [[a[0, 0], a[0, 2], a[2, 0], a[0, 1], a[1, 1], a[1, 0]],
                              [a[0, 2], a[2, 2], a[2, 0], a[1, 2], a[2, 1], a[1, 1]]]  # fmt: skip
            else:
                triangles += [[a[0, 0], a[0, 2], a[2, 2], a[0, 1], a[1, 2], a[1, 1]],
                              [a[0, 0], a[2, 2], a[2, 0], a[1, 1], a[2, 1], a[1, 0]]]  # fmt: skip
    on_cut = node[2 * below]
    nodes, triangles = np.stack([x.ravel(), y.ravel()], axis=1), np.array(triangles)
    for k, (first, second) in enumerate(ORDER, 3):  # a diagonal of a trapezium has its own middle
        nodes[triangles[:, k]] = 0.5 * (nodes[triangles[:, first]] + nodes[triangles[:, second]])
    return nodes, triangles, 2 * nx * below, on_cut


class Body:
    """Nodes, triangles, gradients of shape functions, mass."""

    def __init__(self, nodes, triangles):
        self.nodes, self.triangles = nodes, triangles
        corners = nodes[triangles[:, :3]]
        edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        area = 0.5 * np.linalg.det(edges)
        of_barycentric = np.concatenate([-np.ones((1, 2)), np.eye(2)]).T  # (2, 3)
        gradient = np.einsum("eji,jk->eki", np.linalg.inv(edges), of_barycentric)  # (e, 3, 2)
        shape, slope = np.empty((6, 6)), np.zeros((6, 6, 3))  # at each point
        for k in range(3):
            shape[:, k] = POINTS[:, k] * (2 * POINTS[:, k] - 1)
            slope[:, k, k] = 4 * POINTS[:, k] - 1
        for k, (a, b) in enumerate(ORDER, 3):
            shape[:, k] = 4 * POINTS[:, a] * POINTS[:, b]
            slope[:, k, a], slope[:, k, b] = 4 * POINTS[:, b], 4 * POINTS[:, a]
        self.weight = area[:, None] * WEIGHTS  # (e, q)
        self.gradient = np.einsum("qnk,eki->eqni", slope, gradient)
        blocks = DENSITY * np.einsum("eq,qn,qm->enm", self.weight, shape, shape)
        rows = np.repeat(triangles, 6, axis=1).ravel()
        columns = np.tile(triangles, 6).ravel()
        size = (len(nodes), len(nodes))
        self.mass = coo_matrix((blocks.ravel(), (rows, columns)), size).tocsc()
        self.solve = splu(self.mass).solve
        self.scatter = coo_matrix(
            (np.ones(triangles.size), (triangles.ravel(), np.arange(triangles.size))),
            (len(nodes), triangles.size),
        ).tocsr()

    def forces(self, x):
        """Internal forces (n, 2) and energy of places x (n, 2)."""
        F = np.einsum("eni,eqnj->eqij", x[self.triangles], self.gradient)
        a, b = F[..., 0, 0] + F[..., 1, 1], F[..., 1, 0] - F[..., 0, 1]
        trace = np.hypot(a, b)  # of U
        R = np.stack([np.stack([a, -b], -1), np.stack([b, a], -1)], -2) / trace[..., None, None]
        e = trace - 2.0
        stress = 2 * SHEAR * (F - R) + LAME * e[..., None, None] * R
        density = SHEAR * ((F**2).sum((-1, -2)) - 2 * trace + 2) + 0.5 * LAME * e**2
        local = np.einsum("eq,eqij,eqnj->eni", self.weight, stress, self.gradient)
        energy = float((self.weight * density).sum())
        return self.scatter @ local.reshape(-1, 2), energy

    def momenta(self, x, v):
        """Mass, momentum, spin about the own centre, moment of inertia now."""
        m = np.asarray(self.mass.sum(axis=0)).ravel()
        total, p = m.sum(), self.mass @ v
        centre, momentum = m @ x / total, p.sum(axis=0)
        arm = x - centre
        spin = (arm[:, 0] * p[:, 1] - arm[:, 1] * p[:, 0]).sum()
        return total, momentum, spin


def verlet(body, x, v, step, count, watch=None):
    """Leapfrog; `watch(k, x, v, energy)` is called at each step."""
    f, energy = body.forces(x)
    a = -body.solve(f)
    for k in range(count):
        if watch:
            watch(k, x, v, energy)
        v = v + 0.5 * step * a
        x = x + step * v
        f, energy = body.forces(x)
        a = -body.solve(f)
        v = v + 0.5 * step * a
    if watch:
        watch(count, x, v, energy)
    return x, v


def outputs(rows, step=1e-4):
    """Return the outputs of the page."""
    nodes, triangles, below, on_cut = grid(rows)
    whole = Body(nodes, triangles)
    centre = 0.5 * SIZE
    arm = nodes - centre
    v = VELOCITY + SPIN * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    x, v = verlet(whole, nodes.copy(), v, step, round(OPENS / step))
    found = {}
    doubled = triangles.copy()
    copy = np.arange(len(nodes))
    copy[on_cut] = len(nodes) + np.arange(len(on_cut))
    doubled[below:] = copy[triangles[below:]]
    parts = []
    for mine in (doubled[:below], doubled[below:]):
        used, local = np.unique(mine, return_inverse=True)
        old = np.where(used < len(nodes), used, on_cut[np.maximum(used - len(nodes), 0)])
        body = Body(nodes[old], local.reshape(mine.shape))
        parts.append((body, x[old], v[old]))
    for name, (body, x, v) in zip(("below", "above"), parts, strict=True):
        mass, momentum, spin = body.momenta(x, v)
        found |= {f"mass_{name}": mass, f"momentum_{name}_x": momentum[0]}
        found |= {f"momentum_{name}_y": momentum[1], f"spin_{name}": spin}
        height = 0.0 if name == "below" else SIZE[1]
        ends = [_corner(body, (x_of, height)) for x_of in (0.0, SIZE[0])]
        angles, energies = [], []

        def watch(k, x, v, energy, body=body, ends=ends, angles=angles, energies=energies):
            chord = x[ends[1]] - x[ends[0]]
            angles.append(np.arctan2(chord[1], chord[0]))
            if k % 100 == 0:
                energies.append(energy + 0.5 * np.einsum("ni,ni", v, body.mass @ v))

        count = round((ENDS - OPENS) / step)
        x, v = verlet(body, x, v, step, count, watch)
        turned = np.unwrap(angles)
        times = OPENS + step * np.arange(count + 1)
        found[f"turn_{name}"] = turned[-1]
        k = np.argmax(turned >= 2 * np.pi)
        if turned[k] >= 2 * np.pi:
            share = (2 * np.pi - turned[k - 1]) / (turned[k] - turned[k - 1])
            found[f"period_{name}"] = times[k - 1] + share * step
        if name == "below":
            found["corner_below_x"] = (x - body.nodes)[ends[0], 0]
        else:
            found["corner_above_y"] = (x - body.nodes)[ends[1], 1]
        found[f"drift_{name}"] = np.ptp(energies) / energies[0]
    return found


def _corner(body, place):
    return int(np.argmin(np.linalg.norm(body.nodes - place, axis=1)))


def second_route():
    """Give {quantity: (value, half-width)}: of 8 rows, and twice the difference to 4."""
    coarse, fine = outputs(4), outputs(8)
    return {
        name: (value, 2 * abs(value - coarse[name]))
        for name, value in fine.items()
        if "drift" not in name
    }


if __name__ == "__main__":
    for rows in map(int, sys.argv[1:] or ["4", "8"]):
        for name, value in outputs(rows).items():
            print(rows, name, f"{value:.7g}")

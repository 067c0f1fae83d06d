"""C5, second route: half of the strip, quadratic triangles that move with the edge of the blade.

Made from docs/benchmark/c5.md alone, with numpy, scipy and scikit-fem.
`python c5_blade.py 0.3 8 12` prints its outputs at 0.3 of the shear wave's speed, with 8 and 12
elements across.

A point of the mesh is at x = X + v t q, q = 1 - |X|/0.3: the edge stays at the node X = 0, and no
node is let go. The velocity is u' = U' - v q du/dx, with U' at fixed X. It is singular as du/dx
is; U' is smooth. Kinetic less strain energy is U'MU'/2 - U'CU - U(K - N)U/2. Here M has U' twice,
N has v q du/dx twice, C has one of each. So p = MU' - CU and p' = -C^T U' - (K - N)U (Lagrange).
The implicit midpoint rule goes through time.
"""

import sys

import numpy as np
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTriP2, FacetBasis, MeshTri
from skfem.helpers import grad

HALF_LENGTH, WIDTH, GRIP = 0.3, 0.1, 0.006
SHEAR, DENSITY, END = 1000.0, 1000.0, 0.2  # c = 1 m/s
PLACE = -0.1  # of the opening
GRADE = 4  # nodes at (i/n)^4 of a side: a root of the distance costs no order
STEPS = 4.5  # per element across


def follows(f):
    """Share q of the edge's velocity with which a point of the mesh goes."""
    return 1.0 - np.abs(f.x[0]) / HALF_LENGTH


MASS = BilinearForm(lambda u, v, _: DENSITY * u * v)
CARRIED = BilinearForm(lambda u, v, f: DENSITY * follows(f) * grad(u)[0] * v)
CARRIED_TWICE = BilinearForm(lambda u, v, f: DENSITY * follows(f) ** 2 * grad(u)[0] * grad(v)[0])
ALONG = BilinearForm(lambda u, v, _: SHEAR * grad(u)[0] * grad(v)[0])
ACROSS = BilinearForm(lambda u, v, _: SHEAR * grad(u)[1] * grad(v)[1])
PULL = BilinearForm(lambda u, v, f: SHEAR * f.n[0] * grad(u)[0] * v)  # of the supports at the ends


def exact(x, y, time, speed):
    """Displacement u_z of the upper half, and its velocity."""
    g = np.sqrt(1.0 - speed**2)
    s = np.exp(np.pi * ((x - speed * time) / g + 1j * y) / (2 * WIDTH))
    u = GRIP * (1.0 - 2.0 / np.pi * np.arcsin(s).real)
    with np.errstate(divide="ignore", invalid="ignore"):  # at the edge of the blade
        slope = -GRIP / WIDTH * s / (np.sqrt(1.0 - s) * np.sqrt(1.0 + s))
    return u, -speed * slope.real / g


class Strip:
    """Upper half: its mesh at t = 0, who is free, and its matrices at any time."""

    def __init__(self, speed, n):
        self.speed = speed
        side = HALF_LENGTH * (np.arange(2 * n + 1) / (2 * n)) ** GRADE
        rows = WIDTH * (np.arange(n + 1) / n) ** GRADE
        mesh = MeshTri.init_tensor(np.concatenate([-side[:0:-1], side]), rows)
        left = mesh.p[0, mesh.t].mean(axis=0) < 0.0
        self.basis = Basis(mesh, ElementTriP2(), intorder=4)
        self.halves = []  # behind and ahead of the edge, each of which is stretched evenly
        for end, part in (-HALF_LENGTH, left), (HALF_LENGTH, ~left):
            inside = Basis(mesh, ElementTriP2(), intorder=4, elements=np.flatnonzero(part))
            facets = mesh.facets_satisfying(lambda x, end=end: np.abs(x[0] - end) < 1e-9)
            forms = (MASS, CARRIED, CARRIED_TWICE, ALONG, ACROSS)
            pull = PULL.assemble(FacetBasis(mesh, ElementTriP2(), facets=facets, intorder=4))
            self.halves.append([*(form.assemble(inside).tocsr() for form in forms), pull.tocsr()])
        self.x, self.y = self.basis.doflocs
        self.whole = (self.y < 1e-12) & (self.x > -1e-12)
        self.free = ~self.whole & (self.y < WIDTH - 1e-9) & (np.abs(self.x) < HALF_LENGTH - 1e-9)

    def places(self, time):
        """Give x of the points of the mesh at a time."""
        return self.x + self.speed * time * (1.0 - np.abs(self.x) / HALF_LENGTH)

    def given(self, time):
        """Give the exact U, and U' = u' + v q du/dx = u' (1 - q), which is 0 at the edge."""
        u, velocity = exact(self.places(time), self.y, time, self.speed)
        rate = np.where(self.whole, 0.0, velocity) * np.abs(self.x) / HALF_LENGTH
        return np.where(self.whole, 0.0, u), rate

    def matrices(self, time):
        """Assemble M, C, N, K, and the matrix of the forces at the ends."""
        found = [0.0] * 5
        way = self.speed * time / HALF_LENGTH
        for stretch, half in zip((1.0 + way, 1.0 - way), self.halves, strict=True):
            mass, carried, twice, along, across, pull = half
            terms = (
                stretch * mass,
                self.speed * carried,
                self.speed**2 / stretch * twice,
                along / stretch + stretch * across,
                pull / stretch,
            )
            found = [total + term for total, term in zip(found, terms, strict=True)]
        return found

    def solved(self, matrix, right, held):
        """Solve at free nodes, with values held at the others."""
        free, found = self.free, np.where(self.free, 0.0, held)
        rest = (right - matrix @ found)[free]
        found[free] = splu(matrix.tocsr()[free][:, free].tocsc()).solve(rest)
        return found

    def energy(self, time, u, rate):
        """Sum kinetic and strain energy."""
        mass, carried, twice, stiffness, _ = self.matrices(time)
        return 0.5 * (rate @ (mass @ rate) + u @ ((twice + stiffness) @ u)) - rate @ (carried @ u)


def motion(speed, n):
    """Return the strip, U at the end, and the energy that the blade has taken from the half."""
    strip, count = Strip(speed, n), round(STEPS * n)
    h = END / count
    u, rate = strip.given(0.0)
    mass, carried, *_ = strip.matrices(0.0)
    p = mass @ rate - carried @ u
    taken = strip.energy(0.0, u, rate)
    for k in range(count):
        mass, carried, twice, stiffness, pull = strip.matrices((k + 0.5) * h)
        spring = stiffness - twice
        system = mass + 0.5 * h * (carried.T - carried) + 0.25 * h**2 * spring
        held = (strip.given((k + 1) * h)[0] - u) / h
        rate = strip.solved(system, p - 0.5 * h * (spring @ u) + carried @ u, held)
        middle = u + 0.5 * h * rate
        taken += h * rate @ (pull @ middle)  # the work of the supports
        p -= h * (carried.T @ rate + spring @ middle)
        u = u + h * rate
    mass, carried, *_ = strip.matrices(END)
    rate = strip.solved(mass, p + carried @ u, strip.given(END)[1])
    return strip, u, taken - strip.energy(END, u, rate)


def outputs(speed, n):
    """Opening behind the blade, K_III of the jump behind it, energy taken per area swept."""
    strip, u, taken = motion(speed, n)
    way, g = speed * END, np.sqrt(1.0 - speed**2)
    at = (PLACE - way) / (1.0 + way / HALF_LENGTH)  # X of the place
    distance = way - strip.places(END)
    near = (strip.y < 1e-12) & (distance > 0.02 * WIDTH) & (distance < 0.5 * WIDTH)
    root = np.sqrt(distance[near])
    fit = np.linalg.lstsq(np.stack([root, root**3, root**5], axis=1), u[near], rcond=None)[0]
    return {
        "opening_behind": 2.0 * (strip.basis.probes(np.array([[at], [0.0]])) @ u)[0],
        "K_III": SHEAR * g * fit[0] * np.sqrt(np.pi / 2.0),
        "energy_taken": 2.0 * taken / way,
    }


def second_route(speed):
    """Give {quantity: (value, half-width)}: of 18 elements across; the largest change from 8 on.

    Elements and steps are refined alike. Waves go to and fro undamped: no order is observed.
    """
    found = [outputs(speed, n) for n in (8, 12, 18)]
    columns = {name: [one[name] for one in found] for name in found[0]}
    return {name: (c[-1], np.abs(np.diff(c)).max()) for name, c in columns.items()}


if __name__ == "__main__":
    speed = float(sys.argv[1])
    for elements in map(int, sys.argv[2:] or ["8", "12", "18"]):
        found = outputs(speed, elements)
        print(speed, elements, *(f"{name} {value:.9g}" for name, value in found.items()))

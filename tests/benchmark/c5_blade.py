"""C5, second route: half of the strip, quadratic triangles on a mesh of its own, TR-BDF2.

Made from docs/benchmark/c5.md alone, with numpy, scipy and scikit-fem.
`python c5_blade.py 0.3 16 32` prints the outputs of the page at 0.3 of the shear wave's speed, with
16 and 32 elements across.
"""

import sys

import numpy as np
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTriP2, MeshTri
from skfem.helpers import dot, grad

HALF_LENGTH, WIDTH, GRIP = 0.3, 0.1, 0.006
SHEAR, DENSITY, END = 1000.0, 1000.0, 0.2  # c = 1 m/s
PLACE = -0.1  # of the opening
STEPS = 8  # per element along the cut
GAMMA = 2.0 - np.sqrt(2.0)  # inner time of a step (Bank et al. 1985)


@BilinearForm
def stiffness(u, v, _):
    """Antiplane shear."""
    return SHEAR * dot(grad(u), grad(v))


@BilinearForm
def mass(u, v, _):
    """Consistent mass."""
    return DENSITY * u * v


def exact(x, y, time, speed):
    """Displacement u_z of the upper half, and its velocity."""
    g = np.sqrt(1.0 - speed**2)
    s = np.exp(np.pi * ((x - speed * time) / g + 1j * y) / (2 * WIDTH))
    u = GRIP * (1.0 - 2.0 / np.pi * np.arcsin(s).real)
    with np.errstate(divide="ignore", invalid="ignore"):  # at the edge of the blade
        slope = -GRIP / WIDTH * s / (np.sqrt(1.0 - s) * np.sqrt(1.0 + s))
    return u, -speed * slope.real / g


def motion(speed, n):
    """Return x from the edge and half the jump behind it at the end, and what is taken per area."""
    element = WIDTH / n
    rows = np.linspace(0.0, WIDTH, n + 1)
    # an end of elements at the edge at t = 0, and at the place of the opening
    columns = np.linspace(-HALF_LENGTH, HALF_LENGTH, 6 * n + 1)
    basis = Basis(MeshTri.init_tensor(columns, rows), ElementTriP2(), intorder=4)
    K, M = stiffness.assemble(basis).tocsr(), mass.assemble(basis).tocsr()
    x, y = basis.doflocs
    path = np.flatnonzero(y < 1e-9)
    path = path[np.argsort(x[path])]
    nodes = np.arange(len(path))
    fixed = (y > WIDTH - 1e-9) | (np.abs(x) > HALF_LENGTH - 1e-9)
    tied = x[path] > 1e-9 * WIDTH
    tied[fixed[path]] = False
    offset = HALF_LENGTH / element  # elements from the left end to x = 0
    u, v = exact(x, y, 0.0, speed)
    u[path[x[path] >= 0.0]] = 0.0
    v = np.where(np.isfinite(v), v, 0.0)
    v[path[x[path] >= -1e-9]] = 0.0
    forces = np.zeros(len(path))
    count = round(END * speed / element * STEPS)
    step = END / count
    h = 0.5 * GAMMA * step

    def prescribed(time):
        return exact(x[fixed], y[fixed], time, speed)[0]

    def unswept(way):
        first = nodes // 2
        rising, falling = np.clip(way - first + 1, 0, 1), np.clip(way - first, 0, 1)
        left = 0.5 * (1 - rising**2) + 0.5 * (1 - falling) ** 2
        return np.where(nodes % 2, 1 - falling, left)

    def load(way):
        f = np.zeros(len(u))
        f[path] = forces * unswept(way)
        return f

    def corrected(guess, guess_v, f, time, now):
        solve, free, tied = now
        new = np.where(fixed, 0.0, guess)
        new[fixed] = prescribed(time)
        new[path[tied]] = 0.0
        acceleration = (new - guess) / h**2
        right = f - K @ new - M @ np.where(free, 0.0, acceleration)
        acceleration[free] = solve(right[free])
        return guess + h**2 * acceleration, guess_v + h * acceleration, acceleration

    free, solve, work = None, None, 0.0
    a = np.zeros(len(u))
    for k in range(count + 1):
        ways = offset + speed * step * (k + np.array([0.0, GAMMA, 1.0])) / element
        element_now = int(np.floor(ways[0] + 1e-9))
        due = tied & (nodes <= 2 * element_now + 2)
        if free is None or due.any():
            if free is None:  # the acceleration that belongs to the start
                free = ~fixed
                free[path[tied]] = False
                a[free] = splu(M[free][:, free].tocsc()).solve(-(K @ u)[free])
            held = M @ a + K @ u - load(ways[0])
            forces[due] = held[path[due]]
            tied &= ~due
            free = ~fixed
            free[path[tied]] = False
            solve = splu((M + h**2 * K)[free][:, free].tocsc()).solve
        if k == count:
            break
        times = step * (k + np.array([GAMMA, 1.0]))
        loads, now = [load(way) for way in ways], (solve, free, tied)

        guess_v = v + h * a
        inner, inner_v, _ = corrected(u + h * v + h * guess_v, guess_v, loads[1], times[0], now)
        guess_v = (inner_v - (1 - GAMMA) ** 2 * v) / (GAMMA * (2 - GAMMA))
        guess = (inner - (1 - GAMMA) ** 2 * u) / (GAMMA * (2 - GAMMA)) + h * guess_v
        new, v, a = corrected(guess, guess_v, loads[2], times[1], now)
        work -= 0.5 * ((loads[0] + loads[1]) @ (inner - u) + (loads[1] + loads[2]) @ (new - inner))
        u = new
    behind = path[x[path] < speed * END - 1e-9]
    return x[behind] - speed * END, u[behind], 2.0 * work / (speed * END)


def outputs(speed, n):
    """Opening behind the blade, K_III of the jump behind it, energy taken per advance."""
    x, u, taken = motion(speed, n)
    g = np.sqrt(1.0 - speed**2)
    at = np.argmin(np.abs(x + speed * END - PLACE))
    near = (x < -0.2 * WIDTH) & (x > -0.8 * WIDTH)
    root = np.sqrt(-x[near])
    fit = np.linalg.lstsq(np.stack([root, root**3, root**5], axis=1), u[near], rcond=None)[0]
    return {
        "opening_behind": 2.0 * u[at],
        "K_III": SHEAR * g * fit[0] * np.sqrt(np.pi / 2.0),
        "energy_taken": taken,
    }


def second_route(speed):
    """Give {quantity: (value, half-width)}: of 40 elements across; the largest change from 10 on.

    Waves that the coarse meshes make go to and fro: no order is observed.
    """
    found = [outputs(speed, n)["opening_behind"] for n in (10, 20, 40)]
    return {"opening_behind": (found[-1], np.abs(np.diff(found)).max())}


if __name__ == "__main__":
    speed = float(sys.argv[1])
    for elements in map(int, sys.argv[2:] or ["16", "32"]):
        found = outputs(speed, elements)
        print(speed, elements, *(f"{name} {value:.7g}" for name, value in found.items()))

"""Half of the antiplane strip with a blade, by a program of its own, under any rule of release.

|x| < 3, 0 < y < 1, b = w₀ = μ = ρ = 1: c = 1, and G = ½ of the half model. Linear triangles on
squares of 1/n. Nodes of y = 0 are held at 0 ahead of the tip. A rule releases a node at x when the
tip is at x + begin·h. Its reaction, inertia included, falls to zero until x + end·h.

``python tests/study/strip_rules.py docs/images/opening-rules.svg`` draws φ, the work of the
reactions over G, against the speed (16 elements across; a quarter of a minute).
"""

import sys
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

REACH, DURATION, TIP = 3.0, 2.0, 0.0137


def _line(at):
    return at


def _hat(at):
    """Integral of the shape function of a node from −1 to 2 at − 1."""
    return np.where(at < 0.5, 2.0 * at**2, 1.0 - 2.0 * (1.0 - at) ** 2)


# begin, end (in elements) and the share that is gone in between
RULES = {
    "late": (1.0, 1.0, _line),
    "centroid": (0.5, 0.5, _line),
    "node": (0.0, 0.0, _line),
    "ramp behind": (0.0, 1.0, _line),
    "swept": (-1.0, 1.0, _hat),
    "centred, 2 elements": (-1.0, 1.0, _line),
    "centred, 4 elements": (-2.0, 2.0, _line),
    "centred, √h": (-1.0, 1.0, _line),  # two elements at n = 8
}


@dataclass(frozen=True)
class Outcome:
    """Relative errors, kinetic energy and its exact value, work of the reactions over G."""

    displacement: float
    velocity: float  # farther than 0.15 from the tip
    kinetic: float
    exact_kinetic: float
    taken: float


class Strip:
    """Mesh, matrices and exact field of n elements across, at a speed v."""

    def __init__(self, n, v):
        self.n, self.v, self.h = n, v, 1.0 / n
        wide = int(2 * REACH * n)
        x, y = np.linspace(-REACH, REACH, wide + 1), np.linspace(0.0, 1.0, n + 1)
        self.points = np.array([(a, b) for b in y for a in x])
        row = np.arange(n)[:, None] * (wide + 1) + np.arange(wide)
        a = row.ravel()
        b, c, d = a + 1, a + wide + 2, a + wide + 1
        cells = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
        corners = self.points[cells]
        across = corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]]
        slopes = np.stack([across[..., 1], -across[..., 0]], axis=2) / self.h**2
        area = 0.5 * self.h**2
        size = len(self.points)

        def assembled(blocks):
            rows, columns = np.repeat(cells, 3, axis=1), np.tile(cells, 3)
            entries = (blocks.ravel(), (rows.ravel(), columns.ravel()))
            return csr_array(entries, shape=(size, size))

        self.stiffness = assembled(area * slopes @ slopes.swapaxes(1, 2))
        one = area / 12.0 * (np.ones((3, 3)) + np.eye(3))
        self.mass = assembled(np.broadcast_to(one, (len(cells), 3, 3)))
        self.lumped = np.asarray(self.mass.sum(axis=1)).ravel()
        self.front = np.arange(wide + 1)
        self.edge = (np.abs(self.points[:, 0]) > REACH - 1e-9) | (self.points[:, 1] > 1 - 1e-9)

    def exact(self, time):
        """Displacement and velocity at a time; zero velocity at the tip itself."""
        g = np.sqrt(1.0 - self.v**2)
        s = np.exp(0.5 * np.pi * ((self.points[:, 0] - TIP - self.v * time) / g
                                  + 1j * self.points[:, 1]))  # fmt: skip
        s = np.where(self.points[:, 1] == 0.0, s.real + 0j, s)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = -s / (np.sqrt(1.0 - s) * np.sqrt(1.0 + s))
        velocity = -self.v * slope.real / g
        u = 1.0 - 2.0 / np.pi * np.arcsin(s).real
        return u, np.where(np.isfinite(velocity), velocity, 0.0)


def solve(strip, rule, lumped):
    """March to the end, by central differences if lumped, else by the trapezoidal rule."""
    begin, end, gone = RULES[rule]
    if "√" in rule:
        begin, end = (side * np.sqrt(strip.n / 8) for side in (begin, end))
    h, v, front, edge = strip.h, strip.v, strip.front, strip.edge
    ahead = strip.points[front, 0]
    steps = int(np.ceil(DURATION / ((0.4 if lumped else 0.5) * h)))
    dt = DURATION / steps
    weigh = (lambda a: strip.lumped * a) if lumped else (lambda a: strip.mass @ a)

    def left(tip):
        at = (tip - ahead - begin * h) / max((end - begin) * h, 1e-300)
        return 1.0 - gone(np.clip(at, 0.0, 1.0))

    u, velocity = strip.exact(0.0)
    tied = (ahead + begin * h > TIP) & ~edge[front]
    u[front[tied]] = velocity[front[tied]] = 0.0
    reaction = np.where(~tied & ~edge[front], (strip.stiffness @ u)[front], 0.0)
    work, a, factor = 0.0, None, None
    for step in range(steps):
        time = step * dt
        tip = TIP + v * time
        new = tied & (tip >= ahead + begin * h)
        if step == 0 or new.any():
            if new.any():
                held = (strip.stiffness @ u + weigh(a))[front][new]
                share = left(tip)[new]
                reaction[new] = np.where(share > 0.0, held / np.where(share > 0, share, 1.0), 0.0)
                tied = tied & ~new
            free = ~edge
            free[front[tied]] = False
            matrix = strip.mass * (4.0 / dt**2) + strip.stiffness
            rows = np.flatnonzero(free)
            if not lumped:
                factor = splu(matrix[rows][:, rows].tocsc())
                inertia = splu(strip.mass[rows][:, rows].tocsc())
            force = np.zeros(len(u))
            force[front] = reaction * left(tip)
            force -= strip.stiffness @ u
            a = np.zeros(len(u))
            a[rows] = force[rows] / strip.lumped[rows] if lumped else inertia.solve(force[rows])
        pulls = [reaction * left(at) for at in (tip, tip + v * dt)]
        prescribed, speed = strip.exact(time + dt)
        before = u.copy()
        if lumped:
            middle = velocity + 0.5 * dt * a
            u = u + dt * middle
            u[edge], u[front[tied]] = prescribed[edge], 0.0
            force = -(strip.stiffness @ u)
            force[front] += pulls[1]
            a = np.where(free, force / strip.lumped, 0.0)
            velocity = middle + 0.5 * dt * a
        else:
            right = strip.mass @ (4.0 / dt**2 * (u + dt * velocity) + a)
            right[front] += pulls[1]
            u = np.zeros(len(u))
            u[edge] = prescribed[edge]
            u[rows] = factor.solve((right - matrix @ u)[rows])
            after = 4.0 / dt**2 * (u - before - dt * velocity) - a
            velocity = velocity + 0.5 * dt * (a + after)
            a = after
        velocity[edge], velocity[front[tied]] = speed[edge], 0.0
        work -= 0.5 * float((pulls[0] + pulls[1]) @ (u - before)[front])
    return _judged(strip, u, velocity, float(velocity @ weigh(velocity)) / 2, work)


def _judged(strip, u, velocity, kinetic, work):
    true, rate = strip.exact(DURATION)
    x, y = strip.points.T
    far = strip.lumped * (np.hypot(x - TIP - strip.v * DURATION, y) > 0.15)
    of_both = ((strip.lumped, u, true), (far, velocity, rate))
    off = [weight @ (found - exact) ** 2 / (weight @ exact**2) for weight, found, exact in of_both]
    exact_kinetic = 0.5 * float(strip.lumped @ rate**2)
    return Outcome(*np.sqrt(off), kinetic, exact_kinetic, work / (0.5 * strip.v * DURATION))


def draw(path, n=16, speeds=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)):
    """Draw φ of the rules with a force against the speed, for both masses."""
    import matplotlib.pyplot as plt

    plt.rcParams["svg.hashsalt"] = "opening rules"
    figure, panels = plt.subplots(1, 2, figsize=(8, 3.2), sharey=True, layout="constrained")
    strips = [Strip(n, v) for v in speeds]
    for panel, lumped in zip(panels, (True, False), strict=True):
        panel.axhspan(0.95, 1.05, color="0.9")
        for rule in ("swept", "ramp behind", "centred, 4 elements", "late"):
            taken = [solve(strip, rule, lumped).taken for strip in strips]
            panel.plot(speeds, taken, "o-", ms=3, label=rule)
            print("lumped" if lumped else "consistent", rule, np.round(taken, 3))
        panel.set_title("lumped mass" if lumped else "consistent mass", fontsize=10)
        panel.set_xlabel("v/c")
    panels[0].set_ylabel("φ = work of the forces / G")
    panels[1].legend(fontsize=8, loc="lower left")
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    draw(sys.argv[1])

"""Scene C6 (hanging block), set up by a reader of its page alone; kept as it was written."""

# ruff: noqa
# fmt: off
#
# Space:  biquadratic quadrilaterals (Q2), n columns of equal width; the path is a mesh line. The part below and the part
#         above are two meshes, n/2 rows each; the nodes on the path are doubled (twins), tied by multipliers.
# Time:   SDIRK of order 3 (Alexander; L-stable, stiffly accurate). m steps for each element of the path, so that the edge is
#         at a vertex of the path at the ends of steps. Before the edge enters (3.679 ms) nothing moves: the start is there.
#         Every stage has the matrix A = M + (g dt)^2 K of the two parts apart, factored once; ties by the Schur complement
#         G = B A^-1 B^T of all twins, of which the still tied (a trailing block) is solved.
# Blade:  the page's rule. The vertex i is tied until the edge enters the path's element before it, a mid node until the edge
#         enters its own; r, the multiplier at that moment, is then kept with the factor 1 - s(t).
# Values: n = 16, 32, 64 and an extrapolation with order 1 (moving end of cut on a uniform mesh); error: the difference of
#         the extrapolations of the two pairs. All decided before the first run.
import sys
import time
import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from skfem import MeshQuad, ElementQuad2, ElementVector, Basis, BilinearForm, LinearForm
from skfem.helpers import sym_grad, ddot, trace as tr, dot

L, RHO, E, NU, GRAV, TEND = 0.08, 1000.0, 60000.0, 0.3, 9.8, 0.12
MU, LAM = E / 2 / (1 + NU), E * NU / (1 + NU) / (1 - 2 * NU)
SPEED, T0, P = 1.5, 0.003, np.array([-0.01, 0.037])
LEN = np.hypot(0.1, 0.0062)
D, N = np.array([0.1, 0.0062]) / LEN, np.array([-0.0062, 0.1]) / LEN
T_IN, T_OUT = (-P[0] / D[0]) / SPEED - T0, ((L - P[0]) / D[0]) / SPEED - T0
NAMES = ['opening_1', 'opening_2', 'opening_3', 'fall_left', 'fall_right', 'momentum_below', '(taken, J)', '(lost, J)']
PAGE = {'opening_1': ((0.00049702, 6.8e-7), (0.0004935, 4.2e-6)),
        'opening_2': ((0.0022854, 5.0e-6), (0.0022788, 9.7e-6)),
        'opening_3': ((0.0067967, 4.4e-6), (0.006777, 2.8e-5)),
        'fall_left': ((-0.0439533, 8.6e-6), (-0.043951, 6.9e-5)),
        'fall_right': ((-0.028437, 4.3e-5), (-0.028422, 6.4e-5)),
        'momentum_below': ((-2.6376, 3.2e-3), (-2.6373, 2.6e-3)),
        '(taken, J)': ((0.0238, 5e-5),), '(lost, J)': ((0.0238, 5e-5),)}  # the page states it in its text


def path_y(x):
    return P[1] + (x - P[0]) * D[1] / D[0]


@BilinearForm
def stiffness(u, v, w):
    e, d = sym_grad(u), sym_grad(v)
    return LAM * tr(e) * tr(d) + 2 * MU * ddot(e, d)


@BilinearForm
def mass(u, v, w):
    return RHO * dot(u, v)


@LinearForm
def weight(v, w):
    return -RHO * GRAV * v[1]


class Part:
    """One side of the path: mesh, matrices on its free unknowns, its nodes on the path in the order of x."""

    def __init__(self, n, above):
        m = MeshQuad.init_tensor(np.linspace(0, L, n + 1), np.linspace(0, 1, n // 2 + 1))
        x, q = m.p
        y = path_y(x) + q * (L - path_y(x)) if above else q * path_y(x)
        self.basis = b = Basis(MeshQuad(np.array([x, y]), m.t), ElementVector(ElementQuad2()), intorder=5)
        self.K, self.M, self.f = stiffness.assemble(b).tocsr(), mass.assemble(b).tocsr(), weight.assemble(b)
        X = b.doflocs
        self.free = np.flatnonzero(X[1] < L - 1e-9)
        comp = np.zeros(b.N, dtype=int)                     # component of each unknown: from the vector (0, 1)
        comp[b.get_dofs(elements=np.arange(b.mesh.nelements)).all(['u^2', 'u^2'])] = 1
        on = np.flatnonzero(abs(X[1] - path_y(X[0])) < 1e-9)
        self.path = np.array([on[comp[on] == c][np.argsort(X[0, on[comp[on] == c]])] for c in (0, 1)])  # 2 x (2n+1)
        self.ones_y = (comp == 1).astype(float)
        num = np.full(b.N, -1)
        num[self.free] = np.arange(len(self.free))
        self.path = num[self.path]
        assert (self.path >= 0).all() and self.path.shape == (2, 2 * n + 1)
        self.P_y = (self.M @ self.ones_y)[self.free]        # vertical momentum
        self.K, self.M = (A[self.free][:, self.free].tocsr() for A in (self.K, self.M))
        self.f = self.f[self.free]

    def probe(self, pts):
        rows = self.basis.probes(np.array(pts).T).tocsr()
        rows = rows[np.flatnonzero(abs(rows @ self.ones_y - 1) < 1e-9)]  # the ones of u_y, in the order of the points
        assert np.allclose(rows @ (self.ones_y * self.basis.doflocs[0]), np.array(pts)[:, 0])
        return rows[:, self.free]


def passed_share(k, n, sigma):
    """Share s of node k (0 .. 2n along the path; odd: mid node) for the edge at sigma, measured in elements."""
    if k % 2:
        return np.clip(sigma - (k - 1) / 2, 0, 1)
    i = k // 2
    lo, hi = (np.clip(sigma - (i - 1), 0, 1) if i > 0 else 1.0), (np.clip(sigma - i, 0, 1) if i < n else 0.0)
    before = 0.5 * lo ** 2 if i > 0 else 0.0                 # integral of the rising half of the hat
    after = hi - 0.5 * hi ** 2                               # and of the falling
    return (before + after) / (0.5 * (i > 0) + 0.5 * (i < n))


def run(n, m, delay=0.0):
    lo, up = Part(n, False), Part(n, True)
    nl, nu, k = len(lo.free), len(up.free), 2 * n + 1
    K, M = sp.block_diag([lo.K, up.K]).tocsr(), sp.block_diag([lo.M, up.M]).tocsr()
    f = np.r_[lo.f, up.f]
    il, iu = lo.path.T.ravel(), up.path.T.ravel() + nl      # node by node: x, y
    begin = np.array([(j - 1) / 2 if j % 2 else max(j / 2 - 1, 0) for j in range(k)])  # edge at which r is taken
    # statics: whole block, the twins tied (upper unknowns of the path replaced by the lower)
    col = np.arange(nl + nu)
    col[iu] = il
    used, col = np.unique(col, return_inverse=True)
    T = sp.csr_matrix((np.ones(nl + nu), (np.arange(nl + nu), col)))
    u = T @ spl.spsolve((T.T @ K @ T).tocsc(), T.T @ f)
    v = np.zeros_like(u)
    r = (K @ u - f)[il]                                      # force on the lower twins; -r on the upper
    # SDIRK, order 3
    g = 0.43586652150845967
    c2 = (1 + g) / 2
    b1, b2 = -(6 * g * g - 16 * g + 1) / 4, (6 * g * g - 20 * g + 5) / 4
    a, c = np.array([[g, 0, 0], [c2 - g, g, 0], [b1, b2, g]]), np.array([g, c2, 1.0])
    h = (T_OUT - T_IN) / n / m
    lus = [spl.splu((p.M + (g * h) ** 2 * p.K).tocsc(), permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0,
                    options=dict(SymmetricMode=True)) for p in (lo, up)]

    def solve(w):
        return np.concatenate([lus[0].solve(w[:nl]), lus[1].solve(w[nl:])])

    Y = [np.empty((2 * k, s)) for s in (nl, nu)]             # rows: A^-1 applied to a unit force at each twin
    for j in range(2 * k):
        for Z, lu, i, s in ((Y[0], lus[0], il[j], nl), (Y[1], lus[1], iu[j] - nl, nu)):
            e = np.zeros(s)
            e[i] = 1
            Z[j] = lu.solve(e)
    G = Y[0][:, il] + Y[1][:, iu - nl]
    points = lo.probe([(0.01, 0.01), (0.07, 0.01)])
    j0 = 2 * int(round(0.01 / L * n))                        # the node of the path at x = 0.01
    assert abs(0.01 / L * n - j0 // 2) < 1e-12

    def gap(w):
        return np.array([(w[iu] - w[il])[2 * j0:2 * j0 + 2] @ N])

    def energy():
        return 0.5 * u @ (K @ u) + 0.5 * v @ (M @ v) - f @ u

    wanted = [(0.02, gap), (0.04, gap), (0.06, gap),
              (TEND, lambda w: points @ w[:nl])]
    out, e0, step, t, order_of = [], energy(), 0, T_IN, np.argsort(begin, kind='stable')
    reach = begin[order_of]
    work = 0.0                                               # what the fading forces take
    lam = r.copy()                                           # multipliers of all twins at the end of the last step
    held, tied_was, cho = np.zeros_like(r), np.ones(k, dtype=bool), None
    while t < TEND:
        sigma0 = step / m - delay                            # in elements of the path; delay: see the end
        rel = np.zeros(k, dtype=bool)
        rel[order_of[reach <= sigma0 + 1e-9]] = True
        new = rel & tied_was
        for j in np.flatnonzero(new):
            held[2 * j:2 * j + 2] = lam[2 * j:2 * j + 2]
        tied_was = ~rel
        tied = np.flatnonzero(np.repeat(~rel, 2))
        first = tied[0] if len(tied) else 2 * k              # tied unknowns are a trailing block
        assert len(tied) == 2 * k - first
        if (new.any() or cho is None) and len(tied):
            cho = sla.cho_factor(G[first:, first:])
        acc, vel = [], []
        for s in range(3):
            us = u + h * sum((a[s, q] * vel[q] for q in range(s)), np.zeros_like(u))
            vs = v + h * sum((a[s, q] * acc[q] for q in range(s)), np.zeros_like(u))
            edge = sigma0 + c[s] / m
            lam = np.zeros(2 * k)
            for j in np.flatnonzero(rel):
                if edge < j / 2 + 1:
                    lam[2 * j:2 * j + 2] = held[2 * j:2 * j + 2] * (1 - passed_share(j, n, edge))
            rhs = f - K @ (us + g * h * vs)
            rhs[il[:first]] += lam[:first]
            rhs[iu[:first]] -= lam[:first]
            w = solve(rhs)
            if len(tied):
                lam[first:] = sla.cho_solve(cho, (w[iu] - w[il])[first:])
                w[:nl] += lam[first:] @ Y[0][first:]
                w[nl:] -= lam[first:] @ Y[1][first:]
            acc.append(w)
            vel.append(vs + g * h * w)
            work += h * a[2, s] * (lam[:first] @ (vel[-1][iu] - vel[-1][il])[:first])
        u_old, v_old = u, v
        u = us + g * h * vel[-1]
        v = vel[-1]
        t_old, t, step = t, T_IN + (step + 1) * h, step + 1
        for tt, fun in wanted:                               # cubic Hermite between the ends of the step
            if t_old < tt <= t:
                z = (tt - t_old) / h
                ui = ((1 + 2 * z) * (1 - z) ** 2 * u_old + z * (1 - z) ** 2 * h * v_old
                      + z * z * (3 - 2 * z) * u + z * z * (z - 1) * h * v)
                out.extend(fun(ui))
                if tt == TEND:                               # momentum is linear in t once the part is free
                    out.append(lo.P_y @ ((1 - z) * v_old[:nl] + z * v[:nl]))
    out += [work, e0 - energy()]
    return np.array(out)


if __name__ == '__main__':
    start = time.time()
    levels = [int(q) for q in sys.argv[1].split(',')] if len(sys.argv) > 1 else [16, 32, 64]
    m = int(sys.argv[2]) if len(sys.argv) > 2 else 8
    print(f'edge enters at {1e3 * T_IN:.3f} ms, leaves at {1e3 * T_OUT:.3f} ms; {m} steps for each element of the path')
    res = []
    for n in levels:
        t1 = time.time()
        res.append(run(n, m))
        print(f'n = {n}: step {(T_OUT - T_IN) / n / m * 1e3:.3f} ms, {time.time() - t1:.0f} s', flush=True)
    res = np.array(res)
    print(f'{"":15s}' + ''.join(f'{"n = %d" % n:>13s}' for n in levels) + '  extrapolated   error    | page')
    for i, name in enumerate(NAMES):
        y, line = res[:, i], f'{name:15s}' + ''.join(f'{z:13.6g}' for z in res[:, i])
        if len(levels) > 2:
            ex = [(levels[q + 1] * y[q + 1] - levels[q] * y[q]) / (levels[q + 1] - levels[q]) for q in (-3, -2)]
            err = abs(ex[1] - ex[0])
            rate = np.log2(abs((y[-2] - y[-3]) / (y[-1] - y[-2])))
            line += f'{ex[1]:13.6g} {err:9.1e} |'
            for val, half in PAGE[name]:
                line += f' {val:.6g} +- {half:.1e} {"agree" if abs(val - ex[1]) <= err + half else "DIFFER"};'
            line += f' order seen {rate:.1f}'
        print(line)
    print(f'{time.time() - start:.0f} s in all, {time.process_time():.0f} s of the processor')

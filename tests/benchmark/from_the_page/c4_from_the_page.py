"""Scene C4 (disc), set up by a reader of its page alone; kept as it was written.

``python c4_from_the_page.py 4 6 8``
"""

# ruff: noqa
# fmt: off
#
# Mesh. A body with a round crack has the topology of a spherical shell: its inner sphere is the crack (upper half: the face
# z = 0+, lower half: z = 0-, equator: the front), its outer sphere is the border of the cube. The shell is meshed by a "cubed
# sphere": 2 patches of n x n cells, 4 at the side of n x 2n. n inner layers of hexahedra follow the oblate spheroids
#     (x, y, z) = (cosh(eta) d_x, cosh(eta) d_y, sinh(eta) d_z),   d on the unit sphere, 0 <= eta <= 0.8,
# in the axes of the disc (turned about n so that the stations are nodes); n/2 outer layers go straight from the last
# spheroid to the cube, which twists them by the tilt of the disc. Close to the front this map is the complex square, so a
# displacement sqrt(r) f(angle) is of degree 1 in (eta, latitude): Lipschitz, and quadratic isoparametric hexahedra (27 nodes)
# have "nodes at quarters" there. Except for mode III it is no polynomial, so cells are graded towards the front, eta and
# latitude like (k/n)^2: the energy of the error of the cells at the front is then O(h^4), as elsewhere.
#
# Solution. Galerkin, displacement of the page at the border's nodes, pressure on both faces; 4^3 Gauss points, 8^3 in cells
# at the front (the Jacobian vanishes on the front); conjugate gradients, preconditioned by the nodes' 3 x 3 blocks.
#
# Outputs. Energy by quadrature; opening from the two nodes at c; factors from the jump of the displacement
#     K = E sqrt(2 pi/d) / (8 (1 - nu^2)) * jump  (I: n, II: a),   K_III = E sqrt(2 pi/d) / (8 (1 + nu)) * jump_t
# at the corners of cells inward of the station, d from the front, from 1/4 of the patch's latitude to the whole of it (on
# every mesh), extrapolated to d = 0 by a parabola in d, least squares. No use is made of the form (ellipsoid) of the jump.
#
# Error, decided beforehand: h = 1/n, the last value v of the meshes against the two before it as if of order 2 only,
#     max over the two of |v - v_k| / ((h_k/h)^2 - 1).
#
import sys
import time

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, cg
from skfem import CellBasis, ElementHex2, MeshHex, MeshHex2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefQuad

# ---------------------------------------------------------------- the page
E, NU, P = 1.0, 0.3, 0.5
MU, LAM = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
C = np.array([0.07, -0.04, 0.03])
NRM = np.array([0.36, -0.48, 0.8])
E1, E2 = np.array([-0.48, 0.64, 0.6]), np.array([-0.8, -0.6, 0.0])
AXES = np.array([E1, E2, NRM])                       # rows
N_, T_ = 0.64 + P, 0.48


def exact(X):
    """Displacement of the page at the places X (3, k), not for places on the disc or on its axis."""
    Y = X - C[:, None]
    x, y, z = AXES @ Y
    r2, s, az = x**2 + y**2, np.sign(z), abs(z)
    q = r2 + z**2 - 1
    zeta = np.sqrt((q + np.sqrt(q**2 + 4 * z**2)) / 2)
    m, al = az / zeta, np.arctan2(1.0, zeta)
    fz = -3 * m * (1 - zeta * al)
    F = -1.5 * (al - zeta / (1 + zeta**2))
    fzz = 3 * (al - zeta / (zeta**2 + m**2))
    G = 3 * m / ((1 + zeta**2) * (zeta**2 + m**2))
    H = -(2 * F + fzz) / r2
    B = 2 * N_ / (3 * np.pi * 2 * MU)
    Cc = 4 * T_ / (3 * np.pi * (2 - NU) * 2 * MU)
    S = B * ((1 - 2 * NU) * F + az * G)
    u1 = S * x + Cc * s * (-2 * (1 - NU) * fz + az * F + az * H * x**2)
    u2 = S * y + Cc * s * az * H * x * y
    un = s * B * (-2 * (1 - NU) * fz + az * fzz) + Cc * x * (-(1 - 2 * NU) * F + az * G)
    uniform = np.array([-NU * Y[0], -NU * Y[1], Y[2]]) / E
    return AXES.T @ np.array([u1, u2, un]) + uniform


def page_values():
    """name: (closed form, half-width of it, second route, half-width of it), copied from the table."""
    v = {"strain_energy": (33.6322461, 5e-8, 33.64, 0.11), "opening": (2.64171741, 5e-9, 2.6416, 0.0080)}
    c2 = [0.6372, 0.4505, -0.0001, -0.4507, -0.6372, -0.4505, 0.0001, 0.4507]
    c3 = [0.0001, 0.3155, 0.4461, 0.3153, -0.0001, -0.3155, -0.4461, -0.3153]
    k2 = [0.637202353, 0.450570105, 0, -0.450570105, -0.637202353, -0.450570105, 0, 0.450570105]
    k3 = [0, 0.315399073, 0.446041647, 0.315399073, 0, -0.315399073, -0.446041647, -0.315399073]
    for i in range(8):
        w = (0.0044, 0.0043, 0.0042, 0.0043)[i % 4]
        v[f"K_I_{45 * i}"] = (1.28635225, 5e-9, 1.2860, w)
        v[f"K_II_{45 * i}"] = (k2[i], 5e-9, c2[i], w)
        v[f"K_III_{45 * i}"] = (k3[i], 5e-9, c3[i], w)
    return v


# ---------------------------------------------------------------- the mesh
ETA1 = 0.8
# axes of the mesh: third n, first the station 225 deg. A turn about n by 8 deg only from the least rotation that takes the
# axis z of the cube to n; and the stations are then corners and middles of the four patches at the side.
Q = np.array([-(E1 + E2) / np.sqrt(2), (E1 - E2) / np.sqrt(2), NRM]).T
assert np.allclose(Q[:, 0] @ Q[:, 1], 0)
if np.linalg.det(Q) < 0:
    Q[:, 1] *= -1


def place(p):
    """From the shell of cubes 1 <= |p|_inf <= 2 (where the mesh is a lattice) to the body."""
    tau = abs(p).max(0)
    f = p / tau                                       # on the faces of the cube [-1, 1]^3
    d = np.tan(np.pi / 4 * f)                         # equal angles
    d /= np.linalg.norm(d, axis=0)
    tau = tau - 1
    eta = ETA1 * np.minimum(2 * tau, 1)
    w = np.maximum(2 * tau - 1, 0)
    inner = C[:, None] + Q @ (np.array([np.cosh(eta), np.cosh(eta), np.sinh(eta)]) * d)
    return (1 - w) * inner + w * 2 * f


def shell(n):
    """The lattice: 15 n^3 hexahedra of 27 nodes between the cubes |p|_inf = 1 and 2."""
    g = np.linspace(-1, 1, n + 1)
    gr = np.linspace(0, 1, n + 1)**2                  # graded towards the front
    lat, lay = np.r_[-gr[:0:-1], gr], np.r_[1 + gr / 2, np.linspace(1.5, 2, n // 2 + 1)[1:]]
    pts = []                                          # per patch: corner, coordinate, cell
    for axis in range(3):
        third = g if axis == 2 else lat               # at the sides the second direction below is z, the latitude
        i, j, k = (a.ravel() for a in np.meshgrid(range(n), range(third.size - 1), range(lay.size - 1), indexing="ij"))
        for side in (-1, 1):
            a = np.empty((8, 3, i.size))
            for c, o in enumerate(MeshHex.elem.refdom.p.T.astype(int)):
                t = lay[k + o[2]]
                a[c, axis], a[c, 1 if axis == 0 else 0], a[c, 1 if axis == 2 else 2] = \
                    side * t, g[i + o[0]] * t, third[j + o[1]] * t
            pts.append(a)
    flat = np.concatenate(pts, axis=2).transpose(0, 2, 1).reshape(-1, 3)
    _, first, inv = np.unique(np.round(flat * 1e7).astype(int), axis=0, return_index=True, return_inverse=True)
    return MeshHex2.from_mesh(MeshHex(flat[first].T.copy(), inv.reshape(8, -1)))


# ---------------------------------------------------------------- the solution
def cells(mesh, which, order, A):
    """Adds the stiffness of the cells `which` to the list A; u_a of node i has the number 3 i + a."""
    b = CellBasis(mesh, ElementHex2(), intorder=order, elements=which)
    g = np.array([b.basis[i][0].grad for i in range(27)])         # node, direction, cell, Gauss point
    g = g.transpose(2, 0, 1, 3).copy()                            # cell, node, direction, point
    ne, nq = g.shape[0], g.shape[3]
    f = g.reshape(ne, 81, nq)
    M = ((f * b.dx[:, None, :]) @ f.transpose(0, 2, 1)).reshape(ne, 27, 3, 27, 3)   # int d_a phi_i d_b phi_j
    K = LAM * M + MU * M.transpose(0, 1, 4, 3, 2)                 # lambda tr tr + mu grad^T
    tr = MU * np.einsum("eiaja->eij", M)
    for a in range(3):
        K[:, :, a, :, a] += tr
    dof = (3 * b.dofs.element_dofs[:, b.tind].T[:, :, None] + np.arange(3)).reshape(ne, 81)
    A.append((K.ravel(), np.repeat(dof, 81, axis=1).ravel().astype(np.int32), np.tile(dof, (1, 81)).ravel().astype(np.int32)))
    return b.dx.sum()


def solve(n):
    lat = shell(n)
    p = lat.doflocs                                   # lattice places of the nodes, in the order of the numbers
    x = place(p)
    mesh = MeshHex2(x, lat.t)
    nn = x.shape[1]
    top = abs(lat.p[:, lat.t]).max(0)                  # layers of the corners of the cells
    # cells at the front: those with an edge on the equator of the inner cube
    front = ((top < 1 + 1e-6) & (abs(lat.p[2, lat.t]) < 1e-6)).sum(0) == 2
    A = []
    vol = cells(mesh, np.flatnonzero(front), 15, A) + cells(mesh, np.flatnonzero(~front), 7, A)
    v, r, c = (np.concatenate(a) for a in zip(*A))
    A = None
    K = sp.coo_matrix((v, (r, c)), shape=(3 * nn, 3 * nn)).tocsr()
    del v, r, c
    # pressure on the faces: on the face + (below the body of z > 0) the traction is +p n, on the face - it is -p n
    # (the faces are the sides z = 0 of the reference cells of the innermost layer)
    load, area = np.zeros((nn, 3)), []
    X2, W2 = get_quadrature(RefQuad, 7)
    X3 = np.vstack([X2, 0 * X2[:1]])
    for side in (1, -1):
        which = np.flatnonzero((abs(lat.p[:, lat.t]).max(0).min(0) < 1 + 1e-6) & (side * lat.p[2, lat.t].mean(0) > 0))
        fb = CellBasis(mesh, ElementHex2(), quadrature=(X3, W2), elements=which)
        J = mesh.mapping().DF(X3, tind=which)
        ds = np.linalg.norm(np.cross(J[:, 0], J[:, 1], axis=0), axis=0) * W2
        w = np.array([(fb.basis[i][0].value * ds).sum(1) for i in range(27)])
        np.add.at(load, fb.dofs.element_dofs[:, which], (side * P * w)[:, :, None] * NRM)
        area.append(ds.sum())
    # border
    out = abs(p).max(0) > 2 - 1e-6
    assert np.allclose(abs(x[:, out]).max(0), 2)
    u = np.zeros((nn, 3))
    u[out] = exact(x[:, out]).T
    free = np.flatnonzero(np.repeat(~out, 3))
    rhs = (load.ravel() - K @ u.ravel())[free]
    Kf = K[free][:, free]
    # 3 x 3 blocks of the diagonal
    D = np.empty((free.size // 3, 3, 3))
    for a in range(3):
        for b in range(3):
            D[:, a, b] = Kf.diagonal(b - a)[min(a, b)::3]
    D = np.linalg.inv(D)
    pre = LinearOperator(Kf.shape, lambda y: np.einsum("iab,ib->ia", D, y.reshape(-1, 3)).ravel(), dtype=float)
    its = [0]
    sol, info = cg(Kf, rhs, rtol=1e-7, maxiter=5000, M=pre, callback=lambda _: its.__setitem__(0, its[0] + 1))
    assert info == 0
    u.ravel()[free] = sol
    u_ = u.ravel()
    res = {"strain_energy": 0.5 * u_ @ (K @ u_)}

    def node(y):                                      # the node at a lattice place
        dist = np.linalg.norm(p - np.array(y)[:, None], axis=0)
        assert dist.min() < 1e-6
        return dist.argmin()

    res["opening"] = (u[node([0, 0, 1])] - u[node([0, 0, -1])]) @ NRM
    # stations: angle 45 deg i; lattice places of the station on the equator of the shell's inner cube
    for i in range(8):
        th = np.deg2rad(45 * i)
        a = np.cos(th) * E1 + np.sin(th) * E2
        t = np.cross(a, NRM)
        xy = Q[:, :2].T @ a
        xy = np.round(xy / abs(xy).max(), 9)
        assert np.allclose(x[:, node([*xy, 0])], C + a)
        d, K3 = [], []
        for j in range(n // 2, n + 1):
            up, lo = node([*xy, (j / n)**2]), node([*xy, -(j / n)**2])
            jump = u[up] - u[lo]
            d.append(1 - (x[:, up] - C) @ a)
            fac = E * np.sqrt(2 * np.pi / d[-1]) / 8
            K3.append([fac / (1 - NU**2) * jump @ NRM, fac / (1 - NU**2) * jump @ a, fac / (1 + NU) * jump @ t])
        k = np.linalg.lstsq(np.vander(d, 3, increasing=True), np.array(K3), rcond=None)[0][0]
        for name, val in zip(("K_I", "K_II", "K_III"), k):
            res[f"{name}_{45 * i}"] = val
    info = f"n {n:2d}  cells {lat.t.shape[1]:6d}  unknowns {free.size:7d}  cg {its[0]:4d}  volume {vol:.6f}  disc {area[0]:.6f}"
    return res, info


if __name__ == "__main__":
    ns = [int(a) for a in sys.argv[1:]] or [4, 6, 8]
    start, R = time.time(), []
    for n in ns:
        res, info = solve(n)
        R.append(res)
        print(info, f" {time.time() - start:.0f} s", flush=True)
    print(f"\n{'output':14s}" + "".join(f"{'n = ' + str(n):>12s}" for n in ns)
          + f"{'my error':>10s} | {'closed form':>12s} {'off by':>9s} {'agree':>5s} | {'second route':>18s} {'agree':>5s}")
    for name, (cf, wc, sr, ws) in page_values().items():
        v = [r[name] for r in R]
        err = max([abs(v[-1] - v[-k]) / ((ns[-1] / ns[-k])**2 - 1) for k in (2, 3) if k <= len(v)])
        print(f"{name:14s}" + "".join(f"{y:12.6f}" for y in v) + f"{err:10.1e} | {cf:12.7f} {v[-1] - cf:9.1e} "
              f"{'yes' if abs(v[-1] - cf) <= err + wc else 'NO':>5s} | {sr:9.4f} ± {ws:.4f} "
              f"{'yes' if abs(v[-1] - sr) <= err + ws else 'NO':>5s}")

"""Scene C2 (meeting), set up by a reader of its page alone; kept as it was written.

``python c2_from_the_page.py``
"""

# ruff: noqa
# fmt: off
#
# Benchmark scene C2, two cuts that cross and a branch, set up from its page alone.
#
# Quartic triangles of scikit-fem. The mesh follows the cuts: Delaunay's triangles of points on and between them, every
# corner of a triangle separated from the corners across a cut, then geometric layers towards ends, meetings and corners
# of the body, then every triangle divided into n x n. The divisions n = 1, 2, 3 give the errors.
#
#     python c2_from_the_page.py [h] [layers] [ratio]
#
import sys
import time
import numpy as np
import skfem
from scipy.optimize import brentq
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

YOUNG, NU = 1.0, 0.3
MU, LAM = YOUNG / (2 * (1 + NU)), YOUNG * NU / ((1 + NU) * (1 - 2 * NU))
BORDER = np.array([[0.04, 0.01], [0.01, 0.05]])
CUTS = {"flat": ((0.171, 0.382), (0.823, 0.571)), "steep": ((0.563, 0.207), (0.391, 0.779)),
        "branch": ((0.66, 0.52375), (0.795, 0.742))}
CUTS = {name: np.array(ends) for name, ends in CUTS.items()}
OPENINGS = {"opening_before": ("flat", 0.25), "opening_between": ("flat", 0.6), "opening_above": ("steep", 0.8),
            "opening_of_the_branch": ("branch", 0.5)}
TIPS = {"flat_start": ("flat", 0), "flat_end": ("flat", 1), "steep_start": ("steep", 0), "steep_end": ("steep", 1),
        "branch": ("branch", 1)}
R_IN, R_OUT = 0.02, 0.1  # the ring of the interaction integral; no other cut and no border within R_OUT of an end
DIVISIONS = (1, 2, 3)

def place(cut, s):
    """The place at the part s of a cut."""
    a, b = CUTS[cut]
    return a + s * (b - a)

def crossing():
    """Parts (of flat, of steep) at which the two cuts cross."""
    (a, b), (c, d) = CUTS["flat"], CUTS["steep"]
    return np.linalg.solve(np.array([b - a, c - d]).T, c - a)

def distance(x, a, b):
    """Distance of the places x (k, 2) from the segment a b."""
    s = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(x - a - s[:, None] * (b - a), axis=1)

def base_mesh(h):
    """Triangles of size h, not yet separated: nodes (k, 2), triangles (m, 3), edges of the cuts (e, 2), sorted."""
    on_flat, on_steep = crossing()
    keys = {"flat": [0, 0.25, on_flat, 0.6, 0.75, 1], "steep": [0, on_steep, 0.8, 1], "branch": [0, 0.5, 1]}
    nodes, segments = [], []
    for cut, parts in keys.items():
        length = np.linalg.norm(CUTS[cut][1] - CUTS[cut][0])
        counts = [max(1, round((v - u) * length / h)) for u, v in zip(parts, parts[1:])]
        s = [u + (v - u) * i / k for u, v, k in zip(parts, parts[1:], counts) for i in range(k)] + [1]
        segments += zip(range(len(nodes), len(nodes) + len(s)), range(len(nodes) + 1, len(nodes) + len(s)))
        nodes += [place(cut, si) for si in s]
    nodes, same = np.unique(np.round(nodes, 13), axis=0, return_inverse=True)
    segments = np.sort(same.ravel()[np.array(segments)], axis=1)
    side = np.linspace(0, 1, round(1 / h) + 1)[:-1]
    border = [x for s in side for x in ((s, 0.0), (1.0, s), (1 - s, 1.0), (0.0, 1 - s))]
    j, i = np.meshgrid(np.arange(-1, 2 / h), np.arange(-1, 2 / h), indexing="ij")
    free = np.column_stack([((i + 0.5 * (j % 2)) * h).ravel(), (j * h * 0.866).ravel()])
    free = free[(np.minimum(free, 1 - free) > 0.6 * h).all(1)]
    free = free[np.min([distance(free, *ends) for ends in CUTS.values()], axis=0) > 0.7 * h]
    p, fixed = np.vstack([nodes, border, free]), len(nodes) + len(border)
    for _ in range(6):
        t = Delaunay(p).simplices
        d1, d2 = p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]]
        t = t[np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]) > 1e-9]
        e = np.unique(np.sort(np.vstack([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1), axis=0)
        p_old, around = p, coo_matrix((np.ones(2 * len(e)), (e.ravel(), e[:, ::-1].ravel()))).tocsr()
        p = p.copy()
        p[fixed:] = ((around @ p_old) / around.sum(1).reshape(-1, 1))[fixed:]
    assert set(map(tuple, segments)) <= set(map(tuple, e)), "an edge of a cut is not in the mesh"
    return p_old, t, segments

def separate(p, t, segments):
    """Give the corners of triangles on both sides of the segments nodes of their own: nodes and triangles."""
    cut, seen, pairs = set(map(tuple, segments)), {}, []
    for triangle, corners in zip(t, np.arange(t.size).reshape(t.shape)):
        for i in range(3):
            (a, at_a), (b, at_b) = sorted(zip(triangle[[i, i - 1]], corners[[i, i - 1]]))
            if (a, b) in seen and (a, b) not in cut:
                pairs += zip(seen[a, b], (at_a, at_b))
            seen[a, b] = at_a, at_b
    i, j = np.array(pairs).T
    count, new = connected_components(coo_matrix((np.ones(len(i)), (i, j)), shape=(t.size, t.size)), directed=False)
    q = np.empty((count, 2))
    q[new] = p[t.ravel()]
    return q, new.reshape(t.shape)

def add_layers(p, t, centre, layers, ratio):
    """Geometric layers of triangles towards all nodes at the place `centre`."""
    at = np.flatnonzero(np.linalg.norm(p - centre, axis=1) < 1e-9)
    for _ in range(layers):
        inside = np.isin(t, at)
        touch = inside.any(1)
        assert inside.sum(1).max() == 1
        first = inside[touch].argmax(1)
        c, a, b = (t[touch][np.arange(touch.sum()), (first + i) % 3] for i in range(3))
        unique, new = np.unique(np.concatenate([c * len(p) + a, c * len(p) + b]), return_inverse=True)
        a1, b1 = (new + len(p)).reshape(2, -1)
        start, end = p[unique // len(p)], p[unique % len(p)]
        p = np.vstack([p, start + ratio * (end - start)])
        t = np.vstack([t[~touch], *np.array([[c, a1, b1], [a1, a, b], [a1, b, b1]]).swapaxes(1, 2)])
    return p, t

def divided(mesh, n):
    """Every triangle of the mesh divided into n x n alike, n up to 4. The nodes are those of elements of degree n."""
    element = (skfem.ElementTriP1, skfem.ElementTriP2, skfem.ElementTriP3, skfem.ElementTriP4)[n - 1]()
    basis = skfem.Basis(mesh, element, intorder=1)
    at = {tuple(x): i for i, x in enumerate(np.rint(n * np.asarray(element.doflocs)).astype(int))}
    small = [[at[i, j], at[i + 1, j], at[i, j + 1]] for i in range(n) for j in range(n - i)]
    small += [[at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]] for i in range(n) for j in range(n - 1 - i)]
    return skfem.MeshTri(basis.doflocs, np.hstack([basis.element_dofs[s] for s in small]))

def stiffness(basis):
    """Stiffness matrix of a basis of vector elements on straight triangles."""
    scalar, p, t = basis.elem.elem, basis.mesh.p, basis.mesh.t
    x, weights = basis.quadrature
    g = np.array([scalar.lbasis(x, i)[1] for i in range(len(scalar.doflocs))])
    reference = np.einsum("iaq,jbq,q->abij", g, g, weights)
    jacobian = np.moveaxis(np.array([p[:, t[1]] - p[:, t[0]], p[:, t[2]] - p[:, t[0]]]), 2, 0).swapaxes(1, 2)
    inverse, area = np.linalg.inv(jacobian), np.abs(np.linalg.det(jacobian))
    factor = np.einsum("eac,ebd,e->ecdab", inverse, inverse, area).reshape(-1, 4)
    d = (factor @ reference.reshape(4, -1)).reshape(-1, 2, 2, *reference.shape[2:])
    k = LAM * d + MU * d.swapaxes(1, 2)
    k[:, [0, 1], [0, 1]] += MU * (d[:, 0, 0] + d[:, 1, 1])[:, None]
    k = k.transpose(0, 3, 1, 4, 2).reshape(len(area), -1)
    dofs = basis.element_dofs.T.astype(np.int32)
    rows, columns = np.repeat(dofs, dofs.shape[1], axis=1), np.tile(dofs, dofs.shape[1])
    return coo_matrix((k.ravel(), (rows.ravel(), columns.ravel())), shape=(basis.N, basis.N)).tocsc()

def solve(mesh):
    """Displacement (basis, dofs) and energy for the border's displacement."""
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP4()), intorder=6)
    k, u = stiffness(basis), basis.zeros()
    border = mesh.facets_satisfying(lambda x: np.minimum(x, 1 - x).min(0) < 1e-9, boundaries_only=True)
    held = basis.get_dofs(border).all()
    for i, dofs in enumerate(basis.split_indices()):
        u[dofs] = BORDER[i] @ basis.doflocs[:, dofs]
    free = np.setdiff1d(np.arange(len(u)), held)
    lu = splu(k[free][:, free], permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    for _ in range(2):  # the second time for the round-off of the first
        u[free] -= lu.solve((k @ u)[free])
    return basis, u, 0.5 * u @ (k @ u)

def opening(basis, u, cut, s):
    """(u+ - u-).n at the part s of a cut, + where n points."""
    mesh, x = basis.mesh, place(cut, s)
    t = CUTS[cut][1] - CUTS[cut][0]
    n = np.array([-t[1], t[0]]) / np.linalg.norm(t)
    nodes = np.flatnonzero(np.linalg.norm(mesh.p.T - x, axis=1) < 1e-9)
    assert len(nodes) == 2
    result = 0.0
    for node in nodes:
        triangle = np.flatnonzero((mesh.t == node).any(0))[0]
        sign = np.sign((mesh.p[:, mesh.t[:, triangle]].mean(1) - x) @ n)
        result += sign * n @ u[basis.nodal_dofs[:, node]]
    return result

def near_field(z, k):
    """Stress (2, 2, ...) and d u / d x_1 (2, ...) of an end at 0, cut along x_1 < 0, for k = K_I - i K_II."""
    phi = k / (2 * np.sqrt(2 * np.pi * z))
    omega = k / (2 * np.sqrt(2 * np.pi * z.conj()))
    turn = (z - z.conj()) * (-0.5 * phi / z).conj()
    trace, normal = 4 * phi.real, phi + omega + turn
    du = ((3 - 4 * NU) * phi - omega - turn) / (2 * MU)
    return np.array([[trace - normal.real, -normal.imag], [-normal.imag, normal.real]]), np.array([du.real, du.imag])

def intensities(basis, u, cut, end):
    """K_I and K_II at an end by the interaction integral over a ring."""
    mesh, x0 = basis.mesh, CUTS[cut][end]
    e1 = (x0 - CUTS[cut][1 - end]) / np.linalg.norm(x0 - CUTS[cut][1 - end])
    frame = np.array([e1, [-e1[1], e1[0]]])
    r = np.linalg.norm(mesh.p.T - x0, axis=1)[mesh.t]
    some = np.flatnonzero((r.max(0) > R_IN) & (r.min(0) < 2 * R_OUT))  # an edge may dip into the ring between its nodes
    part = skfem.Basis(mesh, basis.elem, intorder=14, elements=some)
    scalar = skfem.Basis(mesh, skfem.ElementTriP4(), intorder=14, elements=some)
    s = np.clip((np.linalg.norm(scalar.doflocs - x0[:, None], axis=0) - R_IN) / (R_OUT - R_IN), 0, 1)
    dq = np.einsum("ij,j...->i...", frame, scalar.interpolate(1 - s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)).grad)
    grad = np.einsum("ia,jb,ab...->ij...", frame, frame, part.interpolate(u).grad)
    x = np.einsum("ij,j...->i...", frame, np.asarray(part.global_coordinates()) - x0[:, None, None])
    strain = 0.5 * (grad + np.swapaxes(grad, 0, 1))
    stress = 2 * MU * strain + LAM * np.einsum("kk...,ij->ij...", strain, np.eye(2))
    result = []
    for k in (1.0, -1.0j):
        sigma, du = near_field(x[0] + 1j * x[1], k)
        density = np.einsum("ij...,i...,j...->...", sigma, grad[:, 0], dq) - (sigma * strain).sum((0, 1)) * dq[0]
        density += np.einsum("ij...,i...,j...->...", stress, du, dq)
        result.append(0.5 * YOUNG / (1 - NU**2) * np.sum(density * part.dx))
    return result

def outputs(mesh):
    """All values of one mesh, name: value."""
    basis, u, energy = solve(mesh)
    values = {"strain_energy": energy, **{name: opening(basis, u, *where) for name, where in OPENINGS.items()}}
    for name, where in TIPS.items():
        values["K_I_" + name], values["K_II_" + name] = intensities(basis, u, *where)
    return values, len(u)

def graded(h=0.07, layers=18, ratio=0.4):
    """The undivided mesh with its layers."""
    p, t = separate(*base_mesh(h))
    strong = [CUTS[cut][end] for cut, end in TIPS.values()]
    weak = [place("flat", crossing()[0]), CUTS["branch"][0], (0, 0), (0, 1), (1, 0), (1, 1)]
    for centre, count in [(x, layers) for x in strong] + [(x, layers // 2) for x in weak]:
        p, t = add_layers(p, t, centre, count, ratio)
    return skfem.MeshTri(p.T.copy(), t.T.copy())

def errors(runs):
    """Value on the finest mesh and its error, by name, and the order of the energy over the last three divisions.

    With the order of the energy (4 at most) for all values the error is 3 times the larger of two, of the last
    change and of the one before. So a change that is small by accident does not make it small.
    """
    (n1, n2, n3), v = DIVISIONS[-3:], {name: [run[name] for run in runs[-3:]] for name in runs[0]}
    e = v["strain_energy"]
    ratio = (e[0] - e[1]) / (e[1] - e[2])
    order = brentq(lambda q: (n1**-q - n2**-q) / (n2**-q - n3**-q) - ratio, 0.1, 20)
    q = min(order, 4.0)
    late, early = n3**-q / (n2**-q - n3**-q), n3**-q / (n1**-q - n2**-q)
    return {k: (x[2], 3 * max(late * abs(x[2] - x[1]), early * abs(x[1] - x[0]))) for k, x in v.items()}, order

def compare(result):
    """Print every value and its error beside the page's values of the first route, version 1.0."""
    page = """0.00189608682 4.4e-10 0.040960329 4.7e-8 0.046048152 3.4e-8 0.034360497 2.5e-8 0.018332114 6.3e-8
        0.045045785 6.2e-8 0.007325545 2.7e-8 0.034437283 3.8e-8 0.013624165 1.9e-8 0.044181411 4.5e-8
        -0.002029252 3.5e-8 0.042003655 5.5e-8 -0.006059623 5e-8 0.030724899 8.6e-8 0.005966564 2.5e-8"""
    page = np.array(page.split(), float).reshape(-1, 2)
    for (name, (value, error)), (other, half) in zip(result.items(), page):
        off = value - other
        verdict = "agrees" if abs(off) <= error else "within both" if abs(off) <= error + half else "DOES NOT AGREE"
        print(f"{name:22} {value:.11f} ± {error:.1e}   page {other:.11f} ± {half:.1e}   off {off:+.1e}   {verdict}")

if __name__ == "__main__":
    begin = time.time()
    mesh = graded(*(kind(x) for kind, x in zip((float, int, float), sys.argv[1:])))
    runs = []
    for n in DIVISIONS:
        values, size = outputs(divided(mesh, n))
        runs.append(values)
        seconds = f"{time.time() - begin:.0f} s, of the processor {time.process_time():.0f} s"
        print(f"{n} x {n}: {size} unknowns, {seconds}", flush=True)
    result, order = errors(runs)
    print(f"order of the energy {order:.1f}")
    for name, (value, error) in result.items():
        print(f"{name:22} {value:.11f} ± {error:.1e}   meshes", " ".join(f"{run[name]:.11f}" for run in runs))
    compare(result)

"""Energy of a body of tetrahedra that a plane cuts, by linear elements on clipped tetrahedra.

Nothing of the project is used: a tetrahedron that the plane crosses has a field of its own on each
side; each is integrated over the clipped part, of which the volume and centroid are closed forms.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve


def gradients(corners):
    """Gradients (4, 3) of the barycentric coordinates, and the volume."""
    inverse = np.linalg.inv(corners[1:] - corners[0])
    slopes = np.vstack([-inverse.sum(axis=1), inverse.T])
    return slopes, abs(np.linalg.det(corners[1:] - corners[0])) / 6.0


def parts(corners, heights):
    """Volume and centroid above a plane: corners (4, 3), heights over the plane (4,)."""
    above = np.flatnonzero(heights > 0.0)
    below = np.flatnonzero(heights <= 0.0)

    def on(i, j):
        share = heights[i] / (heights[i] - heights[j])
        return (1.0 - share) * corners[i] + share * corners[j]

    if len(above) == 4:
        tets = [corners]
    elif len(above) == 1:
        a = above[0]
        tets = [np.array([corners[a], *(on(a, j) for j in below)])]
    elif len(above) == 3:
        a = below[0]
        base, cut = [corners[i] for i in above], [on(i, a) for i in above]
        tets = _prism(base, cut)
    elif len(above) == 2:
        (a, b), (c, d) = above, below
        tets = _prism([corners[a], on(a, c), on(a, d)], [corners[b], on(b, c), on(b, d)])
    else:
        return 0.0, corners[0]
    volumes = np.array([abs(np.linalg.det(t[1:] - t[0])) / 6.0 for t in map(np.array, tets)])
    centres = np.array([np.mean(t, axis=0) for t in tets])
    return volumes.sum(), volumes @ centres / volumes.sum()


def _prism(one, other):
    return [
        np.array([*one, other[0]]),
        np.array([one[1], one[2], other[0], other[1]]),
        np.array([one[2], *other]),
    ]


def energy(points, cells, young, poisson, density, gravity, held, plane):
    """Strain energy in J of a body under its weight, held at nodes, cut by a plane.

    Parameters
    ----------
    points, cells : (n, 3), (m, 4) arrays
    young : (m,) array
        Pa.
    held : (k,) int array
        Nodes of uncut cells, of which the displacement is zero.
    plane : (point, normal)
    """
    heights = (points - plane[0]) @ plane[1]
    dof, rows, columns, values, load = {}, [], [], [], {}
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = young / (2 * (1 + poisson))
    for cell, one_lam, one_shear in zip(cells, lam, shear, strict=True):
        slopes, _ = gradients(points[cell])
        for side in (1.0, -1.0):
            volume, centre = parts(points[cell], side * heights[cell])
            if volume == 0.0:
                continue
            numbers = [dof.setdefault((node, side), len(dof)) for node in cell]
            shapes = np.array([0.25 + g @ (centre - points[cell].mean(axis=0)) for g in slopes])
            mixed = np.einsum("ai,bj->abij", slopes, slopes)
            block = one_lam * mixed + one_shear * np.einsum("ai,bj->abji", slopes, slopes)
            dots = slopes @ slopes.T
            block = block + one_shear * dots[:, :, None, None] * np.eye(3)
            for a, i in enumerate(numbers):
                load[i] = load.get(i, 0.0) + density * volume * shapes[a] * np.array(gravity)
                for b, j in enumerate(numbers):
                    rows += [3 * i + p for p in range(3) for _ in range(3)]
                    columns += [3 * j + q for _ in range(3) for q in range(3)]
                    values += list(volume * block[a, b].ravel())
    count = 3 * len(dof)
    stiffness = coo_array((values, (rows, columns)), shape=(count, count)).tocsr()
    force = np.array([load[i] for i in range(len(dof))]).ravel()
    fixed = {number for (node, _), number in dof.items() if node in set(held.tolist())}
    free = np.array([3 * i + p for i in range(len(dof)) if i not in fixed for p in range(3)])
    moved = spsolve(stiffness[free][:, free].tocsc(), force[free])
    return 0.5 * float(force[free] @ moved)


def energy_of_field(points, cells, displacement, lam, shear):
    """Strain energy, J, of a field that is linear on tetrahedra, of moduli (m,) in Pa."""
    total = 0.0
    for cell, one_lam, one_shear in zip(cells, lam, shear, strict=True):
        slopes, volume = gradients(points[cell])
        strain = displacement[cell].T @ slopes
        strain = 0.5 * (strain + strain.T)
        density = 0.5 * one_lam * np.trace(strain) ** 2 + one_shear * np.sum(strain**2)
        total += volume * density
    return total

"""Kernels of springs on the edges of cells."""

import numpy as np
from numba import njit


@njit(cache=True)
def spring_force(cells, edges, rest, stiffness, displacement, turning, directions, excess, force):
    """Add the force of all springs to `force` (N, d); return their energy.

    `rest` (p, e, d) are edge vectors of the undeformed cells. `directions` (p, e, d) and `excess`
    (p, e), 1 − rest length / length, are written if the springs turn.
    """
    energy = 0.0
    space = displacement.shape[1]
    change = np.empty(space)
    for p in range(len(cells)):
        for e in range(len(edges)):
            a, b = cells[p, edges[e, 0]], cells[p, edges[e, 1]]
            squared, short = 0.0, 0.0
            for k in range(space):
                change[k] = displacement[b, k] - displacement[a, k]
                squared += (rest[p, e, k] + change[k]) ** 2
                short += rest[p, e, k] ** 2
            length, short = np.sqrt(squared), np.sqrt(short)
            stretch = 0.0
            if turning:
                # l − l0 without cancellation: (l² − l0²)/(l + l0)
                for k in range(space):
                    stretch += change[k] * (2.0 * rest[p, e, k] + change[k])
                    if length > 0.0:
                        directions[p, e, k] = (rest[p, e, k] + change[k]) / length
                stretch /= length + short
                excess[p, e] = stretch / length if length > 0.0 else 0.0
            else:
                for k in range(space):
                    stretch += change[k] * directions[p, e, k]
            pull = stiffness[p, e] * stretch
            energy += 0.5 * pull * stretch
            for k in range(space):
                force[a, k] -= pull * directions[p, e, k]
                force[b, k] += pull * directions[p, e, k]
    return energy


@njit(cache=True)
def add_spring_stiffness(targets, edges, stiffness, directions, excess, exact, scale, blocks):
    """Add `scale` times the stiffness to nodal blocks (B, d, d).

    Exact: k (t tᵀ + (1 − l0/l)(I − t tᵀ)); else without what a compressed spring takes away.
    """
    space = blocks.shape[1]
    for p in range(len(targets)):
        for e in range(len(edges)):
            i, j = edges[e, 0], edges[e, 1]
            across = excess[p, e]
            if not exact and across < 0.0:
                across = 0.0
            for k in range(space):
                for l in range(space):
                    value = (1.0 - across) * directions[p, e, k] * directions[p, e, l]
                    if k == l:
                        value += across
                    value *= scale * stiffness[p, e]
                    blocks[targets[p, i, i], k, l] += value
                    blocks[targets[p, j, j], k, l] += value
                    blocks[targets[p, i, j], k, l] -= value
                    blocks[targets[p, j, i], k, l] -= value


@njit(cache=True)
def spring_product(cells, edges, stiffness, directions, vector, scale, out):
    """Add `scale` k t tᵀ v of all springs to `out` (N, d)."""
    space = vector.shape[1]
    for p in range(len(cells)):
        for e in range(len(edges)):
            a, b = cells[p, edges[e, 0]], cells[p, edges[e, 1]]
            along = 0.0
            for k in range(space):
                along += directions[p, e, k] * (vector[b, k] - vector[a, k])
            along *= scale * stiffness[p, e]
            for k in range(space):
                out[a, k] -= along * directions[p, e, k]
                out[b, k] += along * directions[p, e, k]

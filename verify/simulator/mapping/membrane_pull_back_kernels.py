"""Nearest material of a membrane to a tool: a walk down in distance."""

import numpy as np
from numba import njit

from verify.simulator.mapping.material_share_kernels import is_material
from verify.simulator.mapping.partner_kernels import partner
from verify.xfem.nearest_points import foot_on_facet, nearest_on_facet, squared_distance

__all__ = ["pull_back_to_membrane"]

_ON_EDGE = -1e-12  # barycentric coordinates: that far outside is on the edge
_NEARER = 1.0 - 1e-12  # a neighbour is nearer if its squared distance is less than that share


@njit(cache=True)
def _deform(piece, cell, displacement, body, simplex):
    """Write the corners of the deformed virtual element."""
    for a in range(3):
        node, unknown = body.cells[cell, a], body.piece_cells[piece, a]
        for i in range(3):
            simplex[a, i] = body.points[node, i] + displacement[unknown, i]


@njit(cache=True)
def _distance(place, piece, cell, displacement, body, simplex, at):
    """Squared distance to the deformed virtual element; writes the weights of its nearest point."""
    _deform(piece, cell, displacement, body, simplex)
    nearest_on_facet(place, simplex, at)
    foot = np.empty(3)
    foot_on_facet(simplex, at, foot)
    return squared_distance(place, foot)


@njit(cache=True)
def _beyond(place, piece, cell, displacement, body, simplex):
    """Whether the foot of the perpendicular on the plane of an element lies outside of it."""
    _deform(piece, cell, displacement, body, simplex)
    for a in range(3):
        # of the corner from its foot on the edge opposite to it, and of the place along that
        p, q = simplex[(a + 1) % 3], simplex[(a + 2) % 3]
        along = length = 0.0
        for i in range(3):
            along += (simplex[a, i] - p[i]) * (q[i] - p[i])
            length += (q[i] - p[i]) ** 2
        inside = square = 0.0
        for i in range(3):
            inwards = simplex[a, i] - p[i] - along / length * (q[i] - p[i])
            inside += (place[i] - p[i]) * inwards
            square += inwards**2
        if inside < _ON_EDGE * square:
            return True
    return False


@njit(cache=True)
def _step(place, piece, least, at, trial, simplex, displacement, body):
    """Give a nearer piece; -1 if there is none around the nearest point, -2 if that is a free edge.

    Where the nearest point is a corner, all pieces around the corner are asked.
    """
    cells, neighbours, piece_parent = body.cells, body.neighbours, body.piece_parent
    cell, free = piece_parent[piece], False
    for a in range(3):
        if at[a] != 0.0:
            continue
        coming, here, turns = piece, a, 0
        # round the corner that keeps its weight: through this edge, then the next one
        while turns < len(cells):
            current = piece_parent[coming]
            other = partner(coming, current, here, body)
            if other < 0:
                free = True
                break
            if other == piece:
                break
            there = piece_parent[other]
            distance = _distance(place, other, there, displacement, body, simplex, trial)
            if distance < _NEARER * least:
                return other
            corner = -1
            for b in range(3):
                if at[b] == 1.0:
                    corner = cells[cell, b]
            if corner < 0:
                break
            for b in range(3):
                if cells[there, b] != corner and neighbours[there, b] != current:
                    here = b
            coming = other
            turns += 1
    return -2 if free else -1


@njit(cache=True)
def pull_back_to_membrane(places, pieces, displacement, body, levels):
    """Material points nearest to places (q, 3), and their pieces; -1 beyond an edge or a rim.

    `body` is as `CutElements`, `levels` are the level sets (n, cuts) at the nodes.
    """
    cells, points, _, _, piece_parent, piece_label, first_piece, next_piece = body
    count = len(places)
    material, found = np.zeros((count, 3)), np.full(count, -1)
    simplex, at, trial = np.empty((3, 3)), np.empty(3), np.empty(3)
    for q in range(count):
        piece = pieces[q]
        for _ in range(len(cells)):
            cell = piece_parent[piece]
            least = _distance(places[q], piece, cell, displacement, body, simplex, at)
            nearer = _step(places[q], piece, least, at, trial, simplex, displacement, body)
            if nearer < 0:
                break
            piece = nearer
        cell = piece_parent[piece]
        best, inside = np.inf, nearer == -1
        if nearer == -2:
            inside = not _beyond(places[q], piece, cell, displacement, body, simplex)
        # beside a tip the pieces of an element overlap: the nearest one with material counts
        other = first_piece[cell] if inside else -1
        while other >= 0:
            least = _distance(places[q], other, cell, displacement, body, simplex, trial)
            if least < best and is_material(other, cell, trial, cells, piece_label, levels):
                best, found[q] = least, other
                for a in range(3):
                    at[a] = trial[a]
            other = next_piece[other]
        for a in range(3):
            for i in range(3):
                material[q, i] += at[a] * points[cells[cell, a], i]
    return material, found

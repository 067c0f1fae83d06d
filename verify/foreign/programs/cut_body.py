"""Cuts as level sets on the background mesh: which elements they cut, which values nodes have.

An element counts as cut if the middle of its share of the level set lies on the cut, so that a cut
that ends inside an element ends at its nearer facet; or, if asked for, if all of its share does.
Around each node the parts of elements are grouped across the facets that no cut closes; a node has
one value for each group.
"""

import numpy as np
from exchange_files import RefusedError, factor_at, loose_parts, parts
from split_cells import SplitMesh, place, split_cells


class Cut:
    """A cut as a level set, and where on its extension it really is."""

    def __init__(self, content):
        self.points = np.array(content["points"], dtype=float)
        self.triangles = content.get("triangles")
        if self.triangles is None:
            if np.allclose(self.points[0], self.points[-1]):
                raise RefusedError("closed cuts are not offered")
            return
        centre = self.points.mean(axis=0)
        axes = np.linalg.svd(self.points - centre)[2]
        self.origin, self.plane, self.normal = centre, axes[:2], axes[2]
        if np.abs((self.points - centre) @ self.normal).max() > 1e-9 * np.ptp(self.points):
            raise RefusedError("surfaces that are not plane are not offered")

    def level(self, at):
        """Return the signed distance (k,), and whether the foot of each point is on the cut."""
        if self.triangles is not None:
            return (at - self.origin) @ self.normal, self._in_plane(at)
        start, along = self.points[:-1], np.diff(self.points, axis=0)
        raw = np.einsum("ksi,si->ks", at[:, None] - start, along) / (along**2).sum(axis=1)
        low, high = np.zeros(len(along)), np.ones(len(along))
        low[0], high[-1] = -np.inf, np.inf  # the ends go on
        t = np.clip(raw, low, high)
        arm = at[:, None] - start - t[..., None] * along
        distance = np.linalg.norm(arm, axis=2)
        near = distance <= distance.min(axis=1)[:, None] * (1 + 1e-9) + 1e-300
        normal = np.column_stack([-along[:, 1], along[:, 0]])
        normal /= np.linalg.norm(along, axis=1)[:, None]
        mean = near @ normal  # at a kink, of the two segments
        first = near.argmax(axis=1)
        rows = np.arange(len(at))
        sign = np.sign(np.einsum("ki,ki->k", mean, arm[rows, first]))
        last = len(along) - 1
        t = t[rows, first]
        on = ~((first == 0) & (t < -1e-12)) & ~((first == last) & (t > 1 + 1e-12))
        return sign * distance.min(axis=1), on

    def beyond(self, at):
        """Return a level (k,) that is negative on the cut and positive beyond its ends."""
        if self.triangles is not None:
            flat, corners = (at - self.origin) @ self.plane.T, self._corners()
            edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
            key = np.sort(edges.round(12).view(), axis=1)
            _, first, times = np.unique(key, axis=0, return_index=True, return_counts=True)
            rim = edges[first[times == 1]]
            along = rim[:, 1] - rim[:, 0]
            t = np.einsum("ksi,si->ks", flat[:, None] - rim[:, 0], along) / (along**2).sum(axis=1)
            foot = rim[:, 0] + np.clip(t, 0, 1)[..., None] * along
            distance = np.linalg.norm(flat[:, None] - foot, axis=2).min(axis=1)
            return np.where(self._in_plane(at), -distance, distance)
        start, along = self.points[:-1], np.diff(self.points, axis=0)
        lengths = np.linalg.norm(along, axis=1)
        first = -(at - start[0]) @ along[0] / lengths[0]
        last = (at - self.points[-1]) @ along[-1] / lengths[-1]
        return np.maximum(first, last)

    def _corners(self):
        return ((self.points - self.origin) @ self.plane.T)[self.triangles]

    def _in_plane(self, at):
        flat, found = (at - self.origin) @ self.plane.T, np.zeros(len(at), dtype=bool)
        for a, b, c in self._corners():
            local = np.linalg.solve(np.column_stack([b - a, c - a]), (flat - a).T)
            found |= (local >= -1e-9).all(axis=0) & (local.sum(axis=0) <= 1 + 1e-9)
        return found


class CutBody:
    """The mesh with its level set: which elements are cut, which values the nodes have.

    ``phi`` (n,); ``cut`` (m,) marks; ``side`` (m,) of the uncut elements: -1, 1, or 0 where the
    level set crosses them beyond the end of a cut; ``group`` (3, n): value of a node below, above,
    and in elements of side 0.
    """

    def __init__(self, case, wholly=False):
        self.points, self.cells, self.wholly = case.points, case.cells, wholly
        self._place([Cut(content) for content in case.content["cuts"]])
        phi = self.phi[self.cells]
        mixed = (phi.min(axis=1) < 0) & (phi.max(axis=1) > 0)
        self.side = np.where(mixed, 0, np.where(phi.max(axis=1) > 0, 1, -1))
        self._group()

    def _place(self, cuts):
        n, m = len(self.points), len(self.cells)
        self.phi, self.cut = np.ones(n), np.zeros(m, dtype=bool)
        self.cuts, self.owner = cuts, np.full(n, -1)
        for k, one in enumerate(cuts):
            phi, _ = one.level(self.points)
            length = np.ptp(self.points[self.cells[0]], axis=0).max()
            phi[np.abs(phi) < 1e-10 * length] = 0.0
            values = phi[self.cells]
            mixed = (values.min(axis=1) < 0) & (values.max(axis=1) > 0)
            here, crossed = np.zeros(m, dtype=bool), np.flatnonzero(mixed)
            here[crossed] = self._share(one, values[crossed], crossed)
            touched = np.zeros(n, dtype=bool)
            touched[self.cells[here]] = True
            beside = phi == 0  # nodes on the cut, and those around them
            beside &= one.level(self.points)[1]
            touched[self.cells[beside[self.cells].any(axis=1)]] = True
            if (self.owner[touched] >= 0).any():
                raise RefusedError("cuts that share an element, or neighbours, are not offered")
            self.owner[touched], self.phi[touched] = k, phi[touched]
            self.cut |= here
            free = self.owner < 0
            self.phi[free] = np.where(np.sign(phi[free]) == 0, 1.0, phi[free])

    def _share(self, cut, values, elements):
        """Which elements' share of the level set is on the cut, by its middle or wholly."""
        d = self.points.shape[1]
        total, count = np.zeros((len(elements), d)), np.zeros(len(elements))
        every = np.ones(len(elements), dtype=bool)
        for i in range(d + 1):
            at, a = self.points[self.cells[elements, i]], values[:, i]
            ends = [(a == 0, at)]
            for j in range(i):
                b, crossed = values[:, j], a * values[:, j] < 0
                t = np.where(crossed, a / np.where(crossed, a - b, 1.0), 0.0)[:, None]
                ends.append((crossed, at + t * (self.points[self.cells[elements, j]] - at)))
            for real, end in ends:
                total += np.where(real[:, None], end, 0.0)
                count += real
                if self.wholly:
                    every &= ~real | cut.level(end)[1]
        return every if self.wholly else cut.level(total / count[:, None])[1]

    def _facets(self):
        """Pairs of elements that share a facet, with its nodes."""
        k = self.cells.shape[1]
        every = np.vstack([np.delete(self.cells, j, axis=1) for j in range(k)])
        owner = np.tile(np.arange(len(self.cells)), k)
        order = np.lexsort(np.sort(every, axis=1).T)
        rows = np.sort(every, axis=1)[order]
        same = np.flatnonzero((rows[1:] == rows[:-1]).all(axis=1))
        return rows[same], owner[order][same], owner[order][same + 1]

    def _group(self):
        n, m, k = len(self.points), len(self.cells), self.cells.shape[1]
        # a corner (element, side, local node) for each part; uncut elements have two equal sides
        corner = np.arange(2 * m * k).reshape(m, 2, k)
        self.facets = facets, first, second = self._facets()
        values = self.phi[facets]
        mixed = (values.min(axis=1) < 0) & (values.max(axis=1) > 0)
        flat = (values == 0).all(axis=1)
        joined = [corner[~self.cut].transpose(0, 2, 1).reshape(-1, 2)]
        for s, sign in enumerate((-1, 1)):
            reaches = mixed | (sign * values > 0).any(axis=1)
            for f in (reaches, flat) if s else (reaches,):
                keep = np.flatnonzero(f & ~(flat & self._on_cut(facets)))
                joined += [self._corners(corner, facets[keep], first[keep], second[keep], s)]
        label = parts(np.vstack(joined), corner.size).reshape(corner.shape)
        self.group = np.full((3, n), -1)
        for s in (0, 1):
            for element in (self.cut, ~self.cut & (self.side == 2 * s - 1)):
                self._enter(s, element, label[:, s])
        self._enter(2, ~self.cut & (self.side == 0), label[:, 0])
        for s in (0, 1, 2):  # where there is no such element, any value of the node does
            for other in (0, 1, 2):
                self.group[s] = np.where(self.group[s] < 0, self.group[other], self.group[s])
        names, number = np.unique(self.group, return_inverse=True)
        self.group, self.count = number.reshape(3, n), len(names)

    def _enter(self, row, elements, label):
        nodes, names = self.cells[elements], label[elements]
        self.group[row][nodes] = names
        if (self.group[row][nodes] != names).any():
            raise RefusedError("cuts that part a node in more than two are not offered")

    def _on_cut(self, facets):
        middle, found = self.points[facets].mean(axis=1), np.zeros(len(facets), dtype=bool)
        for k, one in enumerate(self.cuts):
            mine = (self.owner[facets] == k).all(axis=1)
            found[mine] = one.level(middle[mine])[1]
        return found

    def between(self, facets):
        """Which facets (f, k) have nodes beside different cuts, or beside one and none.

        No cut crosses them, whatever the signs of their levels.
        """
        owner = self.owner[facets]
        return (owner != owner[:, :1]).any(axis=1)

    def rows(self, facets):
        """Row of `group` for each node (f, k) of facets that no cut crosses."""
        levels = self.phi[facets]
        low = np.where(self.between(facets)[:, None], levels, levels.min(axis=1, keepdims=True))
        return np.where(low < 0, 0, 1)

    def on_a_cut(self, at):
        """Which points (k, d) lie on the level set of a cut, within the cut."""
        found = np.zeros(len(at), dtype=bool)
        size = np.ptp(self.points[self.cells[0]], axis=0).max()
        for one in self.cuts:
            level, on = one.level(at)
            found |= on & (np.abs(level) < 0.5 * size)
        return found

    def _corners(self, corner, facets, first, second, side):
        pairs = []
        for j in range(facets.shape[1]):
            ends = [
                corner[e, side, (self.cells[e] == facets[:, j, None]).argmax(axis=1)]
                for e in (first, second)
            ]
            pairs.append(np.column_stack(ends))
        return np.vstack(pairs)


def divided(case, wholly=False):
    """Return the cut body and the mesh of its answer."""
    body = CutBody(case, wholly)
    side = np.where(body.side == 0, 2, (body.side + 1) // 2)
    return body, SplitMesh(case.points, case.cells, body.phi, body.cut, side, body.group)


def held_at_rest(case, body, answer):
    """Return what `prescribed` does; a part that nothing holds has no equilibrium."""
    held, value = prescribed(case, body)
    loose = loose_parts(answer.points, answer.cells, answer.held(held))
    if len(loose):
        raise RuntimeError(f"nothing holds the part around {loose[0]}")
    return held, value


def uniform_weight(case):
    """Return the sum (d,) of the body forces."""
    loads = [one for one in case.problem["loads"] if one["kind"] == "body_force"]
    if any("uniform" not in one for one in loads):
        raise RefusedError("body forces in formulas are not offered")
    return sum((np.array(one["uniform"]) for one in loads), np.zeros(case.dimension))


def prescribed(case, body, time=0.0):
    """Which components of which groups are held, and their values at a time."""
    d = case.dimension
    held, value = np.zeros((body.count, d), dtype=bool), np.zeros((body.count, d))
    boundary = np.array(case.problem["boundary"])
    for support in case.problem["held"]:
        nodes = np.array(support["nodes"])
        on = np.zeros(len(case.points), dtype=bool)
        on[nodes] = True
        reached = boundary[on[boundary].all(axis=1)]
        values = dict(zip(nodes, support["values"], strict=True))
        # a node is held on the sides that its held facets reach, one without such on its own
        alone = np.setdiff1d(nodes, reached)
        chosen = {(node, 0 if body.phi[node] < 0 else 1): values[node] for node in alone}
        apart = body.between(reached)
        for facet, rows in zip(reached[apart], body.rows(reached[apart]), strict=True):
            chosen |= {(node, s): values[node] for node, s in zip(facet, rows, strict=True)}
        for facet in reached[~apart]:
            for s, sign in enumerate((-1, 1)):
                if _reaches(case, body, facet, support, sign):
                    chosen |= {(node, s): values[node] for node in facet}
        for entry in support["across"]:
            node, point = entry["node"], np.array(entry["side_point"])[None]
            level = body.cuts[body.owner[node]].level(point)[0][0]
            if abs(level) < 1e-9 * case.problem["size"]:
                continue  # along the cut, of either side
            if (key := (node, 0 if level < 0 else 1)) in chosen:
                chosen[key] = entry["values"]
        if support.get("rotation") and support.get("history"):
            raise RefusedError("supports that turn in time are not offered")
        factor = factor_at(support.get("history"), time)
        for (node, s), values in chosen.items():
            at = body.group[s, node], support["components"]
            held[at], value[at] = True, factor * np.asarray(values)
    return held, value


def _reaches(case, body, facet, support, sign):
    """Whether a support holds a facet on a side: all of it does, or the part that it has of it."""
    level = body.phi[facet]
    parts = [one["corners"] for one in support.get("ended", []) if set(one["facet"]) == set(facet)]
    if not parts or (sign * level >= 0).all():
        return (sign * level > 0).any()
    at = np.concatenate([np.reshape(part, (-1, case.dimension)) for part in parts])
    straight = all(
        len(cut["points"]) == 2 or cut["kind"] == "polygon" for cut in case.content["cuts"]
    )
    depth = (1e-5 if straight else 0.1) * case.problem["size"]
    return (sign * barycentric(case.points[facet], at) @ level).max() > depth


def forces(case, body, loads=None):
    """Return the forces (groups, d) of the tractions, of all of them or of some `loads`."""
    force = np.zeros((body.count, case.dimension))
    for load in case.problem["loads"] if loads is None else loads:
        if load["kind"] != "traction":
            continue
        facets = np.array(load["facets"])
        values = body.phi[facets]
        crossed = (values.min(axis=1) < 0) & (values.max(axis=1) > 0) & ~body.between(facets)
        value = np.array(load.get("uniform", load.get("value", [])))
        if not len(value) and crossed.any():
            raise RefusedError("loads in formulas on facets that a cut crosses are not offered")
        rows = body.rows(facets)
        for row, facet in enumerate(facets):
            if crossed[row]:
                piece = np.array(load["corners"][row]) if "corners" in load else case.points[facet]
                _split_traction(case, body, facet, piece, value, force)
                continue
            groups = body.group[rows[row], facet]
            if "uniform" in load:
                share = np.full(len(facet), measure(case.points[facet]) / len(facet))
                force[groups] += share[:, None] * load["uniform"]
            else:
                at, weights = np.array(load["points"][row]), np.array(load["weights"][row])
                shape = barycentric(case.points[facet], at)
                force[groups] += np.einsum("q,qi,qc->ic", weights, shape, load["values"][row])
    return force


def _split_traction(case, body, facet, piece, traction, force):
    """Add the forces of a traction on a simplex in a facet, each side on its own values."""
    corners, phi = case.points[facet], body.phi[facet]
    level = barycentric(corners, piece) @ phi
    level[np.abs(level) < 1e-9 * np.abs(phi).max()] = 0.0
    if level.min() >= 0 or level.max() <= 0:
        parts, side = [piece], [int(level.max() > 0)]
    else:
        ends, _, side = split_cells(np.arange(len(facet))[None], level)
        parts = place(ends, piece, level)
    for part, s in zip(parts, side, strict=True):
        shape = barycentric(corners, part).mean(axis=0)
        force[body.group[s, facet]] += measure(part) * shape[:, None] * traction


def measure(corners):
    """Length or area of a facet in space."""
    edges = corners[1:] - corners[0]
    return np.sqrt(np.linalg.det(edges @ edges.T)) / {1: 1, 2: 2}[len(edges)]


def barycentric(corners, at):
    """Shape functions (k, corners) of a facet at points (k, d) on it."""
    edges = (corners[1:] - corners[0]).T
    local = np.linalg.lstsq(edges, (at - corners[0]).T, rcond=None)[0].T
    return np.column_stack([1 - local.sum(axis=1), local])

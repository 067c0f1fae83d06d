"""Statics and motion of an exported case, for any engine that answers a step.

Cuts that are still closed are nodes that are one: each time a cut opens, the engine is given the
body anew, and the state goes over node by node. Beside `exchange_files` it needs numpy alone.

An engine is a class, called with the case and a `Stage`, with the methods

- ``equilibrium(values, force)``: displacement (n, d) under the values of the held components
- ``begin(u, v, force)``: the state at the start of a step, with the forces right then
- ``step(dt, values, force)``: one time step; values and forces are those of its end
- ``state()``: displacement, velocity and, if it has one, the acceleration in balance with them
"""

import time

import numpy as np
from exchange_files import RefusedError, factor_at, loose_parts

_SAME = 1e-9  # of the duration: times that close are one
_BEFORE = 1e-7  # of the duration: so much earlier a history has not jumped yet


class Stage:
    """The body while the cuts that open after `instant` are closed.

    Attributes
    ----------
    node : (N,) int array
        Node of the stage for each node of the case.
    first : (n,) int array
        A node of the case for each of the stage.
    points, cells, held : arrays
        Mesh (n, d), (m, d + 1) and mark (n, d) of the held components.
    """

    def __init__(self, case, instant):
        closed, everything = _opening(case) > instant, np.arange(len(case.points))
        place = np.unique(case.points, axis=0, return_inverse=True)[1].ravel()
        names = np.where(closed, place, len(place) + everything)
        self.case, self.instant = case, instant
        _, self.first, self.node = np.unique(names, return_index=True, return_inverse=True)
        self.points, self.cells = case.points[self.first], self.node[case.cells]
        self.held = self._gathered(case.held()[0], np.logical_or)
        supports = case.problem["held"]
        self.still = None if any(one.get("history") for one in supports) else self._values(0.0)
        loads = case.nodal_loads() if hasattr(case, "nodal_loads") else _nodal_loads(case)
        self.loads = [(table, self._gathered(force)) for table, force in loads]

    def _gathered(self, values, add=np.add):
        found = np.zeros(self.points.shape, dtype=values.dtype)
        add.at(found, self.node, values)
        return found

    def _values(self, instant):
        mark, values = self.case.held(instant)
        rows, columns = np.nonzero(mark)
        found = np.zeros(self.points.shape)
        found[self.node[rows], columns] = values[rows, columns]
        return found

    def values(self, instant):
        """Return what the supports prescribe at a time, (n, d) in m; 0 where nothing is held."""
        return self._values(instant) if self.still is None else self.still

    def force(self, instant):
        """Consistent nodal forces (n, d) of the loads at a time, N."""
        shares = (factor_at(table, instant) * share for table, share in self.loads)
        return sum(shares, np.zeros(self.points.shape))


def _nodal_loads(case):
    """History and consistent forces (N, d) of each load."""
    loads = case.problem["loads"]
    found = [(one.get("history"), _uniform(case, one)) for one in loads if _even(one)]
    rest = np.array(case.problem["nodal_forces"], dtype=float)
    rest -= sum(share for _, share in found)
    tables = [one.get("history") for one in loads if not _even(one)]
    if any(table != tables[0] for table in tables):
        raise RefusedError("loads that vary in space and each in their own way in time")
    return [*found, *((table, rest) for table in tables[:1])]


def _even(load):
    return load.get("uniform") is not None


def _uniform(case, load):
    nodes, force = np.array(load.get("facets", case.cells)), np.zeros(case.points.shape)
    edges = case.points[nodes[:, 1:]] - case.points[nodes[:, :1]]
    measure = np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1)))
    measure = measure / [1, 1, 2, 6][nodes.shape[1] - 1] / nodes.shape[1]
    np.add.at(force, nodes, measure[:, None, None] * np.array(load["uniform"], dtype=float))
    return force


def _opening(case):
    """Return the time (N,) at which a node parts from its twins across a cut; −∞ without one."""
    cuts, points = case.content["cuts"], case.points
    _, place, count = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    opens = np.full(len(points), -np.inf)
    double = count[place.ravel()] > 1
    times = sorted({cut["opens_at"] for cut in cuts})
    if len(times) == 1:
        opens[double] = times[0]
    elif times:
        near = [_distance(points, cut) < 1e-6 * case.problem["size"] for cut in cuts]
        own = np.where(near, np.array([[cut["opens_at"]] for cut in cuts]), np.nan)[:, double]
        if np.isnan(own).all(axis=0).any() or (np.ptp(np.nan_to_num(own, nan=0), axis=0) < 0).any():
            raise RefusedError("curved cuts that open in turn")
        first, last = np.nanmin(own, axis=0), np.nanmax(own, axis=0)
        if (first < last).any():
            raise RefusedError("cuts that meet and open in turn")
        opens[double] = last
    return opens


def _distance(points, cut):
    at = np.array(cut["points"], dtype=float)
    if points.shape[1] == 3:  # of its plane; of a curved one nothing is near
        normal = np.linalg.svd(at - at.mean(axis=0))[2][2]
        return np.abs((points - at.mean(axis=0)) @ normal)
    start, edge = at[:-1], np.diff(at, axis=0)
    share = np.einsum("nsd,sd->ns", points[:, None] - start, edge) / (edge**2).sum(axis=1)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * edge
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def run_engine(case, engine, mass=None, **said):
    """Solve the case by an engine, time it, and write the answer.

    Parameters
    ----------
    case : Case
    engine : class
    mass : {"consistent", "lumped"}, optional
        With which the engine moves.
    said
        Further keys of the answer.
    """
    if case.cells.shape[1] != case.dimension + 1:
        raise RefusedError("no membranes")
    if case.content["analysis"]["kind"] == "static":
        stage = Stage(case, 0.0)
        values, force = stage.values(0.0), stage.force(0.0)
        if len(loose := loose_parts(stage.points, stage.cells, stage.held)):
            raise RuntimeError(f"nothing holds the part around {loose[0]}")
        u = case.timed("solve", lambda: engine(case, stage).equilibrium(values, force))
        fields = {"displacement": u[stage.node]}
    else:
        if any(cut["kind"] == "tool_path" for cut in case.content["cuts"]):
            raise RefusedError("tool paths: facets that open one by one")
        _march(case, engine, trial=True)  # what is compiled or read is, in it
        marched = [_march(case, engine) for _ in range(max(1, case.repetitions))]
        outputs, steps = marched[0][:2]
        case.timings = {"motion": [seconds for *_, seconds in marched]}
        names = ("displacement", "velocity", "acceleration")
        fields = {
            name: np.array([state[k] for state in outputs])
            for k, name in enumerate(names[: len(outputs[0])])
        }
        said = {"times": case.content["output_times"], "iterations": {"steps": steps}, **said}
        said["mass"] = _lumped(case) if mass == "lumped" else mass
    case.answer(case.points, case.cells, **fields, unknowns=case.points.size,
                cut_facets=case.problem["cut_facets"], **said)  # fmt: skip


def _lumped(case):
    """Mass (N,) of the nodes of linear cells: each has an equal share of its cells."""
    edges = np.diff(case.points[case.cells], axis=1)
    share = np.abs(np.linalg.det(edges)) * case.constant("density")
    corners = case.cells.shape[1]
    share = np.repeat(share / [1, 1, 2, 6][corners - 1] / corners, corners)
    return np.bincount(case.cells.ravel(), share, minlength=len(case.points))


def _march(case, engine, trial=False):
    """Return the states at the outputs, the number of steps and the seconds."""
    times, largest = np.array(case.content["output_times"]), _largest_step(case)
    slack, parts = _SAME * times[-1], case.problem["held"] + case.problem["loads"]
    breaks = np.array([0.0, *(t for part in parts for t, _ in part.get("history") or ())])
    own = [cut["opens_at"] for cut in case.content["cuts"]]
    stops = np.sort([t for t in {*times, *breaks, *own} if 0.0 <= t <= times[-1]])
    stops = stops[np.diff(stops, prepend=-1.0) > slack]
    clock, outputs, steps = time.perf_counter(), [], 0
    stage, body, u, v = _initial(case, engine, slack)
    for k, stop in enumerate(stops):
        opened = Stage(case, stop + slack)
        if len(opened.points) > len(stage.points):
            u, v = (field[stage.node][opened.first] for field in (u, v))
            stage, body = opened, engine(case, opened)
        if k == 0 or stage is opened or np.abs(breaks - stop).min() < slack:
            moved = stage.values(stop + _BEFORE * largest) - stage.values(stop)
            v = np.where(stage.held, moved / (_BEFORE * largest), v)
            body.begin(u, v, stage.force(stop), largest)
        if np.abs(times - stop).min() < slack:
            outputs.append([field[stage.node] for field in body.state()])
        if k + 1 < len(stops):
            count = max(1, int(np.ceil((stops[k + 1] - stop) / largest * (1 - 1e-9))))
            dt = float(f"{(stops[k + 1] - stop) / count:.12g}")  # one up to round-off
            for n in range(1, 2 if trial else count + 1):
                end = stop + n * dt - (n == count) * _BEFORE * dt
                body.step(dt, stage.values(end), stage.force(end))
            u, v = body.state()[:2]
            steps += count
        if trial:
            break
    return outputs, steps, time.perf_counter() - clock


def _largest_step(case):
    """Return the step of the case, else the time of a pressure wave through an element."""
    if case.content["analysis"]["time_step"]:
        return case.content["analysis"]["time_step"]
    stiffness = case.constant("lame") + 2.0 * case.constant("shear")
    return case.problem["size"] / np.sqrt((stiffness / case.constant("density")).max())


def _initial(case, engine, slack):
    initial = case.content["initial"]
    stage = Stage(case, slack if initial.get("cuts") == "open" else -slack)
    body, u = engine(case, stage), stage.values(0.0)
    v = np.zeros_like(u)
    if initial["kind"] == "equilibrium":  # with the first factors, before a jump at the time 0
        if len(loose := loose_parts(stage.points, stage.cells, stage.held)):
            raise RuntimeError(f"nothing holds the part around {loose[0]}")
        u = body.equilibrium(stage.values(-1.0), stage.force(-1.0))
    elif initial["kind"] == "moving":
        arm = stage.points - np.array(initial["centre"] or 0.0)
        if initial["spin"] is not None:
            flat, spin = case.dimension == 2, np.array(initial["spin"])
            v += spin * arm[:, ::-1] * [-1.0, 1.0] if flat else np.cross(spin, arm)
        v += np.array(initial["velocity"] or 0.0)
    elif initial["kind"] != "rest":
        raise RefusedError("an initial field, which no list of values holds")
    return stage, body, u, v

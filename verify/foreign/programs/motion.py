"""Statics and motion of an exported case, for any engine that answers a step.

Cuts that are still closed are nodes that are one: each time a cut opens, the engine is given the
body anew, and the state goes over node by node. Behind a blade a node opens once the blade has
passed all facets there. Beside `exchange_files` it needs numpy alone.

An engine is a class, called with the case and a `Stage`, with the methods

- ``equilibrium(values, force)``: displacement (n, d) under the values of the held components
- ``begin(u, v, force)``: the state at the start of a step, with the forces right then
- ``step(dt, values, force)``: one time step; values and forces are of its end
- ``state()``: displacement, velocity and, if it has one, the acceleration in balance with them
- ``penalty()``, if it penalises anything: the energy in that, J
"""

import time
from contextlib import contextmanager

import numpy as np
from exchange_files import RefusedError, factor_at, loose_parts

_LATE = "facets as a whole, when the blade has passed them"
_SAME = 1e-9  # of the duration: times that close are one
_BEFORE = 1e-7  # of the duration: so much earlier a history has not jumped yet


class Stage:
    """The body while the cuts that open after `instant` are closed.

    Attributes
    ----------
    opens : (N,) array
        When each node of the case parts from its twins, s.
    node : (N,) int array
        Node of the stage for each node of the case.
    first : (n,) int array
        A node of the case for each of the stage.
    points, cells, held : arrays
        Mesh (n, d), (m, d + 1) and mark (n, d) of the held components.
    """

    def __init__(self, case, instant, opens=None):
        self.opens = _opening(case) if opens is None else opens
        closed, everything = self.opens > instant, np.arange(len(case.points))
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
    """Return the time (N,) at which a node parts from its twins; −∞ without one.

    It does when the last facet of a cut there is open: behind a blade no node opens early. Where a
    background mesh is cut, the case says it itself.
    """
    if hasattr(case, "opening"):
        return case.opening()
    facets = np.array(case.problem["cut_facets"]).reshape(-1, case.dimension)
    times = np.repeat(case.problem["cut_opens"], case.dimension)
    both = np.concatenate([case.points, facets])
    _, place = np.unique(both, axis=0, return_inverse=True)
    place, corner = np.split(place.ravel(), [len(case.points)])
    first, last = np.full(len(both), np.inf), np.full(len(both), -np.inf)
    np.minimum.at(first, corner, times)
    np.maximum.at(last, corner, times)
    twins = np.bincount(place, minlength=len(both))
    if (last[twins > 1] == -np.inf).any():
        raise RuntimeError("a doubled node is no corner of a facet of a cut")
    if ((twins > 2) & (first < last)).any():
        raise RefusedError("cuts that meet and open in turn")
    return np.where(twins > 1, last, -np.inf)[place]


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
        _March(case, engine).run(trial=True)  # what is compiled or read is, in it
        marched = [_March(case, engine).run() for _ in range(max(1, case.repetitions))]
        outputs, steps = marched[0].outputs, marched[0].steps
        case.timings = {name: [one.seconds[name] for one in marched] for name in marched[0].seconds}
        names = ("displacement", "velocity", "acceleration")
        fields = {
            name: np.array([state[k] for state in outputs])
            for k, name in enumerate(names[: len(outputs[0])])
        }
        said = {"times": case.content["output_times"], "iterations": {"steps": steps}, **said}
        said["mass"] = lumped_mass(case) if mass == "lumped" else mass
        if hasattr(engine, "penalty"):
            said["ledger"] = {"penalty": marched[0].penalty}
        if any(cut["kind"] == "tool_path" for cut in case.content["cuts"]):
            said["notes"] = {**said.get("notes", {}), "a tool path opens": _LATE}
    case.answer(case.points, case.cells, **fields, unknowns=case.points.size,
                cut_facets=case.problem["cut_facets"], **said)  # fmt: skip


def lumped_mass(case):
    """Mass (N,) of the nodes of linear cells: each has an equal share of its cells."""
    edges = np.diff(case.points[case.cells], axis=1)
    share = np.abs(np.linalg.det(edges)) * case.constant("density")
    corners = case.cells.shape[1]
    share = np.repeat(share / [1, 1, 2, 6][corners - 1] / corners, corners)
    return np.bincount(case.cells.ravel(), share, minlength=len(case.points))


class _March:
    """A motion: an engine for the body as it is open, told anew when something opens or jumps.

    Attributes
    ----------
    outputs, penalty : list
        What the engine says at each output, on the nodes of the case.
    steps : int
    seconds : dict
        Spent on ``"building"`` the body, at first and after each opening, and on its ``"motion"``.
    """

    def __init__(self, case, engine):
        self.case, self.engine, self.steps = case, engine, 0
        self.outputs, self.penalty = [], []
        self.times, self.largest = np.array(case.content["output_times"]), _largest_step(case)
        self.slack, parts = _SAME * self.times[-1], case.problem["held"] + case.problem["loads"]
        jumps = (t for part in parts for t, _ in part.get("history") or ())
        self.breaks = np.array([0.0, *jumps])
        cuts = [cut for cut in case.content["cuts"] if cut["kind"] != "tool_path"]
        stops = {*self.times, *self.breaks, *(cut["opens_at"] for cut in cuts)}
        stops = np.sort([t for t in stops if 0.0 <= t <= self.times[-1]])
        self.stops = stops[np.diff(stops, prepend=-1.0) > self.slack]
        self.seconds = {"building": 0.0, "motion": 0.0}

    def run(self, trial=False):
        """March to the end, or for one step; return self."""
        with self.timed("building"):
            self.stage, self.body, self.u, self.v = _initial(self.case, self.engine, self.slack)
        for k, stop in enumerate(self.stops):
            self.open(stop, k == 0 or np.abs(self.breaks - stop).min() < self.slack)
            if np.abs(self.times - stop).min() < self.slack:
                self.outputs.append([field[self.stage.node] for field in self.body.state()])
                if hasattr(self.body, "penalty"):
                    self.penalty.append(self.body.penalty())
            if k + 1 < len(self.stops):
                self.advance(stop, self.stops[k + 1], trial)
            if trial:
                break
        return self

    def open(self, instant, jumps=False):
        """Build the body anew if a cut has opened; begin anew then, or if something jumps."""
        opens = self.stage.opens
        due = ((opens > self.stage.instant) & (opens <= instant + self.slack)).any()
        if not due and not jumps:
            return
        with self.timed("building"):
            if self.steps:
                self.u, self.v = self.body.state()[:2]
            if due:
                before, self.stage = self.stage, Stage(self.case, instant + self.slack, opens)
                self.u, self.v = (f[before.node][self.stage.first] for f in (self.u, self.v))
                self.body = self.engine(self.case, self.stage)
            soon = _BEFORE * self.largest
            moved = self.stage.values(instant + soon) - self.stage.values(instant)
            self.v = np.where(self.stage.held, moved / soon, self.v)
            self.body.begin(self.u, self.v, self.stage.force(instant), self.largest)

    def advance(self, start, stop, trial):
        """Step from a stop to the next, opening on the way what blades have passed."""
        count = max(1, int(np.ceil((stop - start) / self.largest * (1 - 1e-9))))
        dt = float(f"{(stop - start) / count:.12g}")  # one up to round-off
        for n in range(1, 2 if trial else count + 1):
            if n > 1:
                self.open(start + (n - 1) * dt)
            end = start + n * dt - (n == count) * _BEFORE * dt
            with self.timed("motion"):
                self.body.step(dt, self.stage.values(end), self.stage.force(end))
            self.steps += 1

    @contextmanager
    def timed(self, phase):
        """Count the seconds of a block to a phase."""
        start = time.perf_counter()
        yield
        self.seconds[phase] += time.perf_counter() - start


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

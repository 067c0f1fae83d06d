"""Reader and writer of the exchange of files, for programs that solve a case of `verify`.

This file needs Python 3.10, numpy and nothing of `verify`. It may be copied into any program.
``docs/guide/your-solver.md`` describes the files.
"""

import base64
import json
import sys
import time
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

_NUMPY = {
    "Float64": "<f8", "Float32": "<f4", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1",
    "UInt32": "<u4", "UInt64": "<u8",
}  # fmt: skip
_VTK = {3: 5, 4: 10}  # corners of a cell: VTK's number of triangle and tetrahedron


class RefusedError(Exception):
    """The program cannot do the case; the text says why."""


def _positive(points, cells):
    """Cells with their nodes in the order of a positive volume; those of membranes as they are."""
    if cells.shape[1] != points.shape[1] + 1:
        return cells
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    turned = np.linalg.det(edges) < 0.0
    cells = cells.copy()
    cells[turned, :2] = cells[turned, 1::-1]
    return cells


class Case:
    """An exported case on one mesh level.

    Parameters
    ----------
    root : path
        Folder with ``case.json``.
    level : int
    conforming : bool
        Whether the conforming mesh is read, else the background mesh.

    Attributes
    ----------
    content, problem : dict
        ``case.json``, and ``problem.json`` or ``conforming.json``.
    points : (n, d) array
        m.
    cells : (m, d + 1) int array
        Their nodes in the order of a positive volume, unless they are membranes.
    material : (m,) int array
        Number of each cell's material.
    parameters : dict
        What the user gave by ``--set``, over the defaults.
    repetitions : int
        How often the solve is timed, after a first call that is not.
    """

    def __init__(self, root, level, conforming=False):
        self.root, self.level = Path(root), int(level)
        self.folder = self.root / f"level-{level}"
        self.content = json.loads((self.root / "case.json").read_text(encoding="utf-8"))
        name = "conforming.json" if conforming else "problem.json"
        self.problem = json.loads((self.folder / name).read_text(encoding="utf-8"))
        points, cells, data = read_vtu(self.folder / self.problem["mesh"])
        self.dimension = self.content["dimension"]
        self.points = np.ascontiguousarray(points[:, : self.dimension])
        self.cells = _positive(self.points, cells)
        self.material = data.get("material", np.zeros(len(self.cells), dtype=int))
        request = self.root / "request.json"
        asked = json.loads(request.read_text(encoding="utf-8")) if request.is_file() else {}
        self.parameters = asked.get("parameters", {})
        self.repetitions = asked.get("repetitions", 1)
        self.timings = {}

    def constant(self, name):
        """Return ``"lame"``, ``"shear"``, ``"density"`` … of each cell, (m,)."""
        material = self.content["material"]
        each = material.get("each", [material])
        return np.array([one[name] for one in each], dtype=float)[self.material]

    def held(self, time=0.0):
        """Which components (n, d) of which nodes are held, and their values (n, d) in m."""
        mark, value = np.zeros(self.points.shape, dtype=bool), np.zeros(self.points.shape)
        for support in self.problem["held"]:  # a later one wins
            if support.get("rotation") and support.get("history"):
                raise RefusedError("supports that turn in time are not offered")
            at = np.ix_(support["nodes"], support["components"])
            factor = factor_at(support.get("history"), time)
            mark[at], value[at] = True, factor * np.asarray(support["values"], dtype=float)
        return mark, value

    def timed(self, phase, work):
        """Call `work` once, then as often as asked for; return its answer, note the seconds."""
        answer, seconds = work(), []
        for _ in range(self.repetitions):
            start = time.perf_counter()
            answer = work()
            seconds.append(time.perf_counter() - start)
        self.timings[phase] = seconds
        return answer

    def answer(
        self, points, cells, displacement, times=None, velocity=None, acceleration=None, **more
    ):
        """Write the answer of the level.

        Parameters
        ----------
        points, cells : (n, d), (m, d + 1) arrays
            The uncut body, conforming to the program's own cut, nodes doubled there.
        displacement : (n, d) or (t, n, d) array
            m.
        times : sequence of float, optional
            Output times in s, of a motion.
        velocity, acceleration : (t, n, d) arrays, optional
            m/s, m/s².
        more
            Further keys of ``solution.json``: ``unknowns``, ``cut_facets``, ``mass``, ``notes``, …
        """
        displacement = np.asarray(displacement, dtype=float)
        frames = displacement if displacement.ndim == 3 else displacement[None]
        if not np.isfinite(frames).all():
            raise RuntimeError("the displacement is not finite")
        files = []
        for k, frame in enumerate(frames):
            fields = {"displacement": frame}
            if velocity is not None:
                fields["velocity"] = velocity[k]
            if acceleration is not None:
                fields["acceleration"] = acceleration[k]
            files.append("solution.vtu" if len(frames) == 1 else f"solution-{k}.vtu")
            write_vtu(self.folder / files[-1], points, cells, fields)
        content = {"schema": 1, "files": files, "dimension": self.dimension, "order": 1,
                   "size": self.problem["size"], "timings": self.timings, **more}  # fmt: skip
        if times is not None:
            content["times"] = list(times)
        self._say(content)

    def refuse(self, why):
        """Answer that the program cannot do the case."""
        self._say({"schema": 1, "refused": why})

    def _say(self, content):
        text = json.dumps(content, default=lambda value: np.asarray(value).tolist())
        (self.folder / "solution.json").write_text(text, encoding="utf-8")


def run(solve, conforming=False):
    """Call ``solve(case)`` for ``program.py FOLDER LEVEL``; it may raise `RefusedError`."""
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} FOLDER LEVEL")
    case = Case(sys.argv[1], sys.argv[2], conforming)
    try:
        solve(case)
    except RefusedError as refusal:
        case.refuse(str(refusal))


def factor_at(history, time):
    """Return the factor of a support or load at a time, after a jump there; 1 without a table."""
    if history is None:
        return 1.0
    times, factors = np.array(history, dtype=float).T
    last = int(np.searchsorted(times, time, side="right"))
    if last in (0, len(times)):
        return float(factors[min(last, len(times) - 1)])
    return float(np.interp(time, times[last - 1 : last + 1], factors[last - 1 : last + 1]))


def parts(cells, nodes):
    """Return the number (n,) of the connected part that each of `nodes` nodes belongs to."""
    root = np.arange(nodes)
    while True:
        least = root[cells].min(axis=1)
        new = root.copy()
        np.minimum.at(new, cells, np.repeat(least[:, None], cells.shape[1], axis=1))
        new = new[new]
        if (new == root).all():
            return root
        root = new


def loose_parts(points, cells, held):
    """Centroids (k, d) of the parts that fewer components hold than a part has rigid motions.

    Parameters
    ----------
    points, cells : (n, d), (m, d + 1) arrays
        A mesh that is opened along the cuts. A static problem with a loose part has no answer,
        and direct solvers give one all the same.
    held : (n, d) bool array
    """
    part, rigid = parts(cells, len(points)), 3 if points.shape[1] == 2 else 6
    count = np.bincount(part, held.sum(axis=1), minlength=len(points))
    loose = [k for k in np.unique(part[cells[:, 0]]) if count[k] < rigid]
    return np.array([points[part == k].mean(axis=0) for k in loose]).reshape(-1, points.shape[1])


def read_vtu(path):
    """Return points (n, 3), the simplices (m, k) and the cell data of a VTU file."""
    root = ElementTree.parse(path).getroot()
    read = {
        (group.tag, array.get("Name")): _values(root, array)
        for group in root.iter()
        for array in group.findall("DataArray")
    }
    points = next(values for (group, _), values in read.items() if group == "Points")
    count = int(read["Cells", "offsets"][0])
    if not np.array_equal(
        np.diff(read["Cells", "offsets"], prepend=0) - count, 0 * read["Cells", "offsets"]
    ):
        raise RuntimeError(f"{path}: cells of several kinds; expected one")
    cells = read["Cells", "connectivity"].reshape(-1, count).astype(int)
    data = {name: values for (group, name), values in read.items() if group == "CellData"}
    return points.reshape(-1, 3), cells, data


def _values(root, array):
    kind, text = np.dtype(_NUMPY[array.get("type")]), array.text or ""
    if array.get("format") == "ascii":
        return np.array(text.split(), dtype=kind)
    head = np.dtype(_NUMPY[root.get("header_type", "UInt32")])
    text = text.strip()
    if not root.get("compressor"):
        return np.frombuffer(base64.b64decode(text)[head.itemsize :], dtype=kind)
    blocks = int(np.frombuffer(base64.b64decode(text[:24]), dtype=head, count=1)[0])
    words = 4 * -(-(3 + blocks) * head.itemsize // 3)  # characters of the head
    sizes = np.frombuffer(base64.b64decode(text[:words]), dtype=head, count=3 + blocks)[3:]
    data, ends = base64.b64decode(text[words:]), np.cumsum(sizes)
    whole = b"".join(zlib.decompress(data[e - s : e]) for s, e in zip(sizes, ends, strict=True))
    return np.frombuffer(whole, dtype=kind)


def write_vtu(path, points, cells, fields):
    """Write points (n, d), simplices (m, k) and point fields (n, d); vectors get a third 0."""
    m, k = np.shape(cells)
    vectors = {name: _three(values) for name, values in fields.items()}
    blocks = [
        f'<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" '
        f'header_type="UInt32"><UnstructuredGrid><Piece NumberOfPoints="{len(points)}" '
        f'NumberOfCells="{m}"><Points>{_array("Points", _three(points))}</Points><Cells>',
        _array("connectivity", np.asarray(cells, dtype="<i8")),
        _array("offsets", np.arange(1, m + 1, dtype="<i8") * k),
        _array("types", np.full(m, _VTK[k], dtype="u1")),
        "</Cells><PointData>",
        *(_array(name, values) for name, values in vectors.items()),
        "</PointData></Piece></UnstructuredGrid></VTKFile>",
    ]
    Path(path).write_text("\n".join(blocks), encoding="ascii")


def _three(values):
    whole = np.zeros((len(values), 3))
    whole[:, : np.shape(values)[1]] = values
    return whole


def _array(name, values):
    kind = {"f": "Float64", "i": "Int64", "u": "UInt8"}[values.dtype.kind]
    width = values.shape[1] if values.ndim == 2 and kind == "Float64" else 1
    data = values.tobytes()
    text = base64.b64encode(np.uint32(len(data)).tobytes() + data).decode("ascii")
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" '
        f'format="binary">{text}</DataArray>'
    )

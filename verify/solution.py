"""The neutral solution that every solver returns, whatever its method.

A `Solution` is a displacement field on a simplicial mesh of the uncut material configuration. The
mesh *conforms to the solver's own realised cut*: nodes are doubled on the cut. It has the solver's
regularisations too, but nothing about its own accuracy: `verify.compare` measures that.

Stored as one VTU file (mesh, fields) and one JSON file beside it (the rest). The same pair is
the file exchange for programs that are not written in Python.
"""

import json
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.files import read_json, whole_file, write_whole
from verify.read_mesh import read_with_meshio
from verify.result import Regularisation
from verify.solution_checks import (
    check_accounts,
    check_cells,
    check_field,
    check_mass,
    check_vectors,
    plain_mass,
    restored_mass,
)

__all__ = [
    "INTO_CELL", "SCHEMA_VERSION", "ContactPressure", "Regularisation", "Solution",
    "checked_solution", "read_solution", "write_solution",
]  # fmt: skip

SCHEMA_VERSION = 1

# VTK cell names by (dimension of the cells, order); node order is VTK's (corners, then edge
# mid-points)
_CELL_TYPES = {
    (2, 1): "triangle",
    (2, 2): "triangle6",
    (3, 1): "tetra",
    (3, 2): "tetra10",
}
_MANDATORY = ("schema", "files", "dimension", "order")
_OPTIONAL = (
    "cell_dimension", "times", "cut_facets", "ledger", "quantities", "unknowns", "size", "timings",
    "iterations", "regularisations", "notes", "mass", "contact",
)  # fmt: skip
# A node on the cut has no side, a point this share of the way to the centre of one of its cells
# has. The direction to the centre of a slender cell is no help: it runs along the cut.
INTO_CELL = 0.01
_NODES_PER_CELL = {"triangle": 3, "triangle6": 6, "tetra": 4, "tetra10": 10}


@dataclass(frozen=True)
class ContactPressure:
    """Pressure with which the faces of cuts press on each other, at points of the realised cuts.

    Attributes
    ----------
    points : (q, d) float array
        On the realised cut, in the undeformed body, m; of a rule of integration, or nodes.
    weights : (q,) float array
        Length (in space area) of the cut that each stands for, m or m²; they add up to the cuts
        whose faces may touch.
    pressure : (t, q) float array
        At each output time, Pa: positive where faces press, zero where they are apart.
    """

    points: NDArray[np.float64]
    weights: NDArray[np.float64]
    pressure: NDArray[np.float64]


@dataclass(frozen=True)
class Solution:
    """A displacement field on a mesh that conforms to the realised cut.

    Parameters
    ----------
    points : (n, d) float array
        Nodes in the material configuration, in metres; doubled on the cut.
    cells : (m, k) int array
        Simplices: k = d + 1 for order 1, VTK's quadratic simplex for order 2 (3, 6, 4 or 10
        nodes; corners first). A quadratic field is isoparametric. Triangles in space are a
        membrane.
    displacement : (t, n, d) float array
        Nodal displacement at each output time, in metres.
    times : (t,) float array
        Output times in seconds; ``[0.0]`` for a static solution.
    order : {1, 2}
        Polynomial order of the field.
    cut_facets : (f, d, d) float array
        The cut as realised: segments (2D) or triangles (3D) by their corner coordinates; of a
        membrane (f, 2, 3).
    cell_sides : (m,) int array
        Labels of the piece of material that a cell belongs to, if the solver knows them (0 away
        from the cut). Information for pictures; the comparison decides sides by geometry alone.
    velocity : (t, n, d) float array, optional
        Nodal velocity in m/s.
    acceleration : (t, n, d) float array, optional
        Nodal acceleration in m/s² that balances the forces of the field at that time. Without
        it there are no stress-intensity factors of a motion.
    mass : "consistent", (n,) array or (n, n) sparse array, optional
        Mass with which the solver moved, in kg (per metre of thickness in 2D): ∫ρ N_i N_j of the
        field, one mass per node, or a symmetric matrix on the nodes; with all cuts open. Gravity
        pulls at its row sums. Without it the kinetic energy is known within what lumping may do.
    contact : ContactPressure, optional
        Of a solver that knows contact, where the scene asks for it.
    ledger : dict of str to (t,) float array
        Energies by name (``"strain"``, ``"kinetic"``, …) at each output time, in joules (per
        metre of thickness in 2D), as the solver itself adds them up.
    quantities : dict of str to float
        Further scalar results of the solver's own, by the name of the quantity.
    unknowns : int
        Number of scalar unknowns of the solver's system, constrained ones included.
    size : float
        Characteristic element size h of the solver's mesh, in metres.
    timings : dict of str to list of float
        Wall seconds of each phase (``"meshing"``, ``"enrichment"``, ``"assembly"``,
        ``"factorisation"``, ``"solve"``), one entry per repetition; the first call
        (compilation) is not among them.
    iterations : dict of str to int
        Iterations by solver (``"newton"``, ``"cg"``).
    regularisations : list of Regularisation
        Everything that was dropped, snapped, clamped, scaled or floored.
    notes : dict of str to str
        Versions and choices (linear solver, basis, mesh generator …).
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    displacement: NDArray[np.float64]
    times: NDArray[np.float64] = field(default_factory=lambda: np.zeros(1))
    order: int = 1
    cut_facets: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2, 2)))
    cell_sides: NDArray[np.int64] | None = None
    velocity: NDArray[np.float64] | None = None
    acceleration: NDArray[np.float64] | None = None
    ledger: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    quantities: dict[str, float] = field(default_factory=dict)
    unknowns: int = 0
    size: float = float("nan")
    timings: dict[str, list[float]] = field(default_factory=dict)
    iterations: dict[str, int] = field(default_factory=dict)
    regularisations: list[Regularisation] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    mass: Any = None
    contact: ContactPressure | None = None

    def __post_init__(self) -> None:
        """Refuse a malformed solution, so that a wrong solver fails here, not later.

        Raises
        ------
        InputError
            Naming the field, what it is, and what was expected.
        """
        check_field("points", self.points, (None, None))
        n, d = self.points.shape
        if isinstance(self.order, bool) or (d, self.order) not in _CELL_TYPES:
            text = f"a solution of dimension {d} and order {self.order!r}"
            raise InputError(f"{text}; expected 2 or 3, and 1 or 2")
        fit = dict.fromkeys(_CELL_TYPES[k, self.order] for k in (d, 2))
        check_cells(self.points, self.cells, {_NODES_PER_CELL[name]: name for name in fit})
        check_field("times", self.times, (None,))
        t = len(self.times)
        if not t or (np.diff(self.times) <= 0.0).any():
            raise InputError(f"times {self.times.tolist()[:20]}; expected ascending, at least one")
        check_field("displacement", self.displacement, (t, n, d))
        if self.velocity is not None:
            check_field("velocity", self.velocity, (t, n, d))
        if self.acceleration is not None:
            check_field("acceleration", self.acceleration, (t, n, d))
        check_vectors("cut_facets", self.cut_facets, [(self.cell_dimension, d)])
        if self.cell_sides is not None:
            check_field("cell_sides", self.cell_sides, (len(self.cells),))
        check_mass(self.mass, n)
        if self.contact is not None:
            check_field("contact.points", self.contact.points, (None, d))
            count = len(self.contact.points)
            check_field("contact.weights", self.contact.weights, (count,))
            check_field("contact.pressure", self.contact.pressure, (t, count))
        for name, column in self.ledger.items():
            check_field(f"ledger '{name}'", np.asarray(column), (t,))
        check_accounts(
            self.size, self.unknowns, self.timings, self.iterations, self.quantities, self.notes
        )
        entries: list[Any] = list(self.regularisations)
        for entry in entries:
            if not isinstance(entry, Regularisation):
                text = f"regularisations: of type '{type(entry).__name__}'"
                raise InputError(f"{text}; expected Regularisation")

    @property
    def dimension(self) -> int:
        """Space dimension, 2 or 3."""
        return int(self.points.shape[1])

    @property
    def cell_dimension(self) -> int:
        """Dimension of the cells: 2 for a membrane in space, else the space dimension."""
        return 2 if self.cells.shape[1] == _NODES_PER_CELL[_CELL_TYPES[2, self.order]] else 3

    @property
    def cell_type(self) -> str:
        """VTK (meshio) name of the cells."""
        return _CELL_TYPES[self.cell_dimension, self.order]


def checked_solution(answer: Any) -> Solution:
    """Return what a solver answered, checked anew: its arrays may have changed since it was made.

    Raises
    ------
    InputError
        If it is no `Solution`, or not a whole one.
    """
    if not isinstance(answer, Solution):
        kind = "None" if answer is None else f"a '{type(answer).__name__}'"
        raise InputError(f"the solver returned {kind}; expected a verify.solution.Solution")
    return Solution(**{entry.name: getattr(answer, entry.name) for entry in fields(Solution)})


def write_solution(solution: Solution, path: Path, compression: str | None = "zlib") -> None:
    """Write `solution` as ``path.vtu`` (or one VTU per output time) and ``path.json``.

    Each in one step, the JSON file last, so that its presence means that the solution is whole.

    Parameters
    ----------
    solution : Solution
    path : Path
        Path without ending, e.g. ``out/solution``.
    compression : str, optional
        Of the arrays of the VTU; None for files that are compressed as a whole.
    """
    import meshio

    path.parent.mkdir(parents=True, exist_ok=True)
    points = np.zeros((len(solution.points), 3))
    points[:, : solution.dimension] = solution.points
    sides = solution.cell_sides
    names = _vtu_names(path, len(solution.times))
    for step, name in enumerate(names):
        fields = {"displacement": _three(solution.displacement[step])}
        if solution.velocity is not None:
            fields["velocity"] = _three(solution.velocity[step])
        if solution.acceleration is not None:
            fields["acceleration"] = _three(solution.acceleration[step])
        mesh = meshio.Mesh(
            points,
            [(solution.cell_type, solution.cells)],
            point_data=fields,
            cell_data={} if sides is None else {"side": [sides.astype(np.int32)]},
        )
        with whole_file(path.parent / name) as partial:
            mesh.write(partial, file_format="vtu", compression=compression)
    record = {
        "schema": SCHEMA_VERSION,
        "files": names,
        "dimension": solution.dimension,
        "cell_dimension": solution.cell_dimension,
        "order": solution.order,
        "times": solution.times.tolist(),
        "cut_facets": solution.cut_facets.tolist(),
        "ledger": {n: np.asarray(v, dtype=float).tolist() for n, v in solution.ledger.items()},
        "quantities": solution.quantities,
        "unknowns": int(solution.unknowns),
        "size": float(solution.size) if np.isfinite(solution.size) else None,
        "timings": solution.timings,
        "iterations": solution.iterations,
        "regularisations": [vars(entry) for entry in solution.regularisations],
        "notes": solution.notes,
        "mass": plain_mass(solution.mass),
    }
    if (contact := solution.contact) is not None:
        record["contact"] = {name: value.tolist() for name, value in vars(contact).items()}
    write_whole(path.with_suffix(".json"), json.dumps(record, indent=1))


def read_solution(path: Path) -> Solution:
    """Read what `write_solution`, or another program, wrote.

    Of the JSON half only ``schema``, ``files``, ``dimension`` and ``order`` are mandatory, and
    ``times`` if there are several files; the rest has the defaults of `Solution`. Of the VTU
    half, points, cells and the point data ``displacement`` are.

    Parameters
    ----------
    path : Path
        Path without ending, as for `write_solution`.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        If a file is missing, damaged or not of this form.
    """
    source = path.with_suffix(".json")
    record = read_json(source, "the JSON half of a solution")
    _check_record(record, str(source))
    try:
        d, order, files = int(record["dimension"]), int(record["order"]), record["files"]
        if (d, order) not in _CELL_TYPES:
            raise InputError(f"dimension {d}, order {order}; expected 2 or 3, and 1 or 2")
        k = int(record.get("cell_dimension", d))
        if k not in (2, d):
            raise InputError(f"cell_dimension {k} in {d}D; expected {d}, or 2 for a membrane")
        cell_type = _CELL_TYPES[k, order]
        meshes = [_read_vtu(path.parent / name, cell_type) for name in files]
        first, times = meshes[0], record.get("times", [0.0] if len(files) == 1 else None)
        if times is None or len(times) != len(files):
            raise InputError(f"times {times} for {len(files)} files; expected one each")
        _check_same_mesh(meshes, files, cell_type, str(source))
        sides = first.cell_data_dict.get("side", {}).get(cell_type)
        size = record.get("size")
        return Solution(
            points=np.ascontiguousarray(first.points[:, :d], dtype=float),
            cells=first.cells_dict[cell_type].astype(np.int64),
            displacement=np.stack([_vectors(m, "displacement", d) for m in meshes]),
            times=np.asarray(times, dtype=float),
            order=order,
            cut_facets=np.asarray(record.get("cut_facets", []), dtype=float).reshape(-1, k, d),
            cell_sides=None if sides is None else np.asarray(sides, dtype=np.int64),
            velocity=_over_time(meshes, "velocity", d),
            acceleration=_over_time(meshes, "acceleration", d),
            ledger={n: np.asarray(v, dtype=float) for n, v in record.get("ledger", {}).items()},
            quantities={n: float(v) for n, v in record.get("quantities", {}).items()},
            unknowns=int(record.get("unknowns", 0)),
            size=float("nan") if size is None else float(size),
            timings={n: [float(t) for t in v] for n, v in record.get("timings", {}).items()},
            iterations={n: int(v) for n, v in record.get("iterations", {}).items()},
            regularisations=[Regularisation(**e) for e in record.get("regularisations", [])],
            notes={n: str(v) for n, v in record.get("notes", {}).items()},
            mass=restored_mass(record.get("mass"), len(first.points)),
            contact=_read_contact(record.get("contact"), d),
        )
    except InputError as error:
        raise error if error.where else InputError(error.what, str(source)) from None
    except Exception as error:
        text = f"not a readable solution ({type(error).__name__}: {error})"
        raise InputError(text, str(source)) from None


def _read_contact(entry: Any, dimension: int) -> ContactPressure | None:
    if entry is None:
        return None
    points, weights, pressure = (
        np.asarray(entry[name], dtype=float) for name in ("points", "weights", "pressure")
    )
    count = len(weights)
    return ContactPressure(points.reshape(count, dimension), weights, pressure.reshape(-1, count))


def _check_record(record: Any, where: str) -> None:
    """Refuse a record of another schema, without a mandatory key or with an unknown one."""
    if record.get("schema") != SCHEMA_VERSION:
        raise InputError(f"schema {record.get('schema')!r}; expected {SCHEMA_VERSION}", where)
    if missing := [key for key in _MANDATORY if key not in record]:
        text = f"'{missing[0]}' is missing; expected at least {', '.join(_MANDATORY)}"
        raise InputError(text, where)
    files = record["files"]
    if not isinstance(files, list) or not files or not all(isinstance(f, str) for f in files):
        raise InputError(f"files {files!r}; expected a list of VTU files, one per time", where)
    known = (*_MANDATORY, *_OPTIONAL)
    for key in record:
        if key not in known:
            raise InputError(f"unknown key '{key}'{_nearest(key, known)}", where)


def _read_vtu(path: Path, cell_type: str) -> Any:
    """Read a VTU file with cells of one type and a displacement at its points."""
    mesh = read_with_meshio(path, "vtu", "the VTU half of a solution")
    found = sorted({block.type for block in mesh.cells if len(block.data)})
    if cell_type not in mesh.cells_dict:
        raise InputError(f"has {', '.join(found) or 'no cells'}; expected {cell_type}", str(path))
    bulk = {2: ("triangle", "quad"), 3: ("tetra", "hexa", "wedge", "pyramid")}
    dimension = 2 if cell_type.startswith("triangle") else 3
    others = [f for f in found if f != cell_type and f.startswith(bulk[dimension])]
    if others:
        text = f"has {', '.join(others)} beside {cell_type}; expected one type"
        raise InputError(text, str(path))
    if "displacement" not in mesh.point_data:
        has = ", ".join(mesh.point_data) or "none"
        raise InputError(f"no point data 'displacement' (it has: {has})", str(path))
    return mesh


def _vectors(mesh: Any, name: str, dimension: int) -> NDArray[np.float64]:
    """Point data (n, d) of a VTU file, whose vectors may have three components in 2D too."""
    values = np.asarray(mesh.point_data[name], dtype=float)
    if values.ndim != 2 or values.shape[1] < dimension:
        raise InputError(f"{name} of shape {values.shape}; expected vectors")
    return np.ascontiguousarray(values[:, :dimension])


def _over_time(meshes: list[Any], name: str, dimension: int) -> NDArray[np.float64] | None:
    """Point data (t, n, d) that all files have, or None."""
    if not all(name in mesh.point_data for mesh in meshes):
        return None
    return np.stack([_vectors(mesh, name, dimension) for mesh in meshes])


def _check_same_mesh(meshes: list[Any], files: list[str], cell_type: str, where: str) -> None:
    """All times share points and cells: points are material, never moved by the displacement."""
    first = meshes[0]
    for name, mesh in zip(files[1:], meshes[1:], strict=True):
        same = (
            mesh.points.shape == first.points.shape
            and np.array_equal(mesh.points, first.points)
            and np.array_equal(mesh.cells_dict[cell_type], first.cells_dict[cell_type])
        )
        if not same:
            text = f"points or cells of {name} are not those of {files[0]}; "
            raise InputError(text + "expected the same material mesh at all times", where)


def _nearest(key: str, known: tuple[str, ...]) -> str:
    close = get_close_matches(key, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else f"; known: {', '.join(known)}"


def _three(field_values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pad vectors (n, 2) to (n, 3), which VTK wants."""
    vectors = np.zeros((len(field_values), 3))
    vectors[:, : field_values.shape[1]] = field_values
    return vectors


def _vtu_names(path: Path, steps: int) -> list[str]:
    if steps == 1:
        return [f"{path.name}.vtu"]
    return [f"{path.name}-{step:05d}.vtu" for step in range(steps)]

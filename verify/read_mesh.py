"""Mesh files of others: whatever a reader meets, one error, and never for ever.

At the end of some files that are cut off (PLY, Nastran) meshio reads on for ever; on others it
prints and leaves the interpreter. What meshio does not read, gmsh may, as a program of its own.
"""

import contextlib
import io
import os
import signal
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.printable import one_line, words_of

Ints = NDArray[np.int64]

_SECONDS, _SECONDS_PER_MB = 5.0, 4.0  # of processor time; meshio reads a megabyte in less than one
_BY_GMSH = {".msh", ".bdf", ".nas", ".unv", ".med", ".mesh", ".inp", ".stl", ".vtk"}
_GMSH_PROGRAM = "reference.meshing.gmsh_file"
_TAGS = {"gmsh:physical", "medit:ref"}  # cell data that a format has for groups: 0 is none
_NO_TAGS = {"gmsh:geometrical"}
_XDMF_KINDS = {
    "polyvertex": "vertex", "polyline": "line", "triangle": "triangle", "quadrilateral": "quad",
    "tetrahedron": "tetra", "hexahedron": "hexahedron", "wedge": "wedge", "pyramid": "pyramid",
}  # fmt: skip
_DIMENSIONS = {
    "vertex": 0, "line": 1, "triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3,
    "wedge": 3, "pyramid": 3,
}  # fmt: skip
_FEW = 20
_MOST_VALUES = 200  # of a cell array that tells groups apart


@dataclass
class RawMesh:
    """A mesh as its file has it.

    Attributes
    ----------
    points : (n, d) array
    blocks : list
        Kind of cell as meshio calls it, and cells (m, k).
    groups : dict
        Cells of each named set: pairs of a block and rows in it.
    nodes : dict
        Nodes of each named set of nodes.
    """

    points: NDArray[np.float64]
    blocks: list[tuple[str, Ints]]
    groups: dict[str, list[tuple[int, Ints]]] = field(default_factory=dict)
    nodes: dict[str, Ints] = field(default_factory=dict)

    def add(self, name: str, block: int, rows: Ints) -> None:
        """Add rows of a block to a group."""
        if len(rows):
            self.groups.setdefault(name.strip(), []).append((block, rows))


def read_raw(path: Path) -> RawMesh:
    """Read a mesh with its groups, by meshio or by gmsh where that is installed.

    Raises
    ------
    InputError
        If nothing reads it, with the reason of the reader.
    """
    if path.suffix.lower() in (".xdmf", ".xmf") and (found := _read_xdmf(path)):
        return found
    try:
        mesh = _of_meshio(read_with_meshio(path))
    except InputError as error:
        if not path.is_file() or path.suffix.lower() not in _BY_GMSH:
            raise
        if find_spec("gmsh") is None or find_spec("reference") is None:
            hint = "; gmsh may read it: pip install 'cutting-verification[gmsh]'"
            raise InputError(f"{error.what}{hint}", str(path)) from None
        return _by_gmsh(path, error.what)
    return mesh


def _of_meshio(mesh: Any) -> RawMesh:
    """Take points, cells and groups from what meshio has read."""
    blocks = [(block.type, np.asarray(block.data)) for block in mesh.cells]
    raw = RawMesh(np.asarray(mesh.points, dtype=float), blocks)
    sets = {k: v for k, v in (mesh.cell_sets or {}).items() if not k.startswith("gmsh:")}
    for name, given in sets.items():
        # sets of sets (Abaqus) come as lists of lists
        for rows in given if given and isinstance(given[0], list) else [given]:
            for block, chosen in enumerate(rows[: len(blocks)]):
                if chosen is not None:
                    raw.add(str(name), block, np.asarray(chosen, dtype=np.int64))
    names = {(int(v[0]), int(v[1])): k for k, v in (mesh.field_data or {}).items() if len(v) == 2}
    for key, arrays in (mesh.cell_data or {}).items():
        if key in _NO_TAGS or key.startswith("vtk"):
            continue
        if key == "cell_tags" and getattr(mesh, "cell_tags", None):  # MED: names of families
            for block, ids in enumerate(arrays):
                for family, called in mesh.cell_tags.items():
                    for name in called:
                        raw.add(name, block, np.flatnonzero(np.asarray(ids) == family))
        else:
            _add_values(raw, key, arrays, names)
    for name, chosen in (mesh.point_sets or {}).items():
        raw.nodes[str(name)] = np.asarray(chosen, dtype=np.int64)
    return raw


def _add_values(raw: RawMesh, key: str, arrays: Any, names: dict[tuple[int, int], str]) -> None:
    """Add a group for each value of whole-numbered cell data, with the value as its name."""
    values = [np.asarray(one) for one in arrays]
    values = [one[:, 0] if one.ndim == 2 and one.shape[1] == 1 else one for one in values]
    if any(one.ndim != 1 or not np.issubdtype(one.dtype, np.integer) for one in values):
        return
    every = np.concatenate([*values, np.zeros(0, dtype=int)])
    distinct = np.unique(every)
    if len(distinct) > _MOST_VALUES or (len(every) > _FEW and len(distinct) == len(every)):
        return  # numbers of cells
    for block, ids in enumerate(values):
        dimension = dimension_of(raw.blocks[block][0]) or 0
        for value in np.unique(ids):
            name = names.get((int(value), dimension)) if key in _TAGS else None
            if key in _TAGS and (value == 0 or (name in raw.groups and _has(raw, name, block))):
                continue
            text = name or (str(value) if key in _TAGS else f"{key}={value}")
            raw.add(text, block, np.flatnonzero(ids == value))


def _has(raw: RawMesh, name: str | None, block: int) -> bool:
    return any(own == block for own, _ in raw.groups.get(name or "", []))


def base_of(kind: str) -> str:
    """Kind of the straight cell with the corners of a cell, which come first in it."""
    base = kind.rstrip("0123456789").removeprefix("VTK_LAGRANGE_").lower()
    return {"quadrilateral": "quad", "curve": "line", "tetrahedron": "tetra"}.get(base, base)


def dimension_of(kind: str) -> int | None:
    """Dimension of a kind of cell that is straight or taken by its corners, or None."""
    return _DIMENSIONS.get(base_of(kind))


def _read_xdmf(path: Path) -> RawMesh | None:
    """Read an XDMF file as FEniCSx writes it: a mesh, and tags of its cells and facets.

    None if it is written in another way, which meshio may know.
    """
    try:
        grids = ElementTree.fromstring(path.read_bytes()).findall("./Domain/Grid")
    except (OSError, ElementTree.ParseError):
        return None
    raw = RawMesh(np.zeros((0, 3)), [])
    for grid in grids:
        topology, geometry = grid.find("Topology"), grid.find("Geometry")
        if topology is None or grid.get("GridType", "Uniform") != "Uniform":
            continue
        kind = _XDMF_KINDS.get(topology.get("TopologyType", "").lower().split("_")[0])
        cells = _xdmf_array(topology.find("DataItem"), path)
        places = None if geometry is None else _xdmf_array(geometry.find("DataItem"), path)
        if kind is None or cells is None or cells.ndim != 2 or (places is None and not raw.blocks):
            return None
        if places is not None and not raw.blocks:
            raw.points = np.asarray(places, dtype=float)
        raw.blocks.append((kind, cells.astype(np.int64)))
        for attribute in grid.findall("Attribute"):
            values = _xdmf_array(attribute.find("DataItem"), path)
            if attribute.get("Center") == "Cell" and values is not None:
                ids = values.reshape(len(values), -1)
                for value in np.unique(ids) if ids.shape[1] == 1 else []:
                    name = f"{attribute.get('Name')}={value:.0f}"
                    raw.add(name, len(raw.blocks) - 1, np.flatnonzero(ids[:, 0] == value))
    return raw if raw.blocks else None


def _xdmf_array(item: Any, path: Path) -> NDArray[Any] | None:
    """Return the array of a data item, in the file itself or in HDF5 beside it; or None."""
    if item is None or not item.text:
        return None
    shape = [int(n) for n in item.get("Dimensions", "").split()]
    if item.get("Format") == "XML":
        return np.array(item.text.split(), dtype=float).reshape(shape)
    if item.get("Format") != "HDF":
        return None
    try:
        import h5py
    except ModuleNotFoundError:
        text = "its numbers are in HDF5, which needs the package 'h5py'"
        raise InputError(f"{text}: pip install 'cutting-verification[hdf5]'", str(path)) from None
    name, _, place = item.text.strip().partition(":")
    try:
        with h5py.File(path.parent / name, "r") as file:
            return np.asarray(file[place])
    except (OSError, KeyError) as error:
        text = f"'{name}' beside it has no '{place}' that can be read ({words_of(error)})"
        raise InputError(text, str(path)) from None


def _by_gmsh(path: Path, first_reason: str) -> RawMesh:
    """Let gmsh read a file, in a process of its own: a bad file may end it."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "mesh.npz"
        seconds = 30.0 + _SECONDS_PER_MB * os.path.getsize(path) / 1e6
        command = [sys.executable, "-m", _GMSH_PROGRAM, str(path), str(out)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=seconds, check=False
            )
            said = done.stderr.strip().splitlines()[-1:] or [f"ended with {done.returncode}"]
        except subprocess.TimeoutExpired:
            said = [f"not read after {seconds:.3g} s"]
        if not out.is_file():
            text = f"{first_reason.removesuffix(')')}; gmsh: {one_line(said[0])})"
            raise InputError(text, str(path))
        with np.load(out) as found:
            kinds, sets = [str(k) for k in found["kinds"]], found["groups"].tolist()
            raw = RawMesh(found["points"], [(k, found[f"b{i}"]) for i, k in enumerate(kinds)])
    for block, name in sets:
        raw.add(name, int(block), np.arange(len(raw.blocks[int(block)][1])))
    return raw


def read_with_meshio(path: Path, file_format: str | None = None, what: str = "a mesh") -> Any:
    """Read a mesh.

    Parameters
    ----------
    path : Path
    file_format : str, optional
        As meshio calls it; default: by the ending of `path`.
    what : str
        Expected kind of file, for the message.

    Raises
    ------
    InputError
        If it is not there, no plain file, or meshio cannot read it.
    """
    import meshio

    if not path.is_file():
        kind = "is no plain file" if path.exists() else "no such file"
        raise InputError(f"{kind}; expected {what}", str(path))
    seconds = _SECONDS + _SECONDS_PER_MB * os.path.getsize(path) / 1e6
    printed = io.StringIO()
    try:
        with (
            contextlib.redirect_stderr(printed),
            contextlib.redirect_stdout(printed),
            warnings.catch_warnings(),
            _limited(seconds),
        ):
            warnings.simplefilter("ignore")
            return meshio.read(path, file_format=file_format)
    except (Exception, SystemExit) as error:
        if (patched := _older_vtu(path, file_format)) is not None:
            with tempfile.TemporaryDirectory() as folder:
                copy = Path(folder) / path.name
                copy.write_bytes(patched)
                return read_with_meshio(copy, file_format, what)
        reason = _reason(error, printed.getvalue())
        raise InputError(f"not {what} that meshio can read ({reason})", str(path)) from None


def _older_vtu(path: Path, file_format: str | None) -> bytes | None:
    """Return a VTU file of version 2 as one of version 1, which has the same cells; or None."""
    if path.suffix.lower() != ".vtu" and file_format != "vtu":
        return None
    content = path.read_bytes()
    head, tag, rest = content.partition(b'version="2.')
    if not tag or b"<VTKFile" not in head or b"<UnstructuredGrid" in head:
        return None
    return head + b'version="1.0"' + rest.partition(b'"')[2]


def _reason(error: BaseException, printed: str) -> str:
    """Say why a file is not read: what meshio prints before it leaves, or its exception."""
    if isinstance(error, SystemExit) and (said := printed.split()):
        return one_line(" ".join(said).removeprefix("Error: "))
    if isinstance(error, ModuleNotFoundError):
        return f"this format needs the package '{error.name}': pip install {error.name}"
    return words_of(error).removesuffix(": 1")


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise TimeoutError after so much processor time; only the main thread can be stopped."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"not read after {seconds:.3g} s of processor time")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)

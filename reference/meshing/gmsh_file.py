"""A mesh file read by gmsh, as a program: ``python -m reference.meshing.gmsh_file IN OUT.npz``.

OUT has the points, for each entity with elements a block of their corners, and the names of the
physical groups of the blocks; in formats that have none, the numbers of entities, which are the
properties of Nastran and the solids of an STL. Elements of higher order are taken by their corners.
"""

import sys
import tempfile
from pathlib import Path
from shutil import copyfile
from typing import Any

import gmsh
import numpy as np

# by dimension and number of corners, as meshio calls them
_KINDS = {
    (0, 1): "vertex", (1, 2): "line", (2, 3): "triangle", (2, 4): "quad", (3, 4): "tetra",
    (3, 5): "pyramid", (3, 6): "wedge", (3, 8): "hexahedron",
}  # fmt: skip


def main(source: str, out: str) -> None:
    """Read a mesh file and write what it holds."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"mesh{Path(source).suffix.lower()}"  # away from option files
        copyfile(source, copy)
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        try:
            gmsh.merge(str(copy))
            _write(out, has_names=copy.suffix == ".msh")
        finally:
            gmsh.finalize()


def _write(out: str, has_names: bool) -> None:
    tags, places, _ = gmsh.model.mesh.getNodes()
    if not len(tags):
        raise SystemExit("it has no nodes")
    number = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    blocks: dict[str, Any] = {}
    kinds: list[str] = []
    groups: list[tuple[str, str]] = []
    has_names = has_names or bool(gmsh.model.getPhysicalGroups())
    for dimension, entity in gmsh.model.getEntities():
        names = [
            gmsh.model.getPhysicalName(dimension, int(tag)) or str(tag)
            for tag in gmsh.model.getPhysicalGroupsForEntity(dimension, entity)
        ]
        names = names if has_names else [str(entity)]
        types, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
        for kind, own in zip(types, nodes, strict=True):
            _, _, _, count, _, corners = gmsh.model.mesh.getElementProperties(kind)
            cells = number[own.astype(np.int64)].reshape(-1, count)[:, :corners]
            groups += [(str(len(kinds)), name) for name in names]
            blocks[f"b{len(kinds)}"] = cells
            kinds.append(_KINDS.get((dimension, corners), f"element {kind}"))
    if not kinds:
        raise SystemExit("it has no elements")
    np.savez(
        out,
        points=places.reshape(-1, 3),
        kinds=np.array(kinds),
        groups=np.array(groups, dtype=str).reshape(-1, 2),
        **blocks,
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])

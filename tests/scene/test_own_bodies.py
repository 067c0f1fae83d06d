"""Bodies of files that people have: their groups, kinds of cells, units; and refused files."""

import itertools
import json
import sys

import meshio
import numpy as np
import pytest
from independent_p1 import energy, energy_of_field
from scipy.spatial import cKDTree

from verify.cli import main
from verify.compare.outer_work import nodes_held
from verify.errors import InputError
from verify.exchange import export_case, problem_of
from verify.geometry.simplices import measures
from verify.runner.checking import check_scene
from verify.scene import load_scene, read_mesh, restore_scene, scene_content
from verify.scene.mesh_file import read_body
from verify.solvers import find_solver
from verify.solvers.xfem import XfemSolver
from verify.xfem.mesh import box_mesh

CASE = """
title = "A body of one's own"
requirement = "It shall hang."
[geometry]
kind = "file"
file = "{file}"
dimension = 3
{geometry}
[mesh]
pattern = "given"
[material]
young = 1e4
poisson = 0.3
density = 1000.0
[[material.regions]]
where = "{hard}"
young = 5e4
[[supports]]
where = "{held}"
displacement = [0.0, 0.0, 0.0]
[[supports]]
where = "{held_too}"
displacement = [0.0, 0.0, 0.0]
[[loads]]
kind = "gravity"
acceleration = [1.0, 2.0, -9.81]
[[cuts]]
kind = "polygon"
points = {cut}
"""
NORMAL, MIDDLE = np.array([0.98, 0.1, -0.08]), np.array([0.49, 0.5, 0.5])


def case(folder, file, turn=None, hard="group:hard", held="group:left", held_too="group:right",
         geometry=""):  # fmt: skip
    turn = np.eye(3) if turn is None else turn
    across = np.linalg.svd(NORMAL[None])[2][1:]
    corners = [MIDDLE + 9 * (a * across[0] + b * across[1])
               for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]  # fmt: skip
    text = CASE.format(
        file=file, hard=hard, held=held, held_too=held_too, geometry=geometry,
        cut=(np.array(corners) @ turn).tolist(),
    )  # fmt: skip
    (folder / "case.toml").write_text(text)
    return load_scene(folder / "case.toml")


def block(seed, count=3):
    """A cube of tetrahedra, which of them are hard, its ends, and a turn: in general position."""
    mesh = box_mesh((count,) * 3, (0.0,) * 3, (1.0,) * 3)
    points, cells = mesh.points, mesh.cells
    rng = np.random.default_rng(seed)
    inner = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points = points + np.where(inner[:, None], rng.uniform(-0.05, 0.05, points.shape), 0.0)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    hard = rng.random(len(cells)) < 0.4  # a sponge: groups of any shape
    ends = [faces(cells, np.abs(points[:, 0] - x) < 1e-9) for x in (0.0, 1.0)]
    return points, cells, hard, ends, turn


def faces(cells, on):
    """Facets of cells of which all corners are `on`."""
    facets = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
    return np.unique(facets[on[facets].all(axis=1)], axis=0)


def write(folder, form, points, cells, hard, ends):
    """Write a body with its groups in one of the formats that people have; name of the groups."""
    triangles = np.concatenate(ends)
    blocks = [("tetra", cells), ("triangle", triangles)]
    side = np.repeat([3, 4], [len(ends[0]), len(ends[1])])
    ids = [np.where(hard, 2, 1), side]
    names = {"hard": (2, 3), "left": (3, 2), "right": (4, 2)}
    fields = {name: np.array(value) for name, value in names.items()}
    if form == "gmsh22":
        data = {"gmsh:physical": ids, "gmsh:geometrical": ids}
        mesh = meshio.Mesh(points, blocks, cell_data=data, field_data=fields)
        mesh.write(folder / "body.msh", file_format=form, binary=True)
        return "body.msh", ["group:hard", "group:left", "group:right"]
    if form == "gmsh":
        parts = [(3, cells[~hard], [1]), (3, cells[hard], [2, 1])]  # hard ones in two groups
        parts += [(2, ends[0], [3]), (2, ends[1], [4])]
        (folder / "body.msh").write_text(msh41(points, parts, {**names, "all": (1, 3)}))
        return "body.msh", ["group:hard", "group:left", "group:right"]
    if form == "medit":
        meshio.Mesh(points, blocks, cell_data={"medit:ref": ids}).write(folder / "body.mesh")
        return "body.mesh", ["group:2", "group:3", "group:4"]
    if form == "vtk":
        meshio.Mesh(points, blocks, cell_data={"part": ids}).write(folder / "body.vtu")
        return "body.vtu", ["group:part=2", "group:part=3", "group:part=4"]
    if form == "abaqus":
        ends_of = {name: np.unique(end) for name, end in zip(("L", "R"), ends, strict=True)}
        lines = ["*NODE"]
        lines += [f"{i + 1}, " + ", ".join(map(repr, p.tolist())) for i, p in enumerate(points)]
        lines.append("*ELEMENT, TYPE=C3D4")
        lines += [f"{i + 1}, " + ", ".join(map(str, c + 1)) for i, c in enumerate(cells)]
        lines += ["*ELSET, ELSET=HARD", *(f"{i + 1}," for i in np.flatnonzero(hard))]
        for name, nodes in ends_of.items():
            lines += [f"*NSET, NSET={name}", *(f"{i + 1}," for i in nodes)]
        (folder / "body.inp").write_text("\n".join(lines) + "\n")
        return "body.inp", ["group:HARD", "group:L", "group:R"]
    assert form == "xdmf"
    grids = [("cells", "Tetrahedron", cells, ids[0]), ("facets", "Triangle", triangles, side)]
    text = '<Xdmf Version="3.0"><Domain><Grid Name="mesh" GridType="Uniform">'
    text += (
        topology("Tetrahedron", cells) + f"<Geometry GeometryType='XYZ'>{item(points)}</Geometry>"
    )
    for name, kind, some, values in grids:
        text += f'</Grid><Grid Name="{name}" GridType="Uniform">{topology(kind, some)}'
        text += f'<Attribute Name="{name}" Center="Cell">{item(values[:, None])}</Attribute>'
    (folder / "body.xdmf").write_text(text + "</Grid></Domain></Xdmf>")
    return "body.xdmf", ["group:cells=2", "group:facets=3", "group:facets=4"]


def msh41(points, parts, names):
    """A file of gmsh 4.1: of each part its dimension, cells, and the tags of its groups."""
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dim} {tag} "{name}"' for name, (tag, dim) in names.items()]
    counts = [sum(dim == d for dim, _, _ in parts) for d in range(4)]
    lines += ["$EndPhysicalNames", "$Entities", " ".join(map(str, counts))]
    order = sorted(range(len(parts)), key=lambda i: parts[i][0])
    for i in order:
        dim, _, tags = parts[i]
        box = "0 0 0 1 1 1" if dim else "0 0 0"
        lines.append(f"{i + 1} {box} {len(tags)} {' '.join(map(str, tags))} 0")
    n = len(points)
    lines += ["$EndEntities", "$Nodes", f"1 {n} 1 {n}", f"3 1 0 {n}", *map(str, range(1, n + 1))]
    lines += [" ".join(map(repr, point.tolist())) for point in points]
    total = sum(len(cells) for _, cells, _ in parts)
    lines += ["$EndNodes", "$Elements", f"{len(parts)} {total} 1 {total}"]
    number = 0
    for i in order:
        dim, cells, _ = parts[i]
        lines.append(f"{dim} {i + 1} {dim if dim < 3 else 4} {len(cells)}")
        for cell in cells:
            number += 1
            lines.append(f"{number} " + " ".join(map(str, np.asarray(cell) + 1)))
    return "\n".join([*lines, "$EndElements", ""])


def topology(kind, cells):
    return f'<Topology TopologyType="{kind}">{item(cells)}</Topology>'


def item(values):
    rows = "\n".join(" ".join(map(repr, row)) for row in values.tolist())
    return f'<DataItem Dimensions="{len(values)} {len(values[0])}" Format="XML">{rows}</DataItem>'


def measured(scene):
    """Strain energy of the answer of xfem, from its linear pieces."""
    found = XfemSolver().solve(scene, 0, 0)
    moduli = scene.material.at(found.points[found.cells].mean(axis=1))
    lam = moduli.young * 0.3 / (1.3 * 0.4)
    return energy_of_field(
        found.points, found.cells, found.displacement[0], lam, moduli.young / 2.6
    )


def expected(points, cells, hard, ends, turn):
    """The energy by the independent program; its body is not turned, its weight is."""
    gravity = turn @ np.array([1.0, 2.0, -9.81])
    young = np.where(hard, 5e4, 1e4)
    held = np.unique(np.concatenate(ends))
    return energy(points, cells, young, 0.3, 1000.0, gravity, held, (MIDDLE, NORMAL))


@pytest.mark.parametrize(
    ("form", "seed"),
    [*zip(("gmsh22", "gmsh", "medit", "vtk", "abaqus", "xdmf"), range(6), strict=True)],
)
def test_groups_of_files_give_the_energy_of_an_independent_program(tmp_path, form, seed):
    """Materials by groups of cells, clamps by groups of facets; 1e-9 is of both solves."""
    points, cells, hard, ends, turn = block(seed)
    file, names = write(tmp_path, form, points @ turn, cells, hard, ends)
    scene = case(tmp_path, file, turn, *names)
    value = expected(points, cells, hard, ends, turn)
    assert measured(scene) == pytest.approx(value, rel=1e-9)
    if seed == 0:  # the materials matter
        assert abs(expected(points, cells, ~hard, ends, turn) - value) > 0.01 * value


def said_by_check(folder, capsys, code=0):
    assert main(["check", str(folder / "case.toml")]) == code
    said = capsys.readouterr()
    return said.err if code else said.out, said.err


def test_check_and_describe_list_groups_and_warn_of_unused_ones(tmp_path, capsys):
    points, cells, hard, ends, _ = block(0)
    file, names = write(tmp_path, "gmsh", points, cells, hard, ends)
    case(tmp_path, file, None, names[0], names[1], "x > 0.999")
    out, err = said_by_check(tmp_path, capsys)
    volume = (
        np.abs(np.linalg.det(points[cells[hard][:, 1:]] - points[cells[hard][:, :1]])).sum() / 6
    )
    assert f"group:hard: {hard.sum()} tetrahedra, {volume:.3g} m³, in [0, 1] × [0, 1]" in out
    assert f"group:left: {len(ends[0])} triangles, 1 m², in [0, 0] × [0, 1] × [0, 1] m\n" in out
    assert out.count("(unused)") == 2
    assert "that the case does not use: 'right', 'all'" in err
    assert main(["describe", str(tmp_path / "case.toml")]) == 0
    assert "group:left" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"held": "group:lefd"}, "supports[0].where: no group 'lefd' in the mesh file; did you"),
        ({"hard": "group:left"}, "group 'left' has no cells of the body, only parts"),
        ({"hard": "group:nothing"}, "material.regions[0].where: no group 'nothing'"),
    ],
)
def test_a_wrong_group_is_named(tmp_path, capsys, changed, expected):
    points, cells, hard, ends, _ = block(0)
    file, _ = write(tmp_path, "gmsh", points, cells, hard, ends)
    case(tmp_path, file, **changed)
    err, _ = said_by_check(tmp_path, capsys, code=2)
    assert expected in err
    assert err.count("\n") == 1


def test_a_cell_in_two_groups_of_different_materials_is_refused(tmp_path, capsys):
    points, cells, hard, ends, _ = block(0)
    file, _ = write(tmp_path, "gmsh", points, cells, hard, ends)
    case(tmp_path, file)
    path = tmp_path / "case.toml"
    second = '[[material.regions]]\nwhere = "group:all"\nyoung = {}\n[[supports]]'
    text = path.read_text()
    path.write_text(text.replace("[[supports]]", second.format("6e4"), 1))
    err, _ = said_by_check(tmp_path, capsys, code=2)
    assert f"{hard.sum()} cells of group 'all' are also in 'group:hard' of another material" in err


def mixed(rng):
    """Layers of hexahedra, of wedges and of pyramids; nodes in any order."""
    points = np.array([[x, y, z] for x in range(4) for y in range(4) for z in range(4)], float)
    cells = {"hexahedron": [], "wedge": [], "pyramid": []}
    for x, y, z in itertools.product(range(3), repeat=3):
        around = ((0, 0), (1, 0), (1, 1), (0, 1))
        i = [16 * (x + a) + 4 * (y + b) + z + c for c in (0, 1) for a, b in around]
        if z == 0:
            cells["hexahedron"].append(i)
        elif z == 1:
            cells["wedge"] += [[i[k] for k in w] for w in ((0, 3, 7, 1, 2, 6), (0, 7, 4, 1, 6, 5))]
        else:
            points = np.vstack([points, points[i].mean(axis=0)])
            apex = len(points) - 1
            cells["pyramid"] += [[*(i[k] for k in f), apex] for f in
                                 ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2),
                                  (2, 6, 7, 3), (3, 7, 4, 0))]  # fmt: skip
    number = rng.permutation(len(points))
    shuffled = np.empty_like(points)
    shuffled[number] = points
    return shuffled, [(kind, number[np.array(some)]) for kind, some in cells.items()]


@pytest.mark.parametrize("seed", range(2))
def test_cells_that_are_no_simplices_are_split_so_that_neighbours_fit(tmp_path, seed):
    """Any order of the nodes: no volume is lost, and no facet inside has one cell alone."""
    points, blocks = mixed(np.random.default_rng(seed))
    meshio.Mesh(points, blocks).write(tmp_path / "body.vtu")
    body = read_body(tmp_path / "body.vtu", 3)
    edges = body.points[body.cells[:, 1:]] - body.points[body.cells[:, :1]]
    assert np.linalg.det(edges).sum() / 6 == pytest.approx(27.0, rel=1e-14)
    facets = np.sort(np.concatenate([np.delete(body.cells, i, axis=1) for i in range(4)]), axis=1)
    distinct, count = np.unique(facets, axis=0, return_counts=True)
    places = body.points[distinct[count == 1]]
    outside = (np.ptp(places, axis=1) < 1e-12) & np.isin(places[:, 0], (0.0, 3.0))
    assert outside.any(axis=1).all()
    assert "9 cells 'hexahedron' are split into tetras" in body.notes


def test_quads_of_a_plane_body_are_split_and_those_beside_a_solid_are_parts_of_it(tmp_path):
    flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    meshio.Mesh(flat, [("quad", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "flat.vtu")
    assert len(read_body(tmp_path / "flat.vtu", 2).cells) == 2
    mesh = box_mesh((1, 1, 1), (0.0,) * 3, (1.0,) * 3)
    low = np.flatnonzero(mesh.points[:, 2] == 0.0)[[0, 1, 3, 2]]
    blocks = [("tetra", mesh.cells), ("quad", low[None])]
    ids = {"id": [np.zeros(len(mesh.cells), int), np.ones(1, int)]}
    meshio.Mesh(mesh.points, blocks, cell_data=ids).write(tmp_path / "solid.vtu")
    group = read_body(tmp_path / "solid.vtu", 3).group("id=1")
    assert group.parts[3].shape == (2, 3, 3)


def test_elements_of_second_order_are_taken_by_their_corners_and_it_is_said(tmp_path):
    mesh = box_mesh((2, 1, 1), (0.0,) * 3, (1.0,) * 3)
    points, number, ten = list(mesh.points), {}, []
    for cell in mesh.cells:
        row = list(cell)
        for a, b in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)):
            edge = tuple(sorted((cell[a], cell[b])))
            if edge not in number:
                number[edge] = len(points)
                points.append(0.5 * (mesh.points[edge[0]] + mesh.points[edge[1]]))
            row.append(number[edge])
        ten.append(row)
    meshio.Mesh(np.array(points), [("tetra10", np.array(ten))]).write(tmp_path / "ten.vtu")
    body = read_body(tmp_path / "ten.vtu", 3)
    assert (len(body.points), len(body.cells)) == (len(mesh.points), len(mesh.cells))
    assert body.notes[0] == f"{len(mesh.cells)} cells 'tetra10' are taken by their corners"


def test_a_scale_acts_before_anything_else_and_a_weld_joins_what_is_apart(tmp_path):
    points, cells, hard, ends, turn = block(3)
    left = points[cells].mean(axis=1)[:, 0] < 0.5
    apart = np.vstack([points, points + 1e-8])  # two halves exported one after the other
    two = np.where(left[:, None], cells, cells + len(points))
    ends = [ends[0], ends[1] + len(points)]
    file, names = write(tmp_path, "medit", 1000.0 * apart @ turn, two, hard, ends)
    scene = case(tmp_path, file, turn, *names, geometry="scale = 1e-3\nweld = 1e-6")
    value = expected(points, cells, hard, [ends[0], ends[1] - len(points)], turn)
    assert len(read_mesh(scene)[0]) == len(points)
    assert measured(scene) == pytest.approx(value, rel=1e-6)  # nodes are 1e-8 elsewhere
    torn = case(tmp_path, file, turn, *names, geometry="scale = 1e-3")
    with pytest.raises(InputError, match="is not held"):
        measured(torn)
    with pytest.raises(InputError, match=r"weld: 0\.5 m joins corners of one cell"):
        read_mesh(case(tmp_path, file, turn, *names, geometry="scale = 1e-3\nweld = 0.5"))


def test_the_vtu_of_fenicsx_is_read(tmp_path):
    """Version 2.2, with the Lagrange cells of VTK."""
    points = "0 0 0 1 0 0 0 1 0 0 0 1"
    (tmp_path / "dx.vtu").write_text(
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="2.2">\n'
        '<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1"><Points>'
        f'<DataArray type="Float64" NumberOfComponents="3" format="ascii">{points}</DataArray>'
        '</Points><Cells><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3'
        '</DataArray><DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>'
        '<DataArray type="Int8" Name="types" format="ascii">71</DataArray></Cells></Piece>'
        "</UnstructuredGrid></VTKFile>\n"
    )
    assert read_body(tmp_path / "dx.vtu", 3).cells.shape == (1, 4)


def _xdmf_in_hdf5(folder, places="h5"):
    """Write a body with tags as FEniCSx does: XML whose numbers lie in HDF5."""
    points, cells, hard, ends, _ = block(1, 2)
    file, _ = write(folder, "xdmf", points, cells, hard, ends)
    text, arrays = (folder / file).read_text(), {}
    while 'Format="XML"' in text:
        head, _, rest = text.partition('Format="XML">')
        numbers, _, rest = rest.partition("<")
        shape = head.rsplit('Dimensions="', 1)[1].split('"')[0]
        key = f"/Mesh/{len(arrays)}"
        arrays[key] = np.array(numbers.split(), float).reshape([int(n) for n in shape.split()])
        text = f'{head}Format="HDF">body.{places}:{key}<{rest}'
    (folder / file).write_text(text)
    return folder / file, arrays, (points, cells, hard, ends)


def test_xdmf_in_hdf5_names_what_it_needs(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)  # an import of it fails
    path, _, _ = _xdmf_in_hdf5(tmp_path)
    with pytest.raises(InputError, match=r"'h5py': pip install 'cutting-verification\[hdf5\]'"):
        read_body(path, 3)


def test_xdmf_in_hdf5_is_read_with_its_tags(tmp_path):
    h5py = pytest.importorskip("h5py")
    path, arrays, (points, cells, hard, ends) = _xdmf_in_hdf5(tmp_path)
    with pytest.raises(InputError, match=r"'body\.h5' beside it has no '/Mesh/0'"):
        read_body(path, 3)
    with h5py.File(tmp_path / "body.h5", "w") as file:
        for key, values in arrays.items():
            file[key] = values
    body = read_body(path, 3)
    np.testing.assert_array_equal(body.points, points)
    assert len(body.cells) == len(cells)
    assert len(body.group("cells=2").cells) == hard.sum()
    assert len(body.group("facets=3").parts[3]) == len(ends[0])


@pytest.mark.fenicsx
@pytest.mark.parametrize("version", ["1", "4.1 with a part in no group", "of Nastran"])
def test_what_meshio_does_not_read_gmsh_does(tmp_path, version):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
    if version == "1":
        lines = ["$NOD", "5", *(f"{i + 1} {x} {y} {z}" for i, (x, y, z) in enumerate(points))]
        lines += ["$ENDNOD", "$ELM", "2", "1 4 7 1 4 1 2 3 4", "2 4 8 2 4 2 3 4 5", "$ENDELM", ""]
        (tmp_path / "body.msh").write_text("\n".join(lines))
        groups = {"7": [0], "8": [1]}
    else:
        parts = [(3, np.array([[0, 1, 2, 3]]), [1]), (3, np.array([[1, 2, 3, 4]]), [])]
        text = msh41(np.array(points, float), parts, {"fat": (1, 3)})
        (tmp_path / "body.msh").write_text(text)
        groups = {"fat": [0]}
    name = "body.msh"
    if version == "of Nastran":  # two properties, without the rest of a deck
        name, groups = "body.bdf", {"7": [0], "9": [1]}
        rows = ["".join(f"{x:<8}" for x in ("GRID", i + 1, 0, *map(float, p)))
                for i, p in enumerate(points)]  # fmt: skip
        rows += ["".join(f"{x:<8}" for x in ("CTETRA", i + 1, 7 + 2 * i, *(n + 1 for n in cell)))
                 for i, cell in enumerate([[0, 1, 2, 3], [1, 2, 3, 4]])]  # fmt: skip
        (tmp_path / name).write_text("\n".join(["$ two", *rows, "ENDDATA", ""]))
    body = read_body(tmp_path / name, 3)
    assert len(body.cells) == 2
    assert {name: group.cells.tolist() for name, group in body.groups.items()} == groups


def test_numbers_of_cells_are_no_groups(tmp_path):
    mesh = box_mesh((2, 2, 2), (0.0,) * 3, (1.0,) * 3)
    count = len(mesh.cells)
    data = {"id": [np.arange(count)], "vtkGhostType": [np.zeros(count, int)],
            "part": [np.arange(count) % 2], "stress": [np.linspace(0.0, 1.0, count)]}  # fmt: skip
    meshio.Mesh(mesh.points, [("tetra", mesh.cells)], cell_data=data).write(tmp_path / "body.vtu")
    body = read_body(tmp_path / "body.vtu", 3)
    assert list(body.groups) == ["part=0", "part=1"]
    assert body.group("part=1").cells.tolist() == list(range(1, count, 2))


def test_coordinates_in_millimetres_are_warned_of(tmp_path, capsys):
    points, cells, hard, ends, _ = block(0)
    file, names = write(tmp_path, "medit", 1000.0 * points, cells, hard, ends)
    case(tmp_path, file, None, *names)
    text = (tmp_path / "case.toml").read_text()
    (tmp_path / "case.toml").write_text(text.split("[[cuts]]")[0])
    out, err = said_by_check(tmp_path, capsys)
    stretch = 1000.0 * np.sqrt(1.0 + 4.0 + 9.81**2) * 1000.0 / 2e4
    assert f"would stretch by ρgL/2E = {stretch:.2g} of its length L = 1e+03 m" in err
    assert f"a shear wave crosses the body in {1000.0 * np.sqrt(1000.0 * 2.6 / 1e4):.3g} s" in out
    text = text.replace("[mesh]", "scale = 1e-3\n[mesh]")
    (tmp_path / "case.toml").write_text(text.split("[[cuts]]")[0])
    assert "ρgL/2E" not in said_by_check(tmp_path, capsys)[1]


def test_a_closed_surface_says_that_it_has_no_rim(tmp_path, capsys):
    points, cells, _, _, _ = block(0, 2)
    facets = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
    facets, count = np.unique(facets, axis=0, return_counts=True)
    meshio.Mesh(points, [("triangle", facets[count == 1])]).write(tmp_path / "body.vtu")
    text = CASE.format(file="body.vtu", hard="z < 0.5", held="x < 0.1", held_too="x > 0.9",
                       geometry='cells = "surface"', cut="[]")  # fmt: skip
    text = text.replace("density", "thickness = 1e-3\ndensity")
    text = text.replace("[[supports]]", '[analysis]\nkinematics = "corotational"\n[[supports]]', 1)
    (tmp_path / "case.toml").write_text(text.split("[[cuts]]")[0])
    err, _ = said_by_check(tmp_path, capsys, code=2)
    assert "supports[0]: the surface is closed and has no rim to act on" in err


@pytest.mark.parametrize("solver", ["xfem", "conforming"])
def test_a_closed_surface_is_held_at_a_group_of_its_triangles_or_nodes(tmp_path, solver):
    """A bag that falls: its group stands still, on both sides of a cut through it."""
    if solver == "conforming":
        pytest.importorskip("dolfinx_solver")
    points, cells, _, _, turn = block(0)
    facets = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
    facets, count = np.unique(facets, axis=0, return_counts=True)
    skin = facets[count == 1]
    corner = np.flatnonzero((points[skin] > 0.999).any(axis=2).all(axis=1))[:1]
    on = np.abs(points[skin][:, :, 1]).max(axis=1) < 1e-9  # y = 0, which the cut crosses
    blocks = [("triangle", skin), ("vertex", skin[corner, :1])]
    parts = [np.where(on, 2, 1), np.array([3])]
    meshio.Mesh(points @ turn, blocks, cell_data={"part": parts}).write(tmp_path / "body.vtu")
    cut = MIDDLE + np.array([[0.1, -9, -9], [-0.1, 9, -9], [0.05, 9, 9], [0.25, -9, 9]])
    text = CASE.format(file="body.vtu", hard="x > 9", held="group:part=2", held_too="group:part=3",
                       geometry='cells = "surface"', cut=(cut @ turn).tolist())  # fmt: skip
    begin, end = text.index("[[material.regions]]"), text.index("[[supports]]")
    motion = '[analysis]\nkind = "dynamic"\nduration = 1e-2\nkinematics = "corotational"\n'
    text = text[:begin] + "thickness = 1e-3\n" + motion + text[end:]
    (tmp_path / "case.toml").write_text(text)
    scene = load_scene(tmp_path / "case.toml")
    check_scene(scene)
    found = find_solver(solver).solve(scene, 0, 0)
    whole, node = nodes_held(scene, found, [one.where for one in scene.supports])
    held = np.isin(found.cells, whole).all(axis=1)
    assert measures(found.points[found.cells[held]]).sum() == pytest.approx(1.0, rel=1e-12)
    assert len(node) == 1
    moved = np.linalg.norm(found.displacement[-1], axis=1)
    assert moved[[*whole, *node]].max() == 0.0
    fallen = 0.5 * np.linalg.norm([1.0, 2.0, 9.81]) * 1e-4  # of what nothing has reached yet
    assert np.median(moved[moved > 0.0]) == pytest.approx(fallen, rel=0.02)
    assert (np.delete(moved, [*whole, *node]) > 0.0).all()


def _mutations(form, text):
    """Bad forms of a good file of text: cut off, with wrong numbers, or of nothing."""
    lines = text.splitlines()
    middle = len(lines) // 2
    yield "".join(text[: len(text) // 3])
    yield "\n".join(lines[:middle])
    yield "\n".join([*lines[:middle], "x y z", *lines[middle + 1 :]])
    yield ""
    if form == "medit":
        yield text.replace("Tetrahedra\n", "Tetrahedra\n99999999999\n")
        yield text.replace("Dimension 3", "Dimension 7")
    if form == "xdmf":
        yield text.replace("Tetrahedron", "Blob")
        yield text.replace('Dimensions="', 'Dimensions="9', 1)
        yield text.replace('Format="XML"', 'Format="HDF"', 1)
        yield text.replace(">0 ", ">-7 ", 1)
    if form == "abaqus":
        yield text.replace("C3D4", "C3D99")
        yield text.replace("\n1, ", "\n1, nan, ", 1)
        yield text.replace("*ELEMENT", "*ELEMENTS")


@pytest.mark.parametrize("form", ["medit", "xdmf", "abaqus"])
def test_a_spoilt_file_gives_one_line(tmp_path, capsys, monkeypatch, form):
    """gmsh is left out: what it prints is its own, and a process for each takes a second."""
    monkeypatch.setattr("verify.read_mesh.find_spec", lambda _: None)
    points, cells, hard, ends, _ = block(0, 2)
    file, names = write(tmp_path, form, points, cells, hard, ends)
    case(tmp_path, file, None, *names)
    good = (tmp_path / file).read_text()
    refused = 0
    for number, text in enumerate(_mutations(form, good)):
        (tmp_path / file).write_text(text + " " * number)  # of another size: read anew
        assert main(["check", str(tmp_path / "case.toml")]) == 2, number
        err = capsys.readouterr().err
        assert err.count("\n") == 1, err
        assert err.startswith("verify: error: "), err
        assert file in err or "case.toml" in err, err
        refused += 1
    assert refused >= 6
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["case.toml", file])


def test_guests_get_groups_and_metres(tmp_path):
    """The export is in metres, with a material for each cell and the nodes of each clamp."""
    points, cells, hard, ends, turn = block(2)
    file, names = write(tmp_path, "gmsh22", 1000.0 * points @ turn, cells, hard, ends)
    scene = case(tmp_path, file, turn, *names, geometry="scale = 1e-3")
    scene = restore_scene(json.loads(json.dumps(scene_content(scene))))  # as in another process
    export_case(scene, tmp_path / "out", conforming=False)
    folder = tmp_path / "out" / "level-0"
    mesh = meshio.read(folder / "mesh.vtu")
    middles = mesh.points[mesh.cells_dict["tetra"]].mean(axis=1)
    numbers = mesh.cell_data_dict["material"]["tetra"]
    own = cKDTree(points[cells].mean(axis=1) @ turn).query(middles)
    assert own[0].max() < 1e-12
    assert (numbers == hard[own[1]]).all()
    problem = problem_of(scene, 0)
    for held, end in zip(problem.held, ends, strict=True):
        given = np.sort(problem.points[held.nodes], axis=0)
        wanted = np.sort(points[np.unique(end)] @ turn, axis=0)
        np.testing.assert_allclose(given, wanted, atol=1e-12)


def test_pieces_that_share_an_edge_alone_are_warned_of(tmp_path, capsys):
    mesh = box_mesh((2, 1, 1), (0.0,) * 3, (1.0,) * 3)
    beside = mesh.points + np.array([1.0, 1.0, 0.0])  # along z they share an edge
    points = np.vstack([mesh.points, beside])
    points, number = np.unique(points, axis=0, return_inverse=True)
    cells = number.ravel()[np.vstack([mesh.cells, mesh.cells + len(mesh.points)])]
    meshio.Mesh(points, [("tetra", cells)]).write(tmp_path / "body.vtu")
    case(tmp_path, "body.vtu", None, "x < 0.5", "x < 0.1", "x > 1.9")
    text = (tmp_path / "case.toml").read_text().split("[[cuts]]")[0]
    (tmp_path / "case.toml").write_text(text)
    err = said_by_check(tmp_path, capsys)[1]
    assert f"in 2 pieces that share no facet, the least of {len(mesh.cells)} cells around" in err


def test_what_lies_inside_of_a_group_holds_nothing_and_it_is_said(tmp_path, capsys):
    """Of facets between cells no solver makes a clamp; the rim of a section is none either."""
    mesh = box_mesh((2, 2, 2), (0.0,) * 3, (1.0,) * 3)
    points, cells = mesh.points, mesh.cells
    first, middle = (faces(cells, np.abs(points[:, 0] - x) < 1e-9) for x in (0.0, 0.5))
    low = points[cells].mean(axis=1)[:, 0] < 0.5
    blocks = [("tetra", cells), ("triangle", first), ("triangle", middle)]
    for beside, expected in ((5, "no facet of the boundary lies in 'group:part=3'"),
                             (3, "50.0% of 'group:part=3' is inside the body")):  # fmt: skip
        parts = [np.where(low, 1, 2), np.full(len(first), beside), np.full(len(middle), 3)]
        meshio.Mesh(points, blocks, cell_data={"part": parts}).write(tmp_path / "body.vtu")
        case(tmp_path, "body.vtu", None, "group:part=2", "group:part=3", "x > 0.999")
        said = said_by_check(tmp_path, capsys, code=2 * (beside == 5))
        assert f"supports[0]{'.where' * (beside == 5)}: {expected}" in said[1 - (beside == 5)]
    case(tmp_path, "body.vtu", None, "group:part=2", "group:part=1", "x > 0.999")
    said = said_by_check(tmp_path, capsys)[1]
    assert "of the cells of 'group:part=1' their part of the boundary alone counts" in said
    nodes = [f"{i + 1}," for i in np.flatnonzero(points[:, 0] < 0.6)]
    file, _ = write(tmp_path, "abaqus", points, cells, low, [first, first])
    text = (tmp_path / file).read_text() + "\n".join(["*NSET, NSET=LAYER", *nodes, ""])
    (tmp_path / file).write_text(text)
    case(tmp_path, file, None, "group:HARD", "group:LAYER", "x > 0.999")
    said = said_by_check(tmp_path, capsys)[1]
    assert "supports[0]: 1 of 18 nodes of 'group:LAYER' are inside the body" in said

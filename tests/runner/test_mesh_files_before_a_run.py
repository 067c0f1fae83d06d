"""Mesh files in `check`: size and mass, nodes written twice, the reason why one is not read."""

import warnings

import meshio
import numpy as np
import pytest
from case_texts import support_text

from verify.cli import main
from verify.xfem.mesh import box_mesh

TEXT = (
    'title = "t"\nrequirement = "r"\n[geometry]\nkind = "file"\nfile = "{file}"\ndimension = 3\n'
    '[mesh]\npattern = "given"\n[material]\nyoung = 1e4\npoisson = 0.3\ndensity = 1000.0\n'
    + support_text("x < 0.1", [0, 0, 0])
    + support_text("x > {far}", [0, 0, 0])
)
BOX = box_mesh((4, 3, 2), (0.0, 0.0, 0.0), (2.0, 1.0, 1.0))


def _checked(folder, capsys, points, cells, far=1.9):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        meshio.Mesh(points, [("tetra", cells)]).write(folder / "body.vtu")
    (folder / "case.toml").write_text(TEXT.format(file="body.vtu", far=far))
    code = main(["check", str(folder / "case.toml")])
    said = capsys.readouterr()
    return code, said.out, said.err


def _torn(share):
    """The box with the nodes at x = 1 below a share of its height written twice, 1e-8 apart."""
    at = np.flatnonzero((np.abs(BOX.points[:, 0] - 1.0) < 1e-9) & (BOX.points[:, 2] <= share))
    number = np.arange(len(BOX.points))
    number[at] = len(BOX.points) + np.arange(len(at))
    right = BOX.points[BOX.cells].mean(axis=1)[:, 0] > 1.0
    cells = np.where(right[:, None], number[BOX.cells], BOX.cells)
    return np.vstack([BOX.points, BOX.points[at] + 1e-8]), cells, len(at)


def test_nodes_that_are_written_twice_are_counted_and_placed(tmp_path, capsys):
    points, cells, count = _torn(0.6)
    code, out, err = _checked(tmp_path, capsys, points, cells)
    assert code == 0
    assert f"body: 2 × 1 × 1 m, {len(points)} nodes, 144 cells, 2 m³, 2e+03 kg" in out
    assert f"warning: 'body.vtu' is not joined where {count} pairs of nodes coincide" in err
    assert "one at (1, " in err
    # written apart all over, and one half not held: that is why
    points, cells, count = _torn(1.0)
    code, _, err = _checked(tmp_path, capsys, points, cells, far="1.9 and x < 0.05 or x < 0.09")
    assert code == 2
    assert "can move as a rigid body" in err
    assert f"{count} pairs of nodes" in err


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.vtk", "version https://git-lfs.github.com/spec/v1\n", "Illegal VTK header"),
        (
            "b.vtk",
            "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 0 float\n",
            "(not POLYDATA)",
        ),
    ],
)
def test_the_reason_of_meshio_is_said(tmp_path, capsys, name, text, said):
    (tmp_path / name).write_text(text)
    (tmp_path / "case.toml").write_text(TEXT.format(file=name, far=1.9))
    assert main(["check", str(tmp_path / "case.toml")]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert "SystemExit" not in err

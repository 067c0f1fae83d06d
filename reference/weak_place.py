"""Places where a body is held so weakly that its displacement is lost in round-off."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from reference.linear_solvers import IllConditionedError
from reference.space import ConformingSpace
from reference.unknowns import Unknowns
from verify.errors import InputError
from verify.scene import Scene


@contextmanager
def naming_weak_places(
    scene: Scene, space: ConformingSpace, unknowns: Unknowns | None = None
) -> Iterator[None]:
    """Say of a system that is lost in round-off where the body is held too weakly.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
        Of the displacements.
    unknowns : Unknowns, optional
        Of the system, if it has others beside.

    Raises
    ------
    InputError
        In place of an `IllConditionedError`.
    """
    try:
        yield
    except IllConditionedError as error:
        correction = (unknowns or space).everywhere(error.correction)
        raise _weak_place(scene, space, error, correction) from error


def _weak_place(
    scene: Scene,
    space: ConformingSpace,
    error: IllConditionedError,
    correction: NDArray[np.float64],
) -> InputError:
    """Say in terms of the geometry why a system could not be solved."""
    size = np.linalg.norm(np.nan_to_num(correction, nan=np.inf), axis=1)
    node = int(np.argmax(size))
    around = (space.cell_nodes == node).any(axis=1)
    corners = space.mesh.points[space.mesh.cells[around]]
    longest = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).max()
    place = ", ".join(f"{x:.4g}" for x in space.node_points[node])
    return InputError(
        f"geometry: the material around ({place}), in cells of {longest:.2g} m, is held so weakly "
        f"that its displacement is lost in round-off ({error.size:.1e} of the whole is not "
        "known): a needle or strip this slender between cuts, or between a cut and the boundary, "
        "cannot be solved for; move them apart, or let them meet",
        str(scene.file or ""),
    )

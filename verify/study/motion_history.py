"""Energies and momenta of a moving solution over its output times, as a report shows them."""

import numpy as np

from verify.compare.kinetic import kinetic
from verify.compare.ledger import total_energy
from verify.scene import Scene
from verify.solution import Solution

__all__ = ["motion_history"]

_AXES = "xyz"


def motion_history(scene: Scene, solution: Solution) -> dict[str, list[float]]:
    """Return what moves, by name, with ``time`` (s).

    The parts of the solution's own ledger keep their names (J, in 2D per metre); ``total`` is the
    sum that physics keeps constant. ``linear_momentum_x`` … (N s) and ``angular_momentum_z`` (in
    space also x, y; N m s, about the origin) are integrated from the velocities, if there are
    any. Empty for a single output time.
    """
    times = np.asarray(solution.times, dtype=float)
    if len(times) < 2:
        return {}
    rows = {"time": times}
    rows |= {name: np.asarray(part) for name, part in solution.ledger.items() if name != "total"}
    total = total_energy(solution.ledger)
    if total is not None:
        rows["total"] = total
    if solution.velocity is not None and scene.material.density is not None:
        thickness = scene.material.thickness or 1.0  # of a membrane
        found = kinetic(solution, thickness * scene.material.density)
        rows |= _components("linear_momentum", found.linear, _AXES)
        rows |= _components("angular_momentum", found.angular, _AXES[-found.angular.shape[1] :])
    return {name: [float(value) for value in row] for name, row in rows.items()}


def _components(name: str, values: np.ndarray, axes: str) -> dict[str, np.ndarray]:
    return {f"{name}_{axis}": values[:, k] for k, axis in enumerate(axes[: values.shape[1]])}

"""Size and mass of a body, to be read before a run."""

import numpy as np

from verify.scene import Box, MeshFile, Polygon, Rectangle, Scene, read_mesh
from verify.scene.placement import points_of_body


def volume_of(scene: Scene) -> float:
    """Area or volume of a rectangle, a box or a polygon."""
    body = scene.geometry
    if isinstance(body, Box):
        return float(np.prod(np.subtract(body.upper, body.lower)))
    assert isinstance(body, Rectangle | Polygon)
    x, y = body.outline().T
    return float(0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def body_text(scene: Scene) -> str:
    """Say extent, volume and mass of a body, of a mesh file its nodes and cells too.

    Empty for a body that is meshed elsewhere (a skin).

    Raises
    ------
    InputError, ValueError
        If the mesh file is bad.
    """
    body, d = scene.geometry, scene.dimension
    mesh = ""
    if isinstance(body, MeshFile):
        # commands that only read cases shall not load numba, nor scipy below
        from verify.xfem.mesh import SimplexMesh

        grid = SimplexMesh(*read_mesh(scene))
        sides, places, volumes = np.ptp(grid.points, axis=0), grid.points[grid.cells], grid.measures
        places = places.mean(axis=1)
        mesh = f", {len(grid.points)} nodes, {len(grid.cells)} cells"
    elif len(ends := body.extremes()):
        sides, places = np.ptp(ends, axis=0), points_of_body(scene)
        volumes = np.full(len(places), volume_of(scene) / len(places))
    else:
        return ""
    extent = " × ".join(f"{side:.3g}" for side in sides)
    power = "²" if scene.cell_dimension == 2 else "³"
    mass = ""
    if scene.material.density is not None:
        weights = volumes * scene.material.at(places).density * (scene.material.thickness or 1.0)
        mass = f", {weights.sum():.3g} kg{' per m of thickness' if d == 2 else ''}"
    return f"{extent} m{mesh}, {volumes.sum():.3g} m{power}{mass}"

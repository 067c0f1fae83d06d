"""Formulas of a case that are no finite number where they are used, found before a run."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.runner import exact_samples as samples
from verify.scene import BodyForce, CutFaces, InitialField, Scene, Traction
from verify.scene.parts import on_part
from verify.scene.physics import field_values
from verify.xfem.mesh import SimplexMesh

Array = NDArray[np.float64]
_Values = Callable[[Array, float], Any]


def check_formulas_are_finite(scene: Scene, mesh: SimplexMesh) -> None:
    """Raise `InputError` where a formula has no finite value at a node, or inside a facet or cell.

    Parameters
    ----------
    scene : Scene
    mesh : SimplexMesh
        Any mesh of the body.
    """
    times = scene.analysis.output_times
    for key, values, points in _used(scene, mesh):
        for time in sorted({times[0], times[len(times) // 2], times[-1]}):
            try:
                values(points, time)
            except InputError as error:
                at = f" at {time:.6g} s" if scene.analysis.duration is not None else ""
                where = str(scene.file or scene.name)
                raise InputError(f"{key}: {error.what}{at}", where) from None


def _used(scene: Scene, mesh: SimplexMesh) -> Iterator[tuple[str, _Values, Array]]:
    """Key, values, and the points (n, d) at which they are needed, of every formula."""
    rng = np.random.default_rng(5)
    nodes, facets = samples.boundary_nodes(mesh)[0], samples.on_boundary(mesh, rng).points
    inside = samples.in_body(mesh, rng)[:, 0]
    for i, support in enumerate(scene.supports):
        if support.displacement != "exact":
            on = on_part(scene.geometry, support.where, nodes, mesh.extent)
            given = cast(list[Any], support.displacement)
            yield f"supports[{i}].displacement", partial(field_values, given), nodes[on]
    for i, load in enumerate(scene.loads):
        if isinstance(load, Traction) and not load.exact:
            on = on_part(scene.geometry, load.where, facets, mesh.extent)
            yield f"loads[{i}].traction", load.values, facets[on]
        elif isinstance(load, BodyForce) and not load.exact:
            yield f"loads[{i}].force", load.values, inside
        elif isinstance(load, CutFaces):
            cut = next(cut for cut in scene.final_cuts if cut.name == load.cut)
            on_cut = samples.on_cut(cut, np.zeros(0), rng).points
            if scene.cell_dimension == scene.dimension:
                yield f"loads[{i}]", load.values, on_cut[samples.holds(mesh, on_cut)]
    if isinstance(scene.initial, InitialField):
        for key in ("displacement", "velocity"):
            given = getattr(scene.initial, key)
            if given not in (None, "exact"):
                yield f"initial.{key}", partial(field_values, given), inside

"""Uses every compiled kernel once and prints, as JSON, the seconds that compiling each took.

Run as a program with `NUMBA_CACHE_DIR` set to an empty folder. Seconds are processor time and
exclusive: a kernel compiled while another is being compiled counts for itself only.
"""

import json
from collections import defaultdict
from time import process_time

import numpy as np
from numba.core import event

from verify.xfem.collision.surface_collider import SurfaceCollider
from verify.xfem.conjugate_gradients import ConjugateGradients
from verify.xfem.corotational import InternalForce
from verify.xfem.corotational_static import static_equilibrium
from verify.xfem.cuts import Plane
from verify.xfem.cutting.semi_progressive import SemiProgressiveCutter
from verify.xfem.dynamics import (
    CentralDifferences,
    DynamicBody,
    EnergyMomentum,
    RealTimeEuler,
    Trapezoidal,
)
from verify.xfem.elasticity import isotropic
from verify.xfem.loads import body_force
from verify.xfem.mapping.body_surface import BodySurface
from verify.xfem.mapping.embedded_surface import EmbeddedSurface
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.slivers import treat_slivers
from verify.xfem.static import solve_static
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.supports import Supports
from verify.xfem.tool_path import ToolPath
from verify.xfem.virtual import cut_mesh

__all__ = ["CompileTimes", "tour"]


class CompileTimes(event.Listener):
    """Processor seconds of compilation by module, each without what it had compiled."""

    def __init__(self):
        self.seconds = defaultdict(float)
        self.kernels = 0
        self._open = []

    def on_start(self, event_):
        self._open.append([process_time(), 0.0])

    def on_end(self, event_):
        start, inner = self._open.pop()
        whole = process_time() - start
        module = event_.data["dispatcher"].py_func.__module__
        self.seconds[module] += whole - inner
        self.kernels += 1
        if self._open:
            self._open[-1][1] += whole


def _bodies():
    """Cut bodies of each kind, and their materials."""
    flat = rectangle_mesh((3, 3))
    points = np.column_stack([flat.points, np.zeros(len(flat.points))])
    across = [0.1, 1.0, 0.2]
    yield cut_mesh(flat, [Plane([0.5, 0.45], across[:2])]), "plane strain"
    yield (
        cut_mesh(SimplexMesh(points, flat.cells), [Plane([0.5, 0.45, 0.0], across)]),
        ("plane stress"),
    )
    yield cut_mesh(box_mesh((2, 2, 2)), [Plane([0.5, 0.45, 0.5], across)]), "solid"


def _statics(virtual, kind):
    material = isotropic(1.0, 0.3, kind)
    whole = np.ones(len(virtual.mesh.points), dtype=bool)
    held = Supports.none(virtual).prescribe(virtual, virtual.mesh.points[:, 1] % 1.0 == 0.0)
    if virtual.mesh.dim < virtual.mesh.space:
        held = held.prescribe(virtual, whole, components=(2,))
    load = body_force(virtual, -0.01 * np.ones(virtual.mesh.space))
    for solver in ("direct", "iterative"):
        solve_static(virtual, material, held, load, solver=solver)
    static_equilibrium(InternalForce(virtual, material), held.fixed, load=load)
    return material, held


def _motion(virtual, material, held):
    mass = side_wise_mass(virtual, 1.0)
    body = DynamicBody(InternalForce(virtual, material), mass, supports=held)
    for scheme in (
        RealTimeEuler(body, 1e-3),
        RealTimeEuler(body, 1e-3, solver=ConjugateGradients(body.pattern, body.shape[1])),
        Trapezoidal(body, 1e-3),
        EnergyMomentum(body, 1e-3),
        CentralDifferences(body, 1e-3),
    ):
        state = body.rest()
        state.velocity[:] = 0.01 * virtual.node_points
        scheme.step(state)


def _knife():
    cutter = SemiProgressiveCutter(box_mesh((3, 3, 3)))
    skin = BodySurface(cutter.body)
    facets = skin.surface.facets.rows.copy(), skin.surface.material.rows.copy()
    surfaces = [skin, EmbeddedSurface(cutter, facets[1], facets[0])]
    cutter.begin(ToolPath.of_tip([[-0.5, 0.4, -0.2], [1.5, 0.5, -0.2]], [0.0, 1.0], [0, 0, 1.5]))
    for time in (0.5, 1.0):
        increment = cutter.advance(time)
        for surface in surfaces:
            surface.update(increment)
    SurfaceCollider(surfaces[1].surface).refit(np.zeros((cutter.body.node_count, 3)))


def tour():
    """Statics, motion and cutting of small bodies of each kind."""
    for virtual, kind in _bodies():
        kept, _ = treat_slivers(virtual)
        _motion(kept, *_statics(kept, kind))
    _knife()


if __name__ == "__main__":
    times = CompileTimes()
    with event.install_listener("numba:compile", times):
        tour()
    print(json.dumps({"kernels": times.kernels, "seconds": times.seconds}))

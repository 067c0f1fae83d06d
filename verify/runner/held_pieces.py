"""Pieces that nothing holds, found before a run: all solvers find them, after their work."""

from verify.errors import InputError
from verify.runner.cost import mesh_of_level
from verify.runner.mesh_faults import mesh_warning
from verify.scene import Equilibrium, Scene
from verify.solvers.body_of_scene import background_mesh
from verify.solvers.cuts_of_scene import cuts_of
from verify.solvers.supports_of_scene import supports_of
from verify.xfem.errors import XfemError
from verify.xfem.phantom import cut_mesh
from verify.xfem.slivers import join_fragments
from verify.xfem.supports import UnsupportedBodyError, check_bodies

_NODES = 3000  # of the mesh on which it is looked: cut in 0.1 s


def check_pieces_are_held(scene: Scene, exact: object) -> None:
    """Raise `InputError` if a piece of a body that is to be in equilibrium can move rigidly.

    The body is cut as `verify.xfem` cuts it, on the finest of the scene's meshes that is cheap.
    """
    static = scene.analysis.kind == "static"
    if not static and not isinstance(scene.initial, Equilibrium):
        return
    mesh, size = background_mesh(scene, _level(scene))
    opened = static or (isinstance(scene.initial, Equilibrium) and scene.initial.cuts == "open")
    cuts = [
        cut
        for cut, asked in zip(cuts_of(scene, size), scene.cuts, strict=True)
        if static or (opened and asked.kind != "tool_path" and asked.opens_at == 0.0)
    ]
    try:
        phantom = cut_mesh(mesh, cuts)
        phantom, _ = join_fragments(phantom, supports_of(scene, phantom, exact))
        check_bodies(phantom, supports_of(scene, phantom, exact))
    except UnsupportedBodyError as error:
        apart = mesh_warning(scene)
        text = f"supports: {error}{f' ({apart})' if apart else ''}"
        raise InputError(text, str(scene.file or scene.name)) from None
    except XfemError:
        return  # no fault of the scene: another method may cut this mesh


def _level(scene: Scene) -> int:
    """Finest level of a structured mesh with few nodes; else the first."""
    if scene.mesh.pattern != "structured":
        return 0
    cheap = [0]
    for level in range(1, scene.mesh.count):
        found = mesh_of_level(scene, level)
        if found is not None and found[0] <= _NODES:
            cheap.append(level)
    return cheap[-1]

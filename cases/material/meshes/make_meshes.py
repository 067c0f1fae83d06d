"""Meshes with groups, made by gmsh in millimetres: an organ-like blob, and a sleeve in layers."""

import gmsh
import numpy as np


def closed_curve(radius: np.ndarray, centre: tuple[float, float]) -> tuple[int, list[int]]:
    """Draw a closed spline through points at equal angles: the curve loop, and its curves."""
    angles = 2.0 * np.pi * np.arange(len(radius)) / len(radius)
    points = [
        gmsh.model.occ.addPoint(centre[0] + r * np.cos(a), centre[1] + r * np.sin(a), 0.0)
        for r, a in zip(radius, angles, strict=True)
    ]
    half = len(points) // 2
    curves = [
        gmsh.model.occ.addBSpline([*points[: half + 1]]),
        gmsh.model.occ.addBSpline([*points[half:], points[0]]),
    ]
    return gmsh.model.occ.addCurveLoop(curves), curves


def written(name: str, surfaces: dict[str, int], curves: dict[str, list[int]], size: float) -> None:
    """Name the groups, mesh and write."""
    gmsh.model.occ.synchronize()
    for group, surface in surfaces.items():
        gmsh.model.addPhysicalGroup(2, [surface], name=group)
    for group, some in curves.items():
        gmsh.model.addPhysicalGroup(1, some, name=group)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)
    gmsh.write(name)
    gmsh.model.remove()


def blob() -> None:
    """Mesh an outline of varying curvature with a round inclusion off its centre."""
    angle = 2.0 * np.pi * np.arange(16) / 16
    outline, curves = closed_curve(30.0 + 4.0 * np.cos(2 * angle) + 2.0 * np.sin(3 * angle), (0, 0))
    nodule, _ = closed_curve(np.full(12, 9.0), (11.0, 5.0))
    tissue = gmsh.model.occ.addPlaneSurface([outline, nodule])
    inclusion = gmsh.model.occ.addPlaneSurface([nodule])
    written("blob.msh", {"tissue": tissue, "nodule": inclusion}, {"back": curves[1:]}, 3.0)


def sleeve() -> None:
    """Mesh the section of a tube of two layers."""
    loops = [closed_curve(np.full(12, radius), (0.0, 0.0)) for radius in (12.0, 17.0, 21.0)]
    inner = gmsh.model.occ.addPlaneSurface([loops[1][0], loops[0][0]])
    outer = gmsh.model.occ.addPlaneSurface([loops[2][0], loops[1][0]])
    rims = {"lumen": loops[0][1], "outside": loops[2][1][1:]}
    written("sleeve.msh", {"lining": inner, "wall": outer}, rims, 1.5)


if __name__ == "__main__":
    gmsh.initialize()
    gmsh.option.setNumber("General.Verbosity", 2)
    blob()
    sleeve()
    gmsh.finalize()

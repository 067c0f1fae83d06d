"""Meshes: conforming to the cut with its nodes doubled, or unfitted background meshes."""

from reference.meshing.background import background_mesh
from reference.meshing.conforming import conforming_mesh
from reference.meshing.grading import Grading, singular_points
from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import ConformingMesh, open_cut

__all__ = [
    "ConformingMesh",
    "Grading",
    "background_mesh",
    "conforming_mesh",
    "imprint",
    "open_cut",
    "singular_points",
    "structured_triangles",
]

"""Meshes: conforming to the cut with its nodes doubled, or unfitted background meshes."""

from reference.meshing.conforming import conforming_mesh
from reference.meshing.imprint import (
    Realised,
    imprint,
    imprint_facets,
    imprint_polygons,
    structured_tetrahedra,
    structured_triangles,
)
from reference.meshing.opening import ConformingMesh, open_cut
from reference.meshing.session import Grading, background_mesh, clear_radii, singular_points

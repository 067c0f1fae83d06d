"""The scene: what is asked of every solver. Strict, in SI units, solver-neutral."""

from verify.scene.acceptance import (
    BoundCheck,
    DisplacementQuantity,
    OpeningQuantity,
    RateCheck,
    RatioCheck,
    StrainEnergyQuantity,
    ValueCheck,
)
from verify.scene.cuts import ArcCut, PolygonCut, PolylineCut
from verify.scene.geometry import Box, MeshFile, Polygon, Rectangle
from verify.scene.loading import (
    case_folder,
    list_cases,
    load_scene,
    mesh_path,
    restore_scene,
    scene_content,
    scene_hash,
    scene_schema,
)
from verify.scene.mesh import MeshLevels, ReferenceLevels
from verify.scene.mesh_file import read_mesh
from verify.scene.physics import (
    Analysis,
    BodyForce,
    Exact,
    Gravity,
    Material,
    Support,
    Traction,
)
from verify.scene.regions import Region, parse_region
from verify.scene.scene import Scene

__all__ = [
    "Analysis",
    "ArcCut",
    "BodyForce",
    "BoundCheck",
    "Box",
    "DisplacementQuantity",
    "Exact",
    "Gravity",
    "Material",
    "MeshFile",
    "MeshLevels",
    "OpeningQuantity",
    "Polygon",
    "PolygonCut",
    "PolylineCut",
    "RateCheck",
    "RatioCheck",
    "Rectangle",
    "ReferenceLevels",
    "Region",
    "Scene",
    "StrainEnergyQuantity",
    "Support",
    "Traction",
    "ValueCheck",
    "case_folder",
    "list_cases",
    "load_scene",
    "mesh_path",
    "parse_region",
    "read_mesh",
    "restore_scene",
    "scene_content",
    "scene_hash",
    "scene_schema",
]

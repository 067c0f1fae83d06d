"""The scene: what is asked of every solver. Strict, in SI units, solver-neutral."""

from verify.scene.acceptance import (
    BoundCheck,
    DisplacementQuantity,
    KnownFinding,
    MaximumDisplacementQuantity,
    OpeningQuantity,
    PartQuantity,
    RateCheck,
    RatioCheck,
    StrainEnergyQuantity,
    StressIntensityQuantity,
    ValueCheck,
)
from verify.scene.cut_faces import Faces, faces_of
from verify.scene.cuts import ArcCut, PolylineCut
from verify.scene.geometry import Box, MeshFile, Polygon, Rectangle
from verify.scene.initial import AtRest, Equilibrium, InitialField, Moving
from verify.scene.loading import (
    case_folder,
    list_cases,
    load_scene,
    load_scenes,
    mesh_path,
    restore_scene,
    scene_content,
    scene_hash,
    scene_schema,
)
from verify.scene.materials import Material, MaterialRegion, Moduli, crossed_by_interfaces
from verify.scene.mesh import MeshLevels, ReferenceLevels
from verify.scene.mesh_file import read_mesh
from verify.scene.physics import (
    Analysis,
    BodyForce,
    CutFaces,
    Exact,
    Gravity,
    Rotation,
    Support,
    Traction,
    is_timed,
    is_uniform,
)
from verify.scene.regions import Region, parse_expression, parse_region
from verify.scene.replay import Pull, Replay
from verify.scene.scene import Scene
from verify.scene.skin import Skin
from verify.scene.spatial_cuts import (
    CylinderCut,
    DiscCut,
    PolygonCut,
    SpatialCut,
    SphereCut,
    SweptCut,
)
from verify.scene.tool_path import ToolPathCut

__all__ = [
    "Analysis",
    "ArcCut",
    "AtRest",
    "BodyForce",
    "BoundCheck",
    "Box",
    "CutFaces",
    "CylinderCut",
    "DiscCut",
    "DisplacementQuantity",
    "Equilibrium",
    "Exact",
    "Faces",
    "Gravity",
    "InitialField",
    "KnownFinding",
    "Material",
    "MaterialRegion",
    "MaximumDisplacementQuantity",
    "MeshFile",
    "MeshLevels",
    "Moduli",
    "Moving",
    "OpeningQuantity",
    "PartQuantity",
    "Polygon",
    "PolygonCut",
    "PolylineCut",
    "Pull",
    "RateCheck",
    "RatioCheck",
    "Rectangle",
    "ReferenceLevels",
    "Region",
    "Replay",
    "Rotation",
    "Scene",
    "Skin",
    "SpatialCut",
    "SphereCut",
    "StrainEnergyQuantity",
    "StressIntensityQuantity",
    "Support",
    "SweptCut",
    "ToolPathCut",
    "Traction",
    "ValueCheck",
    "case_folder",
    "crossed_by_interfaces",
    "faces_of",
    "is_timed",
    "is_uniform",
    "list_cases",
    "load_scene",
    "load_scenes",
    "mesh_path",
    "parse_expression",
    "parse_region",
    "read_mesh",
    "restore_scene",
    "scene_content",
    "scene_hash",
    "scene_schema",
]

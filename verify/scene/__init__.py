"""The scene: the question to every solver. Strict, in SI units, solver-neutral."""

from verify.scene.acceptance import BoundCheck, PartQuantity, RateCheck, RatioCheck, ValueCheck
from verify.scene.cuts import (
    ArcCut,
    CylinderCut,
    DiscCut,
    PolygonCut,
    PolylineCut,
    SphereCut,
    SweptCut,
    faces_of,
)
from verify.scene.geometry import Box, MeshFile, Polygon, Rectangle, Skin
from verify.scene.loading import (
    case_folder,
    list_cases,
    load_scene,
    load_scenes,
    read_mesh,
    restore_scene,
    scene_content,
    scene_hash,
    scene_schema,
)
from verify.scene.physics import (
    Analysis,
    BodyForce,
    CutFaces,
    Gravity,
    Material,
    Rotation,
    Support,
    Traction,
    crossed_by_interfaces,
    is_uniform,
)
from verify.scene.regions import parse_expression, parse_region
from verify.scene.scene import Scene
from verify.scene.tables import Equilibrium, InitialField, Moving, Pull
from verify.scene.tool_path import ToolPathCut

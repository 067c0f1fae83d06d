"""Consistency of tool paths, pulls and surfaces with the rest of a scene."""

from verify.scene.nearest import nearest
from verify.scene.tables import SceneTables
from verify.scene.tool_path import ToolPathCut


def check_replay(scene: SceneTables) -> None:
    """Raise ValueError if tool paths, pulls or surfaces do not fit the rest of the scene."""
    analysis, d = scene.analysis, scene.dimension
    for i, cut in enumerate(scene.cuts):
        if not isinstance(cut, ToolPathCut):
            continue
        if analysis.duration is None:
            raise ValueError(f"cuts[{i}]: a tool_path takes time; it needs a dynamic analysis")
        if cut.ends_at > analysis.duration * (1.0 + 1e-12):
            raise ValueError(
                f"cuts[{i}]: the tool arrives at {cut.ends_at:g} s, after the end of the analysis "
                f"at {analysis.duration:g} s"
            )
    if scene.replay is None:
        return
    if analysis.duration is None or analysis.time_step is None:
        raise ValueError("replay: needs a dynamic analysis with a time_step")
    names = [cut.name for cut in scene.cuts]
    for i, pull in enumerate(scene.replay.pulls):
        place = f"replay.pulls[{i}]"
        if len(pull.at) != d:
            raise ValueError(f"{place}.at: {len(pull.at)} coordinates in a {d}D scene")
        if pull.cut not in names:
            raise ValueError(f"{place}.cut: no cut '{pull.cut}'{nearest(pull.cut, names)}")
        if pull.begin >= analysis.duration:
            raise ValueError(f"{place}.begin: {pull.begin:g} s is after the end of the analysis")
    solid = scene.cell_dimension == 3
    for key in ("visual", "collision"):
        if getattr(scene.replay, key) is not None and not solid:
            raise ValueError(f"replay.{key}: a plane body or membrane is its own surface")

"""A simulated scene as arrays: body, supports, strokes, hooks, surfaces."""

from dataclasses import dataclass, field

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.body import RayleighDamping
from verify.xfem.cuts import ToolPath
from verify.xfem.elasticity import Material
from verify.xfem.mesh import SimplexMesh


@dataclass(frozen=True)
class Hold:
    """Nodes of the uncut mesh that are held.

    Attributes
    ----------
    nodes : (n,) bool array
    components : tuple of int
    values : (c,) float array
        Displacement of each of the components, m.
    """

    nodes: Bools
    components: tuple[int, ...]
    values: Floats


@dataclass(frozen=True)
class Hook:
    """Grips the material on one side of a stroke and moves it, or pulls at it.

    Attributes
    ----------
    at : (s,) float array
        In the uncut body, m.
    radius : float
        m.
    stroke : int
        Number of the stroke beside which it grips.
    side : int
        +1 or -1.
    vector : (s,) float array
        Displacement in m or force in N, reached at the end.
    is_force : bool
    begin, duration : float
        s.
    """

    at: Floats
    radius: float
    stroke: int
    side: int
    vector: Floats
    is_force: bool
    begin: float
    duration: float

    def share(self, time: float) -> float:
        """How much of the vector there is at a time: from 0 to 1, without a jump in velocity."""
        s = min(max((time - self.begin) / self.duration, 0.0), 1.0)
        return s * s * (3.0 - 2.0 * s)

    def at_edge(self, path: ToolPath) -> Floats:
        """Place (s,) of the edge of a cut that is nearest to where the hook grips, m."""
        blade = (path.blades[:, -1] - path.blades[:, 0]).mean(axis=0)
        along = blade / (np.linalg.norm(blade) or 1.0)
        away = path.blades[:, 0] - self.at
        away -= np.outer(away @ along, along)  # what lies along the blade is no distance
        fine = np.linspace(0.0, len(away) - 1.0, 50 * len(away))
        line = np.column_stack([np.interp(fine, np.arange(len(away)), x) for x in away.T])
        return self.at + line[np.argmin(np.linalg.norm(line, axis=1))]

    def rate(self, time: float) -> float:
        """Time derivative of `share`, in 1/s."""
        s = min(max((time - self.begin) / self.duration, 0.0), 1.0)
        return 6.0 * s * (1.0 - s) / self.duration


@dataclass(frozen=True)
class Stage:
    """A scene to be played.

    Attributes
    ----------
    mesh : SimplexMesh
        Triangles in the plane, tetrahedra, or triangles in space (a membrane).
    material : Material
        Of a membrane times the thickness.
    density : float
        kg/m³; of a membrane times the thickness.
    gravity : (s,) float array
        m/s².
    time_step, duration : float
        s.
    holds, hooks : lists
    strokes : list of ToolPath
        In the order of their numbers.
    damping : RayleighDamping
    visual, collision : (points, facets), optional
        Surfaces beside that of the material, for solids.
    tool_radius : float
        m.
    tool_force : float
        With which the moving blade drags what it touches, N.
    """

    mesh: SimplexMesh
    material: Material
    density: float
    gravity: Floats
    time_step: float
    duration: float
    holds: list[Hold] = field(default_factory=list)
    hooks: list[Hook] = field(default_factory=list)
    strokes: list[ToolPath] = field(default_factory=list)
    damping: RayleighDamping = field(default_factory=RayleighDamping)
    visual: tuple[Floats, Ints] | None = None
    collision: tuple[Floats, Ints] | None = None
    tool_radius: float = 0.0
    tool_force: float = 0.0

    @property
    def steps(self) -> int:
        """Number of steps; the last one may end a little later than the duration."""
        return int(np.ceil(self.duration / self.time_step * (1.0 - 1e-12)))

"""Tip functions of GetFEM around the ends of cuts in the plane.

Each node of a fixed area around a tip has the four functions √r sin(θ/2), √r cos(θ/2), … times its
hat function (Laborde, Pommier, Renard, Salaün 2005, doi:10.1002/nme.1370).
"""

import getfem as gf
import numpy as np

SHARE = 0.25  # of the length of its cut: radius of the area around a tip
RULES = (
    "IM_STRUCTURED_COMPOSITE(IM_TRIANGLE(6),3)",
    "IM_STRUCTURED_COMPOSITE(IM_GAUSS_PARALLELEPIPED(2,6),9)",  # of cells with a tip
)
_AREA = 1  # number of the region that has functions
_NEAR = 1e-9  # barycentric


class TipAreas:
    """Where the cuts of a body end inside it, and which nodes have functions of these tips.

    Attributes
    ----------
    tips : (t, 2) array
    nodes : list of (n,) bool array
        For each cut. None is on the boundary, where values and forces are nodal.
    elements : (m,) bool array
        Those that have such a node.
    """

    def __init__(self, case, body):
        points, boundary = case.points, np.zeros(len(case.points), dtype=bool)
        boundary[np.array(case.problem["boundary"])] = True
        tips, self.nodes = [], []
        for cut in body.cuts:
            radius = SHARE * np.linalg.norm(np.diff(cut.points, axis=0), axis=1).sum()
            near = np.zeros(len(points), dtype=bool)
            for tip in (cut.points[0], cut.points[-1]):
                weights = _weights(points[case.cells], tip)
                here = (weights > -_NEAR).all(axis=1)
                support = case.cells[here][weights[here] > _NEAR]
                if not boundary[support].all():
                    tips.append(tip)
                    near |= np.linalg.norm(points - tip, axis=1) < radius
                    near[case.cells[here]] = True
            self.nodes.append(near & ~boundary)
        self.tips = np.array(tips).reshape(-1, 2)
        near = np.any([np.zeros_like(boundary), *self.nodes], axis=0)  # there may be no cut
        self.elements = near[case.cells].any(axis=1)

    def spaces(self, case, space, hats):
        """Return the spaces of the functions, scalar and of displacements."""
        place = {tuple(at): k for k, at in enumerate(hats.basic_dof_nodes().T.round(9))}
        number = np.array([place[tuple(at)] for at in case.points.round(9)])
        functions = [gf.GlobalFunction("crack", k) for k in range(4)]
        found = []
        for size in (1, case.dimension):
            own = []
            for level, near in zip(space.levels, self.nodes, strict=True):
                if near.any():
                    singular = gf.MeshFem("global function", space.mesh, level, functions)
                    own.append(gf.MeshFem("product", hats, singular))
                    own[-1].set_enriched_dofs(np.sort(number[near]))
            found.append(gf.MeshFem("sum", *own))
            found[-1].set_qdim(size)
        space.mesh.set_region(_AREA, np.flatnonzero(self.elements)[None])
        return found

    def stiffness(self, rule, regular, singular, lame, shear):
        """Return what the functions add to the stiffness; the regular unknowns come first."""

        def energy(u, v):
            strains = f"(Grad_{u}+Grad_{u}'):(Grad_Test_{v}+Grad_Test_{v}')"
            return f"{lame!r}*Trace(Grad_{u})*Trace(Grad_Test_{v})+{0.5 * shear!r}*{strains}"

        text = "+".join(energy(*pair) for pair in ("us", "su", "ss"))
        return gf.asm_generic(rule, 2, text, _AREA, *_fields(regular, singular))

    def load(self, rule, regular, singular, weight):
        """Return the body forces of the functions, after zeros for the regular unknowns."""
        text = f"[{weight[0]!r},{weight[1]!r}].Test_s"
        return gf.asm_generic(rule, 1, text, _AREA, *_fields(regular, singular))


def _fields(regular, singular):
    return [
        word
        for name, space in (("u", regular), ("s", singular))
        for word in (name, 1, space, np.zeros(space.nbdof()))
    ]


def _weights(corners, at):
    """Barycentric coordinates (m, 3) of a point in triangles (m, 3, 2)."""
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    local = np.linalg.solve(edges, (at - corners[:, 0])[..., None])[..., 0]
    return np.column_stack([1.0 - local.sum(axis=1), local])

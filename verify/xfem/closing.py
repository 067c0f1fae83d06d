"""Unilateral contact, without friction, of the faces of cuts: Nitsche's method.

Let g be the normal jump of the displacement over a face, positive where it is open. Let σ be a mean
of the normal stresses on both sides. The conditions g ≥ 0, σ ≤ 0, σ g = 0 are σ = [σ + γ g]₋ with
any γ > 0. Here [x]₋ is the smaller of x and 0. They hold at the minimum of the energy

    J(u) = ½ a(u, u) − f·u + ∫ ([σ + γ g]₋² − σ²) / 2γ dS

over the faces (symmetric Nitsche: Chouly & Hild, SIAM J. Numer. Anal. 51, 2013). The pressure is
p = −[σ + γ g]₋ on both faces alike. The slope is consistent: a field of the space that fulfils the
conditions is found to round-off. Without multipliers there is no inf-sup condition. Stability needs
a bound of the stress on a face instead,

    ∫ σ²/γ dS ≤ a(u, u) / c,  c > 1,  hence  J″ ≥ (1 − 1/c) a  whichever faces touch.

Linear simplices have it with a known constant. Take a piece of volume V and wave modulus
M = λ + 2μ. There the square of the normal stress is at most 2M times the density of the energy. The
mean with the least bound weighs stresses by V/M: the larger piece decides, and a sliver does not
(Annavarapu, Hautefeuille & Dolbow, Comput. Methods Appl. Mech. Engrg. 225, 2012, of ties). Then

    γ = c n A / (V₁/M₁ + V₂/M₂).

A is the largest facet of the cells, as no plane section of a simplex is larger. The piece with more
faces has n of them. In a cut cell V₁ + V₂ is its volume, so γ is of the order of M/h wherever the
cut goes.

J is convex and quadratic in parts. Its second derivative is at most the one with all faces tied. A
correction by the latter lowers J without a search. Newton's method takes it where its own does not
lead down: J always falls, and no set of touching faces comes twice in a circle.

Along a curved cut g is measured by the normals of the cut as asked: a slip s across flat facets
would read as a gap of s h/R. Forces keep the normals of facets, so that a pressure from all sides
stays in equilibrium. The difference is a given gap in J, and is corrected from solution to
solution.

At the points of a face the pressure zigzags about the true one. It makes up for what the stress of
linear elements is off by: h times its slope, and beside an end under shear a part of K/√h.
`averaged` takes means over the hat functions of the nodes of the cut and interpolates them by the
same hats: of order h² where contact is smooth, h where it ends. At an end under shear a part of
K/√h is left over a length h, on any mesh without tip functions: the mean error has order ½, its
square none.

In motion σ is left out, and the energy is the penalty ∫ γ [g]₋²/2 dS, with a γ five times as
large. It is never negative, so kinetic and strain energy never exceed the initial ones. Its force
is taken at the end of a step, whatever the scheme takes of the others. As the energy is convex, the
work of that force is at least the change of the energy: an impact gains nothing and loses O(h). A
force of the middle would lose nothing. But the pressure of bars that meet would go from 0 to 5
times its value and back from step to step.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array

from verify.xfem.arrays import (
    Bools,
    Floats,
    Ints,
    NotConvergedError,
    SingularStiffnessError,
    XfemError,
    finite_array,
)
from verify.xfem.block_pattern import BlockPattern, pattern_places
from verify.xfem.cuts import Cut
from verify.xfem.element import Material
from verify.xfem.equilibrium import LoadPath
from verify.xfem.internal_force import Configuration, InternalForce, Kinematics
from verify.xfem.loads_and_supports import Supports, check_bodies, simplex_rule
from verify.xfem.mesh import connected
from verify.xfem.phantom import PhantomMesh
from verify.xfem.statics import ROUND_OFF, Newton, NotInEquilibriumError
from verify.xfem.subdivision import subdivide, torn_facets

STABILITY = 2.0  # c: a(u, u) keeps half of itself at least
FIRMNESS = 10.0  # in place of c where σ is left out: right triangles overlap by 0.04 p h/M
# share of the largest facet: smaller ones rim pieces of round-off size that the others have taken,
# along faces of cells and not along the cut
_RIM = 1e-7
_SMOOTH = np.cos(np.pi / 6.0)  # a resolved arc turns by at most half a radian from facet to facet


class ClosingFaces:
    """Faces of the cuts of a body, which cannot overlap; linear kinematics.

    At finite rotation: `verify.xfem.turning_faces`.

    Parameters
    ----------
    phantom : PhantomMesh
    material : Material
    cuts : sequence of Cut
        As asked, for the normals of curved ones. Without them, and in motion, normals of facets
        serve.
    moving : bool
        Whether the energy is a penalty, without σ; see the docstring of the module.

    Attributes
    ----------
    nodes : (f, 2 (d + 1)) int array
        Dof nodes of both pieces at each facet of the cut.
    gap : (f, q, 2 (d + 1), d) float array
        Normal jump at the quadrature points of each facet, by the displacement of these nodes.
    pieces : (f, 2) int array
        Of both sides of each facet, and `share` (f, 2) of each in mean stresses.
    normal : (f, d) float array
        Of each facet, out of the material that comes first in `nodes`.
    shapes : (f, q, 2 (d + 1)) float array
        Jump of the displacement, second side less first, for a unit one of each node.
    gradients : (f, 2 (d + 1), d) float array
        Of the displacement, the mean of both sides, in 1/m; weighted as the stress.
    stress : (f, 2 (d + 1), d) float array
        Mean normal stress there, in Pa/m.
    stiffness : (f,) float array
        γ, in Pa/m.
    points : (f, q, d) float array
        Quadrature points, in metres.
    weights : (f, q) float array
        In m^(d − 1).

    Raises
    ------
    XfemError
        If cells are aggregated, or the body is a membrane.
    """

    kinematics: Kinematics = "linear"

    def __init__(
        self,
        phantom: PhantomMesh,
        material: Material,
        cuts: Sequence[Cut] = (),
        moving: bool = False,
    ) -> None:
        if phantom.aggregation is not None or phantom.mesh.is_membrane:
            raise XfemError(
                "contact of a body with aggregated cells or of a membrane; expected a solid or "
                "plane body of its own unknowns"
            )
        mesh = phantom.mesh
        self.phantom = phantom
        body = subdivide(phantom)
        _, place = np.unique(body.points, axis=0, return_inverse=True)
        facets, beside = torn_facets(body.cells, place.ravel()[body.cells])
        largest = mesh.measures * mesh.dim * np.linalg.norm(mesh.gradients, axis=2).max(axis=1)
        largest = largest[body.cell_parent[beside]].max(axis=1)
        normal, area = _normals(body.points[facets[:, 0]])
        some = area > _RIM * largest
        facets, beside, largest = facets[some], beside[some], largest[some]
        normal, area = normal[some], area[some]
        pieces, corners = body.cell_piece[beside], body.points[facets[:, 0]]
        rule, share = simplex_rule(mesh.dim - 1, 2)
        self.points = np.einsum("qk,fkd->fqd", rule, corners)
        # out of the first simplex, into the second
        inward = (body.points[body.cells[beside[:, 1]]].mean(axis=1) - corners[:, 0]) * normal
        normal *= np.sign(inward.sum(axis=1))[:, None]
        self.weights = share * area[:, None]
        lam, mu = (x[phantom.parent[pieces]] for x in material.of_cells(len(mesh.cells)))
        gradients = mesh.gradients[phantom.parent[pieces]]  # (f, 2, c, d)
        along = np.einsum("fsid,fd->fsi", gradients, normal)
        flexible = phantom.part_fraction[pieces] * mesh.measures[phantom.parent[pieces]]
        flexible /= lam + 2.0 * mu
        self.pieces, self.share = pieces, flexible / flexible.sum(axis=1, keepdims=True)
        self.normal, normal = normal, normal[:, None, None]
        self.gradients = _flat(self.share[..., None, None] * gradients, 1)
        stress = lam[..., None, None] * gradients + 2.0 * mu[..., None, None] * (
            along[..., None] * normal
        )
        self.stress = (0.0 if moving else 1.0) * _flat(self.share[..., None, None] * stress, 1)
        first = mesh.points[mesh.cells[phantom.parent[pieces], 0]]
        shapes = np.einsum("fsid,fqsd->fqsi", gradients, self.points[:, :, None] - first[:, None])
        shapes[..., 0] += 1.0
        shapes[:, :, 0] *= -1.0
        self.shapes = _flat(shapes[..., None], 2)[..., 0]
        self.gap = self.shapes[..., None] * self.normal[:, None, None]
        step = 0.25 * largest ** (1.0 / (mesh.dim - 1))
        smooth = _curved(self.normal, self.points, step, cuts)
        turned = self.shapes[..., None] * (smooth - self.normal[:, None])[:, :, None]
        self.nodes: Ints = np.concatenate(list(phantom.cells[pieces.T]), axis=1)
        firmness = (FIRMNESS if moving else STABILITY) * _faces_of_pieces(phantom.part[pieces])
        self.stiffness = firmness * largest / flexible.sum(axis=1)
        self._rows = self.stress[:, None] + self.stiffness[:, None, None, None] * self.gap
        self._per_stiffness = self.weights / self.stiffness[:, None]
        self._trial = self._of_nodes(self._rows)
        self._mean = self._of_nodes(self.stress[:, None])
        self._turned = self._trial.T.tocsr(), self._mean.T.tocsr()
        self._bend = None if moving else self._of_nodes(turned)
        self._entries: tuple[BlockPattern, csc_array, Floats] | None = None

    def _of_nodes(self, rows: Floats) -> csr_array:
        """Make the matrix (k, N d) of rows (f, …, 2 (d + 1), d), by displacements of dof nodes."""
        space, width = rows.shape[-1], self.nodes.shape[1] * rows.shape[-1]
        columns = self.nodes[..., None] * space + np.arange(space)
        columns = np.broadcast_to(columns.reshape(len(rows), 1, width), (*rows.shape[:2], width))
        starts = np.arange(columns.shape[0] * columns.shape[1] + 1) * width
        shape = len(starts) - 1, self.phantom.node_count * space
        return csr_array((rows.ravel(), columns.ravel(), starts), shape=shape)

    @property
    def couplings(self) -> Ints:
        """(k, 2) pairs of dof nodes on both sides of each facet."""
        half = self.nodes.shape[1] // 2
        one, other = self.nodes[:, :half], self.nodes[:, half:]
        pairs = np.stack(np.broadcast_arrays(one[:, :, None], other[:, None]), axis=-1)
        return np.unique(np.sort(pairs.reshape(-1, 2), axis=1), axis=0)

    def slid(self, displacement: Floats, force: InternalForce) -> Floats:
        """Compute the gap (f, q) in metres by which curved faces open as they slide.

        Beside the normal jump: the `slide` of the methods below. See the docstring of the module.
        """
        del force  # linear: its stress is part of the energy
        if self._bend is None:
            return np.zeros(self.weights.shape)
        return (self._bend @ displacement.ravel()).reshape(self.weights.shape)

    def trial_stress(self, displacement: Floats, slide: Floats | float = 0.0) -> Floats:
        """Compute σ + γ g (f, q) in pascal at a displacement (N, d) of the dof nodes."""
        trial = (self._trial @ displacement.ravel()).reshape(self.weights.shape)
        return trial + self.stiffness[:, None] * slide

    def pressure(self, displacement: Floats, slide: Floats | float = 0.0) -> Floats:
        """Compute the pressure (f, q) between the faces in pascal; zero where they are apart."""
        return np.maximum(0.0, -self.trial_stress(displacement, slide))

    def freed_pressure(self, displacement: Floats) -> Floats:
        """Compute the pressure (f, q) in motion; nan where nothing parts the faces yet."""
        trial = self.trial_stress(displacement)
        least = ROUND_OFF * np.abs(self.phantom.node_points + displacement).max()
        found = np.where(np.abs(trial) > least * self.stiffness[:, None], -trial, np.nan)
        return np.maximum(0.0, found)

    def averaged(self, pressure: Floats) -> Floats:
        """Average a pressure (f, q) over the hat functions of the nodes, where faces touch.

        See the docstring of the module. A uniform pressure, the force between the faces and the
        part of them that touches stay as they are.
        """
        touches = (pressure > 0.0).ravel()
        area = self._hats.T @ (self.weights.ravel() * touches)
        mean = self._hats.T @ (self.weights * pressure).ravel()
        np.divide(mean, area, out=mean, where=area > 0.0)
        found: Floats = (touches * (self._hats @ mean)).reshape(pressure.shape)
        return found

    @cached_property
    def _hats(self) -> csr_array:
        """Hat functions (f q, k) on the faces.

        A node has one on each face that it belongs to. A face is of two parts, and smooth.
        """
        half = self.nodes.shape[1] // 2
        one, other = self.nodes[:, :half], self.nodes[:, half:]
        # nodes of a mesh that is cut for good are at one place and not of one parent
        place = np.unique(self.phantom.node_points, axis=0, return_inverse=True)[1].ravel()
        facing = place[one][:, :, None] == place[other][:, None]
        has, there = facing.any(axis=2), np.take_along_axis(other, facing.argmax(axis=2), axis=1)
        facet, corner = np.nonzero(has)
        pairs = np.sort(np.stack([one[has], there[has]], axis=1), axis=1)
        pair = np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
        shape = len(self.nodes), len(pairs)
        at = csr_array((np.ones(len(pair)), (facet, pair)), shape=shape)
        first, second = (at @ at.T).nonzero()
        flat = np.abs(np.sum(self.normal[first] * self.normal[second], axis=1)) > _SMOOTH
        face = connected(len(self.nodes), first[flat], second[flat])[facet]
        column = np.unique(np.stack([pair, face]), axis=1, return_inverse=True)[1].ravel()
        count = self.weights.shape[1]
        rows = facet[:, None] * count + np.arange(count)
        columns = np.broadcast_to(column[:, None], rows.shape)
        values = -self.shapes[facet, :, corner]
        return csr_array(
            (values.ravel(), (rows.ravel(), columns.ravel())),
            shape=(self.weights.size, int(column.max(initial=-1)) + 1),
        )

    def energy(self, displacement: Floats, slide: Floats | float = 0.0) -> float:
        """Return the energy in joules beside the elastic one; open faces that bear σ lower it."""
        own = self._mean @ displacement.ravel()
        squares = self.pressure(displacement, slide) ** 2 - own[:, None] ** 2
        return float(np.sum(self._per_stiffness * squares)) / 2.0

    def force(self, displacement: Floats, slide: Floats | float = 0.0) -> Floats:
        """Return the slope (N, d) of the energy, in newtons."""
        traction = np.minimum(self.trial_stress(displacement, slide), 0.0)
        own = self._per_stiffness.sum(axis=1) * (self._mean @ displacement.ravel())
        total = self._turned[0] @ (self._per_stiffness * traction).ravel() - self._turned[1] @ own
        return total.reshape(displacement.shape)

    def force_of_step(self, before: Floats, after: Floats) -> Floats:
        """Return the force (N, d) of a step from one displacement (N, d) to another, in newtons."""
        del before  # normals do not turn
        return self.force(after)

    def touching(self, displacement: Floats, slide: Floats | float = 0.0) -> Bools:
        """Tell whether faces press on each other, (f, q)."""
        return self.trial_stress(displacement, slide) < 0.0

    def add_stiffness(
        self, pattern: BlockPattern, blocks: Floats, touching: Floats | Bools | bool
    ) -> None:
        """Add the second derivative of the energy to the nodal blocks (B, d, d).

        Parameters
        ----------
        pattern : BlockPattern
            Of the body, with the `couplings`.
        blocks : (B, d, d) float array
        touching : (f, q) array or bool
            Share of the stiffness of a closed face: 1 where faces touch, 0 where they are apart.
        """
        if self._entries is None or self._entries[0] is not pattern:
            self._entries = pattern, *self._stiffness_of_points(pattern, blocks.shape[1])
        _, of_points, own = self._entries
        closed = np.broadcast_to(touching, self.weights.shape).ravel()
        blocks += (of_points @ closed.astype(float) - own).reshape(blocks.shape)

    def add_stiffness_of_step(
        self, pattern: BlockPattern, blocks: Floats, before: Floats, after: Floats
    ) -> None:
        """Add the derivative of the force of a step by its end to the nodal blocks (B, d, d)."""
        del before
        self.add_stiffness(pattern, blocks, self.touching(after))

    def add_tangent(
        self, pattern: BlockPattern, blocks: Floats, displacement: Floats,
        slide: Floats, touching: Floats, rotational: float,
    ) -> None:  # fmt: skip
        """Add the second derivative of the energy at a displacement (N, d), as `add_stiffness`.

        `rotational` is the share of what comes from the turn of normals.
        """
        del displacement, slide, rotational  # normals do not turn
        self.add_stiffness(pattern, blocks, touching)

    def _stiffness_of_points(self, pattern: BlockPattern, space: int) -> tuple[csc_array, Floats]:
        """Find entries (B d², f q) of blocks by each point that touches, and of −∫ σ²/γ (B d²,)."""
        rows, columns = np.broadcast_arrays(self.nodes[:, :, None], self.nodes[:, None])
        blocks = pattern_places(pattern, rows.ravel(), columns.ravel()).reshape(rows.shape)
        axes = np.arange(space**2).reshape(space, space)
        places = blocks[..., None, None] * space**2 + axes  # (f, i, j, a, b)
        values = np.einsum("fq,fqia,fqjb->fqijab", self._per_stiffness, self._rows, self._rows)
        own = self._per_stiffness.sum(axis=1)
        own = np.einsum("f,fia,fjb->fijab", own, self.stress, self.stress)
        size = len(pattern.columns) * space**2
        repeated = np.broadcast_to(places[:, None], values.shape)
        starts = np.arange(self.weights.size + 1) * (self.nodes.shape[1] * space) ** 2
        of_points = csc_array(
            (values.ravel(), repeated.ravel(), starts), shape=(size, self.weights.size)
        )
        return of_points, np.bincount(places.ravel(), own.ravel(), size)


def _flat(values: Floats, axis: int) -> Floats:
    """Join the axes of the two sides and of the corners of each."""
    shape = values.shape
    return values.reshape(*shape[:axis], shape[axis] * shape[axis + 1], *shape[axis + 2 :])


def _normals(corners: Floats) -> tuple[Floats, Floats]:
    """Find unit normals (f, d) and areas (f,) of facets by their corners (f, d, d)."""
    _, lengths, ways = np.linalg.svd(corners[:, 1:] - corners[:, :1])
    return ways[:, -1], lengths.prod(axis=1) / lengths.shape[1]


def _curved(flat: Floats, points: Floats, step: Floats, cuts: Sequence[Cut]) -> Floats:
    """Find normals (f, q, d) of the cuts themselves at points (f, q, d) of their facets.

    They are differences of the distance over a `step` (f,) each way. A facet that lies beside no
    cut, or across a bend, keeps its own normal (f, d).
    """
    kept = np.broadcast_to(flat[:, None], points.shape)
    if not cuts or not len(flat):
        return kept
    middles = points.mean(axis=1)
    cut = np.argmin([np.abs(one.level_set(middles)) for one in cuts], axis=0)
    ways = step[:, None, None, None] * np.eye(points.shape[2])  # (f, 1, d, d)
    found = np.empty(points.shape)
    for k, one in enumerate(cuts):
        ends = (points[:, :, None] + sign * ways for sign in (1.0, -1.0))
        ahead, behind = (one.level_set(end[cut == k].reshape(-1, points.shape[2])) for end in ends)
        found[cut == k] = (ahead - behind).reshape(-1, *points.shape[1:])
    found /= np.linalg.norm(found, axis=2).clip(np.finfo(float).tiny)[..., None]
    turned = np.einsum("fqd,fd->fq", found, flat)[..., None]
    return np.where(np.abs(turned) > _SMOOTH, np.sign(turned) * found, kept)


def _faces_of_pieces(parts: Ints) -> Ints:
    """Count faces of both pieces (f, 2) of each facet, and return the larger; a face is a pair."""
    pairs, which = np.unique(np.sort(parts, axis=1), axis=0, return_inverse=True)
    count = np.bincount(pairs.ravel(), minlength=parts.max(initial=0) + 1)
    return count[pairs].max(axis=1)[which.ravel()]


class ClosedSolution(NamedTuple):
    """Equilibrium of a body whose faces may touch.

    Attributes
    ----------
    displacement : (N, d) float array
        At the dof nodes, in metres.
    strain_energy : float
        In joules (per metre of thickness in the plane).
    pressure : (f, q) float array
        At the quadrature points of the faces, in pascal.
    residual : float
        Largest unbalanced force over the largest force in the body.
    iterations : int
        Linear solves.
    solver : {"direct", "iterative"}
    """

    displacement: Floats
    strain_energy: float
    pressure: Floats
    residual: float
    iterations: int
    solver: str


_SLIDES, _SETTLED = 60, 1e-9  # corrections of curved or turning faces; share of the pressure
_ROUNDING = 1e-13  # residual that conjugate gradients leave, as a factorisation does
_WEAK = 20  # power of the share of rotations held: ties of 1e-6, 3e-3, 0.07 and 1


class _Pressed(InternalForce):
    """Internal force of a body together with its faces, which have slid (f, q)."""

    def __init__(self, force: InternalForce, faces: ClosingFaces) -> None:
        vars(self).update(vars(force))
        self.faces, self.slide = faces, np.zeros(faces.weights.shape)

    @property
    def couplings(self) -> Ints:
        return self.faces.couplings

    def evaluate_at(self, at: Configuration, out: Floats | None = None) -> tuple[Floats, float]:
        force, energy = super().evaluate_at(at, out)
        force += self.faces.force(at.displacement, self.slide)
        return force, energy + self.faces.energy(at.displacement, self.slide)


class _Closing(Newton):
    """Newton's method on the energy of a body and its faces.

    It begins with all faces tied. A part that no face holds on the way needs a weak tie, or it goes
    anywhere; with the rotations held all faces are tied, which always leads down.
    """

    force: _Pressed

    def linearise(self, displacement: Floats, rotational: float, least: float = 0.0) -> bsr_array:
        super().linearise(displacement, rotational, least)
        faces, slide = self.force.faces, self.force.slide
        round_off = ROUND_OFF * np.abs(faces.phantom.node_points + displacement).max()
        shut = faces.trial_stress(displacement, slide) <= faces.stiffness[:, None] * round_off
        share = np.where(shut, 1.0, (1.0 - rotational) ** _WEAK)
        faces.add_tangent(self._pattern, self._blocks, displacement, slide, share, rotational)
        return self._pattern.matrix(self._blocks)

    def settled(self, u: Floats, load: Floats) -> tuple[Floats, int]:
        """Correct how far faces have slid, from an equilibrium (N, d) with faces that have not."""
        faces, count = self.force.faces, 0
        for _ in range(_SLIDES):
            before, self.force.slide = self.force.slide, faces.slid(u, self.force)
            now = faces.pressure(u, self.force.slide)
            change = np.abs(now - faces.pressure(u, before)).max(initial=0.0)
            if change <= _SETTLED * now.max(initial=0.0):
                return u, count
            u, more = self.solve(u, np.zeros_like(u), load)
            count += more
        raise NotConvergedError(
            f"faces still slide after {_SLIDES} corrections: pressures change by {change:.3g} Pa. "
            "Expected a cut that turns by less from element to element"
        )


def solve_closed(
    force: InternalForce,
    faces: ClosingFaces,
    supports: Supports,
    load: Floats | None = None,
    prescribed: Callable[[float], Floats] | None = None,
    load_steps: int = 1,
) -> ClosedSolution:
    """Solve for the equilibrium of a body whose faces may touch.

    It begins with all faces tied in the normal direction.

    Parameters
    ----------
    force : InternalForce
        Without a penalty.
    faces : ClosingFaces
        Of the same body and kinematics.
    supports : Supports
    load : (N, d) float array, optional
        Nodal forces in newtons.
    prescribed : callable, optional
        At finite rotation, displacement (N, d) of supports at a load factor; else in proportion.
    load_steps : int
        At finite rotation, as for `static_equilibrium`.

    Raises
    ------
    UnsupportedBodyError
        If a part can move rigidly that supports and closed faces together do not hold.
    NotConvergedError
        If the iterations do not suffice: nothing holds a part that the load draws away.
    XfemError
        If the force is of another body or kinematics or with a penalty, or a load of another
        shape.

    Examples
    --------
    Two halves pressed together by a thousandth are one body again.

    >>> import verify.xfem as xfem
    >>> from verify.xfem.closing import ClosingFaces, solve_closed
    >>> mesh = xfem.rectangle_mesh((4, 4))
    >>> phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.6, 0.0], [1.0, 0.0])])

    >>> x, material = mesh.points[:, 0], xfem.isotropic(1e4, 0.0, "plane strain")
    >>> held = xfem.Supports.none(phantom).prescribe(phantom, x == 0.0)

    >>> held = held.prescribe(phantom, x == 1.0, [-1e-3, 0.0])

    >>> force = xfem.InternalForce(phantom, material, "linear")
    >>> found = solve_closed(force, ClosingFaces(phantom, material), held)
    >>> float(found.pressure.min().round(9)), float(found.pressure.max().round(9))
    (10.0, 10.0)
    """
    if (
        not np.array_equal(force.phantom.cells, faces.phantom.cells)
        or force.kinematics != faces.kinematics
        or force.ghost is not None
    ):
        raise XfemError("contact is solved in one kinematics, on one body, without a penalty")
    shape, values = force.phantom.node_points.shape, supports.values
    given = finite_array(np.zeros(shape) if load is None else load, "load", shape)
    check_bodies(force.phantom, supports, (faces.nodes, faces.gap))
    newton = _Closing(_Pressed(force, faces), supports.fixed, _ROUNDING)
    try:
        if force.is_corotational:
            along = prescribed or (lambda factor: factor * values)
            path = LoadPath(newton.force, supports.fixed, along, given, newton)
            u, counts = path.follow(np.zeros(shape), load_steps)
            u, more = newton.settled(path.settle(u), given)
        else:
            u, count = newton.solve(np.zeros(shape), values, given)
            counts = (count,)
            u, more = newton.settled(u, given)
    except (NotInEquilibriumError, SingularStiffnessError) as error:
        raise NotConvergedError(
            f"contact not found: {error}. Expected faces or supports that hold every part"
        ) from error
    place = newton.place(u, given)
    return ClosedSolution(
        u, force.evaluate(u)[1], faces.pressure(u, newton.force.slide), place.norm / place.scale,
        sum(counts) + more, "direct" if "direct" in newton.solvers else "iterative",
    )  # fmt: skip

"""Cutting by copies of cells: virtual nodes.

Molino, Bao & Fedkiw, *A virtual node algorithm for changing mesh topology during simulation*,
SIGGRAPH 2004: a cut cell is copied once for each of its parts that contains a node; the nodes of a
copy outside its part are virtual. Sifakis, Der & Fedkiw, *Arbitrary cutting of deformable
tetrahedralized objects*, SCA 2007: a copy for every part, whether it contains a node or not.

Copies may resist by their share of the material. Then the second is the space of XFEM in side-wise
unknowns (Hansbo & Hansbo 2004). So is the first if every part has a node.
"""

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from verify.methods.cut_body import Change, CutBody, OpenedCells, cut_so_far, make_body, whole_cells
from verify.xfem.arrays import XfemError
from verify.xfem.contacts import absorb, sibling_contacts
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh
from verify.xfem.subdivision import subdivide

CopyWeights = Literal["share", "raised", "whole"]

_LEAST_SHARE = 1e-3
_MORE = {"share": "", "raised": f"{_LEAST_SHARE:g} of its cell", "whole": "its whole cell"}


def virtual_node(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    weights: CopyWeights = "share",
    *,
    opened: OpenedCells | None = None,
) -> CutBody:
    """Copy a cell once for each part with a node in it; parts without one join their sibling.

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
    tip : {"inside", "extended", "through", "nearest"}
        See `verify.xfem.pieces.split_cells`.
    weights : {"share", "raised", "whole"}
        Copies resist by their share of the volume; by a thousandth at least, as MOOSE has it
        (idaholab/moose#13824); or as whole cells: no sliver is left, but the cut cells count
        several times.
    opened : callable, optional
        Without it all cells that the cuts go through are open.
    """
    start = perf_counter()
    cut = cut_so_far(mesh, cuts, tip, opened)
    into = _parts_with_nodes(cut)
    merged = np.flatnonzero(into != np.arange(len(into)))
    largest = float(cut.fraction[merged].max(initial=0.0))
    change = Change("part without a node left with its sibling", len(merged), largest, "fraction")
    phantom = absorb(cut, into)[0] if len(merged) else cut
    return _body(mesh, phantom, weights, [change], start)


def virtual_node_arbitrary(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    weights: CopyWeights = "share",
    *,
    opened: OpenedCells | None = None,
) -> CutBody:
    """Copy a cell once for each of its parts.

    Parameters as for `virtual_node`.
    """
    start = perf_counter()
    return _body(mesh, cut_so_far(mesh, cuts, tip, opened), weights, [], start)


def _body(
    mesh: SimplexMesh, phantom: PhantomMesh, weights: str, changes: list[Change], start: float
) -> CutBody:
    if weights not in get_args(CopyWeights):
        raise XfemError(
            f"weights of copies '{weights}'; expected {' or '.join(get_args(CopyWeights))}"
        )
    resisting = whole_cells(phantom) if weights == "whole" else phantom
    weighed = phantom
    if weights == "raised":  # in all integrals: masses too
        raised = np.maximum(phantom.fraction, _LEAST_SHARE)
        sub, more = phantom.sub_cells, raised / phantom.fraction
        # of its sub-cells likewise: a sliver's centroid stays where it is
        sub = replace(sub, fraction=sub.fraction * more[sub.piece])
        weighed = resisting = replace(phantom, fraction=raised, sub_cells=sub)
    extra = float(resisting.volumes.sum() / phantom.volumes.sum() - 1.0)
    copies = int((resisting.fraction > phantom.fraction).sum())
    changes.append(
        Change(f"copy that resists by {_MORE[weights]}; material added", copies, extra, "fraction")
    )
    seconds = {"cutting": perf_counter() - start}
    return make_body(
        mesh, weighed, tuple(changes), resisting=resisting, conforming=subdivide(phantom),
        seconds=seconds,
    )  # fmt: skip


def _parts_with_nodes(cut: PhantomMesh) -> NDArray[np.int64]:
    """(p,) each piece with a node of its cell in it stays; another goes to a sibling with one.

    The sibling with which it shares most of the cut; without contact the largest.
    """
    sign = np.where(cut.level_sets[cut.mesh.cells[cut.parent]] >= 0.0, 1, -1)
    label = cut.label[:, None, :]
    part = cut.part
    has_node = ((label == 0) | (label == sign)).all(axis=2).any(axis=1)
    has_node = (np.bincount(part, has_node, minlength=len(part)) > 0)[part]
    into = np.arange(len(cut.cells))
    if has_node.all():
        return into
    without = np.flatnonzero(~has_node)
    host = np.full(len(cut.mesh.cells), -1)
    order = np.lexsort([cut.part_fraction, has_node])
    host[cut.parent[order]] = order
    into[without] = host[cut.parent[without]]
    first, second, area = sibling_contacts(cut, cut.parent[without])
    fits = ~has_node[first] & has_node[second]
    pairs, back = np.unique(np.stack([part[first], second])[:, fits], axis=1, return_inverse=True)
    total = np.bincount(back.ravel(), area[fits], minlength=pairs.shape[1])
    best = np.lexsort([total, pairs[0]])
    into[pairs[0][best]] = pairs[1][best]
    into[without] = into[part[without]]
    return into

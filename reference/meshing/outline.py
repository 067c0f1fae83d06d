"""The outline of the body, divided where the part that a support or traction acts on ends."""

import numpy as np
from numpy.typing import NDArray

from verify.scene import Polygon, Rectangle, Scene, Traction
from verify.scene.parts import pieces_on_part

Array = NDArray[np.float64]
_SAME = 1e-5  # of the body's size: an end closer than that to a corner counts as the corner


def divided_outline(scene: Scene) -> Array:
    """Corners (k, 2) of the body, and the points of its edges where such a part ends."""
    outline = _outline(scene)
    size = float(np.ptp(outline, axis=0).max())
    where = {s.where for s in scene.supports}
    where |= {load.where for load in scene.loads if isinstance(load, Traction)}
    following = np.roll(outline, -1, axis=0)
    edges = np.stack([outline, following], axis=1)
    stops = [stop for text in sorted(where) for stop in _ends(scene, text, edges)]
    found = []
    for i, (a, b) in enumerate(zip(outline, following, strict=True)):
        length = float(np.linalg.norm(b - a))
        kept = [0.0]
        for stop in sorted(share for edge, share in stops if edge == i):
            if (stop - kept[-1]) * length > _SAME * size and (1 - stop) * length > _SAME * size:
                kept.append(stop)
        found.append(a + np.array(kept)[:, None] * (b - a))
    return np.concatenate(found)


def supported_edges(scene: Scene, corners: Array) -> NDArray[np.bool_]:
    """Whether each edge of the divided outline is held by a support, in any component."""
    held = np.zeros(len(corners), dtype=bool)
    for support in scene.supports:
        held |= _on_edges(scene, support.where, corners)
    return held


def load_jumps(scene: Scene, corners: Array) -> NDArray[np.bool_]:
    """Corners of the divided outline where the tractions of both edges fit no bounded stress.

    A symmetric stress wants t₁·n₂ = t₂·n₁ at a corner, and t₁ = t₂ on a straight edge. Else the
    strain grows like the logarithm of the distance.
    """
    following = np.roll(corners, -1, axis=0)
    traction, at_end = np.zeros_like(corners), np.zeros_like(corners)  # at either end of each edge
    for load in scene.loads:
        if isinstance(load, Traction) and load.traction != "exact":
            chosen = _on_edges(scene, load.where, corners)
            traction[chosen] += load.values(corners[chosen])
            at_end[chosen] += load.values(following[chosen])
    along = following - corners
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    before, n_before = np.roll(at_end, 1, axis=0), np.roll(normal, 1, axis=0)
    mismatch = np.abs(np.sum(before * normal, axis=1) - np.sum(traction * n_before, axis=1))
    straight = np.abs(np.sum(normal * n_before, axis=1)) > 1 - 1e-12
    mismatch[straight] = np.linalg.norm(before - traction, axis=1)[straight]
    return np.asarray(mismatch > 1e-12 * np.abs(traction).max(initial=0.0))


def _outline(scene: Scene) -> Array:
    assert isinstance(scene.geometry, Rectangle | Polygon)
    return scene.geometry.outline()


def _on_edges(scene: Scene, where: str, corners: Array) -> NDArray[np.bool_]:
    """Tell which edges (k,) of a divided outline lie on a part."""
    edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    return pieces_on_part(scene.geometry, where, edges).covered(len(edges)) > 0.5


def _ends(scene: Scene, where: str, edges: Array) -> list[tuple[int, float]]:
    """Edges (e, 2, 2) in which a part begins or ends, and at which share of each."""
    pieces = pieces_on_part(scene.geometry, where, edges)
    spans = np.sort(pieces.barycentric[:, :, 1], axis=1)
    found = []
    for edge in np.unique(pieces.facet):
        low, high = spans[pieces.facet == edge].T
        order = np.argsort(low)
        # what begins where the one before ends goes on
        found += [(int(edge), float(x)) for x in np.setxor1d(low[order], high[order])]
    return found

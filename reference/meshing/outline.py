"""The outline of the body, divided where the part that a support or traction acts on ends."""

import numpy as np
from numpy.typing import NDArray

from verify.scene import Polygon, Rectangle, Scene, Traction
from verify.scene.parts import on_edges
from verify.scene.regions import parse_region

Array = NDArray[np.float64]
_SAMPLES = 257  # per edge: an interval of the inequality shorter than 1/256 of it may be missed
_SAME = 1e-6  # of the body's size: an end closer than that to a corner counts as the corner


def divided_outline(scene: Scene) -> Array:
    """Corners (k, 2) of the body, and the points of its edges where an inequality changes.

    Along each edge the inequality is sampled and the change is found by bisection to round-off.
    """
    outline = _outline(scene)
    size = float(np.ptp(outline, axis=0).max())
    names = (*scene.geometry.parts(), "boundary")
    where = {s.where for s in scene.supports}
    where |= {load.where for load in scene.loads if isinstance(load, Traction)}
    regions = [parse_region(text, 2) for text in sorted(where - set(names))]
    found = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        stops = [0.0]
        for region in regions:
            stops += _changes(region, a, b)
        length = float(np.linalg.norm(b - a))
        kept = [0.0]
        for stop in sorted(stops):
            if (stop - kept[-1]) * length > _SAME * size and (1 - stop) * length > _SAME * size:
                kept.append(stop)
        found.append(a + np.array(kept)[:, None] * (b - a))
    return np.concatenate(found)


def supported_edges(scene: Scene, corners: Array) -> NDArray[np.bool_]:
    """Whether each edge of the divided outline is held by a support, in any component."""
    held = np.zeros(len(corners), dtype=bool)
    for support in scene.supports:
        held |= on_edges(scene, support.where, corners)
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
            chosen = on_edges(scene, load.where, corners)
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


def _changes(region: object, a: Array, b: Array) -> list[float]:
    """Parameters in (0, 1) of the segment ab at which the region begins or ends."""
    assert callable(region)
    t = np.linspace(0.0, 1.0, _SAMPLES)
    inside = region(a + t[:, None] * (b - a))
    found = []
    for i in np.flatnonzero(inside[1:] != inside[:-1]):
        low, high = t[i], t[i + 1]
        while (middle := 0.5 * (low + high)) not in (low, high):
            same = region((a + middle * (b - a))[None])[0] == inside[i]
            low, high = (middle, high) if same else (low, middle)
        found.append(float(high))
    return found

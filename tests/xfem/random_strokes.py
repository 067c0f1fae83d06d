"""Random meshes and strokes for hypothesis: generic ones, and ones on the grid of the mesh."""

from hypothesis import strategies as st

from verify.xfem.arrays import XfemError
from verify.xfem.cuts import ToolPath
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh

_ANYWHERE = st.floats(-0.4, 1.4, allow_subnormal=False)
# on nodes, edges and faces of the meshes below, and next to them
_ON_GRID = st.builds(
    lambda twelfth, off: twelfth / 12.0 + off,
    st.integers(-3, 15),
    st.sampled_from([0.0, 0.0, 1e-12, -1e-9]),
)
_DEPTH = {
    False: st.floats(-1.5, 1.5, allow_subnormal=False),
    True: st.sampled_from([-1.0, -0.5, 0.0, 0.25, 1.0, 2.0]),
}


@st.composite
def meshes(draw: st.DrawFn, dim: int) -> SimplexMesh:
    """Structured meshes of the unit square or cube with up to 6 × 6 or 4 × 4 × 4 boxes."""
    most = 6 if dim == 2 else 4
    divisions = [draw(st.integers(1, most)) for _ in range(dim)]
    if dim == 3:
        return box_mesh(divisions)
    return rectangle_mesh(
        divisions, diagonal=draw(st.sampled_from(["right", "alternating", "crossed"]))
    )


@st.composite
def strokes(draw: st.DrawFn, dim: int, most: int) -> list[ToolPath]:
    """Up to `most` strokes, one after the other, of two to four positions each."""
    paths: list[ToolPath] = []
    for number in range(draw(st.integers(1, most))):
        grid = draw(st.booleans())
        coordinate = _ON_GRID if grid else _ANYWHERE
        count = draw(st.integers(2, 4))
        tips = [[draw(coordinate) for _ in range(dim)] for _ in range(count)]
        depth = [draw(_DEPTH[grid]) for _ in range(3)] if dim == 3 else None
        times = [10.0 * number + k for k in range(count)]
        try:
            paths.append(ToolPath.of_tip(tips, times, depth))
        except XfemError:
            continue  # turns back, crosses itself, or has no depth: refused, and tested elsewhere
    return paths

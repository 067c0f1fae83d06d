"""A blade that drags what it touches: the force that it gives, and the work that this does."""

import numpy as np
import pytest

from verify.simulator import Session, Stage
from verify.xfem.cuts import ToolPath
from verify.xfem.elasticity import isotropic
from verify.xfem.structured_meshes import box_mesh

FORCE, STEP = 1e-2, 0.05  # N, s


def free_block(path: ToolPath) -> Stage:
    """A block that nothing holds, under a blade."""
    solid = isotropic(50.0, 0.3, "solid")
    return Stage(
        box_mesh((3, 3, 3)), solid, 2.0, np.zeros(3), STEP, 1.0,
        strokes=[path], tool_radius=0.02, tool_force=FORCE,
    )  # fmt: skip


def grazing() -> ToolPath:
    """A blade that slides over the top, slantwise, and cuts nothing."""
    return ToolPath.of_tip([[-0.1, 0.2, 1.01], [1.1, 0.7, 1.01]], [0.0, 1.0], [0.0, 0.0, 0.3])


def cutting() -> ToolPath:
    """A leaning blade that cuts on its way."""
    return ToolPath.of_tip([[-0.1, 0.23, 1.2], [1.1, 0.71, 1.2]], [0.0, 1.0], [0.1, 0.2, -0.9])


@pytest.mark.parametrize("path", [grazing(), cutting()], ids=["grazing", "cutting"])
def test_the_momentum_of_a_free_body_grows_by_the_force_of_the_tool(path) -> None:
    """Whatever is touched, and cut: the force is all there is, from the step after a touch on."""
    session = Session(free_block(path), account=False)
    way = path.blades[-1, 0] - path.blades[0, 0]
    impulse = STEP * FORCE * way / np.linalg.norm(way)
    momentum, contacts, touched = np.zeros(3), 0, 0
    while not session.finished:
        record = session.step()
        now = session.body.mass.apply(session.state.velocity).sum(axis=0)
        gained = impulse if contacts else np.zeros(3)
        assert now - momentum == pytest.approx(gained, abs=1e-9 * np.linalg.norm(impulse))
        touched += contacts > 0
        momentum, contacts = now, record.contacts
    assert touched > 10
    assert (record.split > 0) == (path.blades[0, -1, 2] < 1.0)


def test_the_work_of_the_tool_is_that_at_the_places_that_it_touches() -> None:
    """Mapped back by the transpose: the same virtual work on the surface and on the unknowns."""
    session = Session(free_block(grazing()))
    surface, total = session.surfaces.touchable, 0.0
    while not session.finished:
        before = session.collider.positions
        touched = _touched(session)
        record = session.step()
        if len(touched.facet):
            corners = surface.facets.rows[touched.facet]
            moved = np.einsum(
                "qk,qki->i", touched.at, (session.collider.positions - before)[corners]
            )
            way = grazing().blades[-1, 0] - grazing().blades[0, 0]
            total += FORCE * way @ moved / (np.linalg.norm(way) * len(corners))
        assert record.work == pytest.approx(total, rel=1e-9, abs=1e-18)
    assert total > 0.0


def _touched(session: Session):
    """What the tool touches now, the way that it has come being none before the first step."""
    path = grazing()
    share = session.time
    blade = (1.0 - share) * path.blades[0] + share * path.blades[1]
    found = session.collider.touched(blade[0], blade[-1], session.stage.tool_radius)
    return found if session.records else found._replace(facet=found.facet[:0])

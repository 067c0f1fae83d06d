"""A blade that drags what it touches: the force that it gives, and the work that this does."""

from dataclasses import replace

import numpy as np
import pytest

from verify.scene import load_scene
from verify.simulator import Session, stage_of
from verify.xfem.cuts import ToolPath

STAGE = stage_of(load_scene("thesis/block_dragged"))
FORCE, STEP = 0.05, 0.02  # N, s
# slides over the top, slantwise, and cuts nothing
GRAZING = ToolPath.of_tip([[-0.01, 0.02, 0.101], [0.11, 0.07, 0.101]], [0.0, 1.0], [0, 0, 0.03])
SLID = replace(STAGE, strokes=[GRAZING])


def way(path: ToolPath):
    """Give the unit vector along which a blade moves."""
    along = path.blades[-1, 0] - path.blades[0, 0]
    return along / np.linalg.norm(along)


@pytest.mark.parametrize("stage", [SLID, STAGE], ids=["grazing", "cutting"])
def test_the_momentum_of_a_free_body_grows_by_the_force_of_the_tool(stage) -> None:
    """Whatever is touched, and cut: the force is all there is, from the step after a touch on."""
    session = Session(stage, account=False)
    impulse = STEP * FORCE * way(stage.strokes[0])
    momentum, contacts, touched = np.zeros(3), 0, 0
    while not session.finished:
        record = session.step()
        now = session.body.mass.apply(session.state.velocity).sum(axis=0)
        gained = impulse if contacts else np.zeros(3)
        assert now - momentum == pytest.approx(gained, abs=1e-9 * np.linalg.norm(impulse))
        touched += contacts > 0
        momentum, contacts = now, record.contacts
    assert touched > 10
    assert (record.split > 0) == (stage is STAGE)


def test_the_work_of_the_tool_is_that_at_the_places_that_it_touches() -> None:
    """Mapped back by the transpose: the same virtual work on the surface and on the unknowns."""
    session = Session(SLID)
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
            total += FORCE * way(GRAZING) @ moved / len(corners)
        assert record.work == pytest.approx(total, rel=1e-9, abs=1e-18)
    assert total > 0.0


def test_what_the_tool_does_on_a_body_that_it_cuts_is_in_its_energy() -> None:
    """Impulses alone: the work is at least that on the centre of mass, and none of it is lost."""
    session = Session(STAGE)
    mass = 1000.0 * 0.1**3
    for record in session.run():
        assert record.balance == pytest.approx(0.0, abs=1e-12)
    speed = session.body.mass.apply(session.state.velocity).sum(axis=0) / mass
    on_the_centre = 0.5 * mass * speed @ speed
    assert record.work > on_the_centre > 1e-6


def _touched(session: Session):
    """What the tool touches now, the way that it has come being none before the first step."""
    share = session.time
    blade = (1.0 - share) * GRAZING.blades[0] + share * GRAZING.blades[1]
    found = session.collider.touched(blade[0], blade[-1], session.stage.tool_radius)
    return found if session.records else found._replace(facet=found.facet[:0])

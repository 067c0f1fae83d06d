"""Each scene of the thesis does what the thesis shows."""

from pathlib import Path

import numpy as np
import pytest
from thesis_stages import CASES, stage

from verify.scene import load_scene
from verify.simulator import Session, quality_of, stage_of
from verify.solvers.interface import find_solver

G, H = 9.8, 0.005


def played(name: str, **changes) -> Session:
    session = Session(stage(name, **changes))
    session.run()
    return session


def bodies(session) -> list[np.ndarray]:
    label = session.phantom.bodies
    return [np.flatnonzero(label == k) for k in range(label.max() + 1)]


@pytest.mark.parametrize("name", sorted(path.stem for path in CASES.glob("*.toml")))
def test_a_scene_can_be_set_up_and_says_what_is_required(name) -> None:
    scene = load_scene(CASES / f"{name}.toml")
    assert " shall " in scene.requirement
    assert scene.played_only
    assert stage_of(scene).strokes


@pytest.mark.parametrize(
    ("name", "unknowns", "triangles"),
    [
        ("triangle", 2 * 6, None),
        ("tetrahedron_three_edges", 3 * 8, 1),
        ("tetrahedron_four_edges", 3 * 8, 2),
    ],
)
def test_a_single_element_is_split_once_and_doubles_its_nodes(name, unknowns, triangles) -> None:
    session = played(name)
    last, quality = session.records[-1], quality_of(session)
    assert (last.split, last.unknowns) == (1, unknowns)
    assert quality.volume_error < 1e-12
    assert quality.loose_edges == 0
    assert len(bodies(session)) == 2
    if triangles:  # of the cut: both sides of a triangle, or of a quadrilateral
        surface = session.surfaces.material.surface
        assert surface.inner.rows[surface.used].sum() == 2 * triangles


def test_fragments_of_the_square_fall_with_g() -> None:
    """Implicit Euler: after n steps a free body has the velocity −n h g, exactly."""
    session = played("square_dissected")
    velocity, mass = session.state.velocity, session.body.mass.weights
    parts = bodies(session)
    assert len(parts) == 4
    free = [part for part in parts if not session.body.fixed[part].any()]
    assert len(free) == 3
    when_free = max(path.times[-1] for path in session.stage.strokes)
    for part in free:
        total = mass[part] @ velocity[part] / mass[part].sum()
        # free from some step on: its velocity is that of the steps since, none before
        assert -G * session.time <= total[1] <= -G * (session.time - when_free - 2 * H)
    before = [mass[part] @ velocity[part] / mass[part].sum() for part in free]
    session.step()
    for part, was in zip(free, before, strict=True):
        now = mass[part] @ session.state.velocity[part] / mass[part].sum()
        np.testing.assert_allclose(now - was, [0.0, -G * H], atol=1e-9)


def test_parts_of_the_block_come_apart() -> None:
    session = played("block_cut_twice")
    quality = quality_of(session)
    assert max(quality.volume_error, quality.enclosed_error) < 1e-12
    assert quality.loose_edges == quality.inverted_facets == 0
    # seen from above, the hooked corners have moved outwards from each other
    top = session.phantom.node_points[:, 2] > 0.1 - 1e-9
    assert len(np.unique(session.phantom.node_side[top], axis=0)) == 4


def test_the_incision_in_the_face_opens_and_the_face_keeps_its_nodes() -> None:
    """Thesis: 3913 nodes; its own enrich 1.0 to 1.6 nodes per cut triangle (Table 4.3)."""
    whole = stage("face_incision", time_step=0.05)
    assert abs(len(whole.mesh.points) / 3913 - 1.0) < 0.02
    session = Session(whole)
    while session.time < 1.45:
        session.step()
    last = session.records[-1]
    # no gravity, no prestress: nothing moves before it is pulled, but for strains of round-off,
    # ½ E V ε² with E V = 0.8 J and ε = 5e-15
    assert last.strain < 1e-29
    added = last.unknowns // 3 - len(whole.mesh.points)
    assert 40 < last.split < 60
    assert 0.8 < added / last.split < 1.7


def test_no_solver_takes_a_played_scene() -> None:
    scene = load_scene(CASES / "hand_straight.toml")
    assert find_solver("xfem").refuses(scene)
    assert Path(scene.file).is_file()

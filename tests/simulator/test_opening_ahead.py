"""Openings ahead of a blade, held by forces that fade: in real time too."""

from dataclasses import replace

import numpy as np
import pytest
from cut_bodies import shaken

from verify.accelerated.cholesky import Cholesky
from verify.simulator import Hold, Session, Stage
from verify.simulator import session as played
from verify.xfem.body import DynamicBody, RayleighDamping
from verify.xfem.cuts import ToolPath
from verify.xfem.element import isotropic
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh

STEP = 0.004  # s


def moved(mesh: SimplexMesh) -> SimplexMesh:
    """Give a mesh whose inner nodes are anywhere."""
    return shaken(mesh, 3)


def sheet() -> SimplexMesh:
    """Give a wavy membrane."""
    flat = moved(rectangle_mesh((9, 7), (0.0, 0.0), (1.0, 0.8)))
    x, y = flat.points.T
    return SimplexMesh(np.column_stack([x, y, 0.1 * np.sin(3 * x) * y]), flat.cells)


BLADE = [[0.05, 0.1, -1.5]] * 3
SWUNG = [[0.05, 0.1, -1.5], [0.15, 0.2, -1.5], [0.1, 0.3, -1.5]]
BODIES = {
    "plane": (
        moved(rectangle_mesh((9, 7), (0.0, 0.0), (1.0, 0.8))),
        ToolPath.of_tip([[-0.1, 0.23], [0.4, 0.47], [1.1, 0.41]], [0.002, 0.05, 0.111]),
    ),
    "space": (
        moved(box_mesh((5, 4, 3), (0.0, 0.0, 0.0), (1.0, 0.8, 0.6))),
        ToolPath.of_tip(
            [[-0.1, 0.23, 0.9], [0.4, 0.4, 0.9], [1.1, 0.41, 0.9]], [0.002, 0.05, 0.111], SWUNG
        ),
    ),
    "membrane": (
        sheet(),
        ToolPath.of_tip(
            [[-0.1, 0.23, 0.6], [0.4, 0.47, 0.6], [1.1, 0.41, 0.6]], [0.002, 0.05, 0.111], BLADE
        ),
    ),
}  # fmt: skip


def stage_with(mesh: SimplexMesh, strokes: list[ToolPath], **given) -> Stage:
    kind = {2: "plane strain", 3: "solid"}[mesh.dim] if not mesh.is_membrane else "plane stress"
    shared = {"time_step": STEP, "duration": 0.13, "gravity": np.zeros(mesh.space)}
    return Stage(
        mesh=mesh, material=isotropic(1e4, 0.3, kind), density=1000.0, strokes=strokes,
        **(shared | given),
    )  # fmt: skip


def thrown(session: Session) -> None:
    """Give a body a motion that stretches, shears and turns it."""
    space = session.stage.mesh.space
    gradient = np.random.default_rng(5).uniform(-0.5, 0.5, (space, space))
    at = session.phantom.node_points
    session.state.velocity[:] = at @ gradient.T + 0.3
    session.state.displacement[:] = 0.03 * at @ gradient


def acceleration(body, state):
    """Compute what all forces on the dof nodes amount to (lumped mass)."""
    at = body.force.configuration(state.displacement)
    forces = body.external(state.time) - body.viscous(state.velocity, at)
    forces = forces - body.force.evaluate(state.displacement)[0]
    return np.where(body.fixed, 0.0, forces / body.mass.weights[:, None])


@pytest.mark.parametrize("kind", BODIES)
def test_accelerations_do_not_jump_at_an_opening_and_momentum_stays(kind, monkeypatch) -> None:
    """A free body in general position: to round-off, at every opening, whatever the frames."""
    mesh, path = BODIES[kind]
    damping = RayleighDamping(0.3, 1e-3)
    session = Session(stage_with(mesh, [path], damping=damping if kind != "membrane" else
                                 RayleighDamping(0.3, 0.0)))  # fmt: skip
    thrown(session)
    openings, jumps, scale, genuine = [], [], [], played.tie_forces

    def watched(old, before, given, new, source, *more):
        was = acceleration(old, before)
        new.tie = genuine(old, before, given, new, source, *more)
        now = acceleration(new, session.state)
        openings.append(np.count_nonzero(np.bincount(source) > 1))
        jumps.append(np.abs(now - was[source]).max())
        scale.append(np.abs(was).max())
        return new.tie

    monkeypatch.setattr(played, "tie_forces", watched)
    momentum = session.body.mass.apply(session.state.velocity).sum(axis=0)
    records = session.run()
    assert session.body.tie is None  # the blade has passed
    decay = (1.0 + 0.3 * STEP) ** -len(records)  # implicit Euler, damping of the mass
    now = session.body.mass.apply(session.state.velocity).sum(axis=0)
    assert len(openings) > 5
    assert sum(openings) > 10
    # the stiffest and lightest part: round-off of forces over its mass
    assert max(jumps) < 1e-8 * max(scale)
    np.testing.assert_allclose(now, decay * momentum, rtol=0, atol=1e-11 * np.abs(momentum).max())
    assert abs(records[-1].cut_work[0]) > 1e-6 * records[-1].kinetic


def strokes_through(count: int, duration: float) -> list[ToolPath]:
    """Strokes from below, side by side, some across the half of others' way."""
    found = []
    for k in range(count):
        x, start = (k + 0.53) / count, duration * k / (count + 2.0)
        tips = [[x, -0.05], [x + 0.3 / count, 0.61 if k % 2 else 0.47]]
        found.append(ToolPath.of_tip(tips, [start, start + 2.0 * duration / (count + 2.0)]))
    return found


def hung(cells: tuple[int, int], steps: int, cuts: int) -> Session:
    """A block held at its top that falls apart under its weight."""
    mesh = moved(rectangle_mesh(cells, (0.0, 0.0), (1.0, 0.8)))
    top = Hold(mesh.points[:, 1] > 0.8 - 1e-9, (0, 1), np.zeros(2))
    duration = steps * STEP
    return Session(
        stage_with(mesh, strokes_through(cuts, duration), holds=[top], duration=duration,
                   gravity=np.array([0.3, -1.0]), damping=RayleighDamping(0.2, 0.0))
    )  # fmt: skip


def closes(session: Session) -> float:
    """Largest defect of the balance over the largest energy; checks what cuts have taken."""
    records = session.run()
    defect = [record.balance for record in records]
    energies = np.array([[r.kinetic, r.strain, abs(r.potential)] for r in records])
    assert (np.abs(records[-1].cut_work) > 0.0).all()
    assert records[-1].cut_work.sum() > 0.0
    return float(np.abs(defect).max() / energies.max())


@pytest.mark.parametrize(
    ("cells", "steps", "cuts", "most"),
    [((9, 7), 120, 3, 1e-12), pytest.param((30, 16), 10_000, 20, 1e-9, marks=pytest.mark.heavy)],
)
def test_the_account_of_many_steps_with_many_cuts_closes(cells, steps, cuts, most) -> None:
    assert closes(hung(cells, steps, cuts)) < most


def test_the_driving_force_of_a_stretched_strip_is_its_energy_release_rate() -> None:
    """A strip held above and below: what is ahead of the blade has the energy G a unit of advance.

    ε = δ/H across it and none along, so G = ½ (λ + 2μ) ε² H (Rivlin and Thomas 1953, the strip of
    pure shear). At 0.03 of the speed of waves the lattice radiates next to nothing, and damping and
    scheme take 2 % of G. The rest of the tenth is the mesh: a window of half the height has three
    elements, each with a share of its own.
    """
    young, poisson, height, length, stretch = 1e4, 0.3, 0.4, 1.6, 0.01
    mesh = moved(rectangle_mesh((18, 6), (0.0, 0.0), (length, height)))
    y = mesh.points[:, 1]
    holds = [
        Hold(y < 1e-9, (0, 1), np.zeros(2)),
        Hold(y > height - 1e-9, (0, 1), np.array([0.0, stretch * height])),
    ]
    wave = np.sqrt(young / 1000.0)  # m/s
    settled, speed = 3.0, 0.03 * wave
    path = ToolPath.of_tip([[-0.05, 0.17], [1.3, 0.21]], [settled, settled + 1.35 / speed])
    session = Session(
        stage_with(mesh, [path], holds=holds, time_step=0.02, duration=path.times[-1],
                   damping=RayleighDamping(4.0, 0.0), toughness=[20.0])
    )  # fmt: skip
    records = session.run()
    assert session.stage.smoothing == pytest.approx(0.5 * height, rel=0.1)
    advance = np.array([record.advance[0] for record in records])
    found, resistance = session.blade_forces(0)
    lame = young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))  # λ + 2μ
    expected = 0.5 * lame * stretch**2 * height
    between = (advance > 0.6) & (advance < 0.9)  # a height away from both ends
    np.testing.assert_allclose(found[between], expected, rtol=0.1)
    assert np.isnan(found[advance == 0.0][:-1]).all()
    # the blade enters 50 mm from its start; the mesh is in the plane: its width is that of the way
    np.testing.assert_allclose((resistance + found)[between], 20.0, rtol=0.02)
    # it has swept what it has come within the body
    outside = 0.05 * np.hypot(1.35, 0.04) / 1.35
    area = np.array([record.area[0] for record in records])
    wanted = np.maximum(advance - outside, 0.0)
    np.testing.assert_allclose(area[advance < 1.25], wanted[advance < 1.25], atol=1e-12)


def test_iterations_lead_where_a_factorisation_does_and_less_exact_ones_near_it(
    monkeypatch,
) -> None:
    """A body that is large enough for iterations, through cuts, against Cholesky in every step."""
    mesh, path = moved(box_mesh((9, 8, 7), (0.0, 0.0, 0.0), (1.0, 0.8, 0.6))), BODIES["space"][1]
    hold = Hold(mesh.points[:, 0] < 1e-9, (0, 1, 2), np.zeros(3))
    given = stage_with(
        mesh, [path], holds=[hold], gravity=np.array([0.0, 1.0, -9.8]), duration=6 * STEP
    )

    def end(stage: Stage) -> np.ndarray:
        session = Session(stage)
        records = session.run()
        largest = max(record.strain for record in records)
        assert abs(records[-1].balance) < 10.0 * stage.tolerance * largest
        return session.displacement

    found = [end(replace(given, tolerance=tolerance)) for tolerance in (1e-10, 1e-3)]
    monkeypatch.setattr(
        DynamicBody, "step_solver",
        lambda body, _: Cholesky(body.pattern, 3, body.fixed.all(axis=1)),
    )  # fmt: skip
    exact = end(given)
    off = [np.abs(one - exact).max() / np.abs(exact).max() for one in found]
    assert off[0] < 1e-9
    # residuals of 1e-3 in ten steps sum up to no more than ten times that
    assert 1e-8 < off[1] < 1e-2

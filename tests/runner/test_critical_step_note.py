"""Critical explicit steps of the solvers of a motion, beside their times in one report."""

from verify.result import CRITICAL_STEP
from verify.runner.solve import solve_job
from verify.scene import load_scene, scene_content


def note(case, solver, folder):
    scene = load_scene(case)
    content = scene_content(scene)
    job = {"scene": content, "solver": solver, "level": 0, "repetitions": 1,
           "parameters": {}}  # fmt: skip
    outcome = solve_job(job, folder, store=False)
    assert outcome["status"] == "solved", outcome
    return outcome["notes"].get(CRITICAL_STEP)


def test_every_rival_of_a_motion_says_its_critical_step(tmp_path):
    """Subdivision makes slivers elements of their own: its step is shorter; springs have none."""
    steps = {
        name: float(note("cutting/plate_crossed_quick", name, tmp_path).removesuffix(" s"))
        for name in ("xfem", "conforming", "subdivision")
    }
    assert 0.0 < steps["subdivision"] < 0.9 * steps["xfem"]
    assert steps["conforming"] > 0.0
    assert "springs" in note("cutting/plate_crossed_quick", "mass_spring", tmp_path)


def test_a_scene_at_rest_has_no_critical_step(tmp_path):
    scene = load_scene("statics/f1_patch")
    job = {"scene": scene_content(scene), "solver": "xfem", "level": 0, "repetitions": 1,
           "parameters": {}}  # fmt: skip
    assert CRITICAL_STEP not in solve_job(job, tmp_path, store=False)["notes"]

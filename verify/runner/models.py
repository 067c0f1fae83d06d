"""Scenes of the other models that a case has measured beside its own."""

from pathlib import Path

from verify.errors import UnsupportedSceneError
from verify.judge.adequacy import other_scene
from verify.runner.fingerprint import code_of_solver, digest_of, physics_digest
from verify.runner.job import Job
from verify.runner.reference_cache import REFERENCE
from verify.scene import Scene


def model_jobs(scene: Scene, folder: Path) -> tuple[list[Job], dict[str, Scene]]:
    """Lay out the reference's solves of the other models of a scene.

    Parameters
    ----------
    scene : Scene
    folder : Path
        Of the case.

    Returns
    -------
    jobs : list of Job
        Each with its ``model``.
    scenes : dict of str to Scene
        By model.
    """
    jobs, scenes = [], {}
    for model in scene.adequacy.models:
        try:
            other = other_scene(scene, model)
        except UnsupportedSceneError:  # the comparison says so
            continue
        scenes[model] = other
        physics = physics_digest(other)
        jobs += [
            Job(
                case=scene.name,
                solver=REFERENCE,
                level=level,
                repetitions=1,
                key=digest_of([physics, REFERENCE, level, 1, {}, code_of_solver(REFERENCE)]),
                folder=folder / f"{REFERENCE}_{model}-{level}",
                model=model,
            )
            for level in range(other.reference.levels)
        ]
    return jobs, scenes

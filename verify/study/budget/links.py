"""Links of a budget, and when the cut needs none of its own."""

from dataclasses import dataclass, field

import numpy as np

from verify.assess.quantities import Measured
from verify.assess.reference import Reference
from verify.compare.body import AnyBody, Body, body_of
from verify.compare.hooke import law_of
from verify.compare.realised import cut_deviation
from verify.errors import UnsupportedSceneError
from verify.scene import Scene
from verify.solution import Solution
from verify.study.budget.budget import Answer
from verify.study.budget.solved import Solved

_SAME = 1e-9  # of the body's size


@dataclass(frozen=True)
class Missing:
    """A link that could not be made.

    Parameters
    ----------
    source : str
        What would have been changed.
    reason : str
    where : str
        Which part it is in instead.
    """

    source: str
    reason: str
    where: str


@dataclass
class Chain:
    """The links, and what they were made of.

    Attributes
    ----------
    scene : Scene
    answers : list of Answer
    missing : list of Missing
    notes : list of str
    known : Reference
        Of the user's problem.
    body : Body or SolidBody
    size : float
        Element size of the judged solution, m.
    asked : dict of str to Solved
        The scene as asked by the judged solver on all levels, by kinematics.
    fine : list of (str, Solved)
        Motions of one level at the fine time step, with what they are in words.
    """

    scene: Scene
    known: Reference
    body: AnyBody
    size: float
    asked: dict[str, Solved]
    answers: list[Answer] = field(default_factory=list)
    missing: list[Missing] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    fine: list[tuple[str, Solved]] = field(default_factory=list)


def is_realised_as_asked(scene: Scene, solution: Solution) -> bool:
    """Say whether the cut of `solution` is that of `scene`, tips and all, to round-off."""
    body = body_of(scene)
    if cut_deviation(solution, body) > _SAME * body.size:
        return False
    if not isinstance(body, Body):  # where a front ends inside elements, it is moved
        return not len(body.front)
    asked = float(sum(part.piece.length * (part.end - part.start) for part in body.parts))
    edges = np.diff(solution.cut_facets, axis=1)[:, 0]
    made = float(np.linalg.norm(edges, axis=1).sum())
    return bool(abs(made - asked) <= _SAME * body.size)


def link(chain: Chain, name: str, change: str, what: Solution | Reference) -> Answer:
    """Make a link of a reference, or of a solution with what it has of the scene's quantities."""
    if isinstance(what, Reference):
        return Answer(name, change, what.motion, what.quantities, what.norms)
    scene = chain.scene
    one = Measured(what, chain.body, law_of(scene), scene)
    quantities = {}
    for asked in scene.quantities:
        try:
            quantities[asked.name] = one.quantity(asked), 0.0
        except UnsupportedSceneError:
            continue
    return Answer(name, change, one.motion, quantities, {})

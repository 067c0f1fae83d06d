"""Quantities that a case asks for and that cannot be had: from whom, on which levels, and why."""

from collections.abc import Sequence

from verify.result import Notice, NoticeKind, SolveRecord, Status
from verify.scene import Scene


def unavailable_quantities(scene: Scene, records: Sequence[SolveRecord]) -> list[Notice]:
    """Make a notice of each quantity that a solver's answer, on some level, does not have.

    Parameters
    ----------
    scene : Scene
    records : sequence of SolveRecord
        Measured. What failed is said elsewhere; its quantities are not missed here.
    """
    solved = [record for record in records if record.status is Status.SOLVED]
    solvers = list(dict.fromkeys(record.solver for record in solved))
    notices = []
    for asked in scene.quantities:
        said: dict[str | None, str | None] = {
            solver: _reason([r for r in solved if r.solver == solver], asked.name)
            for solver in solvers
        }
        texts = set(said.values())
        if len(solvers) > 1 and len(texts) == 1 and None not in texts:
            said = {None: texts.pop()}
        notices += [
            Notice(NoticeKind.UNAVAILABLE, asked.name, solver, text)
            for solver, text in said.items()
            if text is not None
        ]
    return notices


def _reason(own: Sequence[SolveRecord], name: str) -> str | None:
    """Why one solver's answers lack a quantity, with the levels if it is not all of them."""
    lacking: dict[str, list[int]] = {}
    for record in own:
        if record.metric(name) is None:
            reason = record.notes.get(name, "it was not measured")
            lacking.setdefault(reason, []).append(record.level)
    if not lacking:
        return None
    if len(lacking) == 1 and len(next(iter(lacking.values()))) == len(own):
        return next(iter(lacking))
    parts = [f"on {_levels(levels)}: {reason}" for reason, levels in lacking.items()]
    having = [record.level for record in own if record.metric(name) is not None]
    return "; ".join(parts) + (f" ({_levels(having)} {_has(having)} it)" if having else "")


def _levels(levels: Sequence[int]) -> str:
    return f"level{'s' * (len(levels) > 1)} {', '.join(map(str, sorted(levels)))}"


def _has(levels: Sequence[int]) -> str:
    return "have" if len(levels) > 1 else "has"

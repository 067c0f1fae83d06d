"""The answer of a sliver study in which one number of a solver is varied."""

import re
from collections.abc import Mapping, Sequence

from verify.report.notation import Lead, number
from verify.report.plots import Palette, Series, loglog
from verify.report.sliver_values import MEASURE, STEP, Records, ratios_of, values_of, words_of

_OF_SWEEPS = {
    "displacement_l2": "displacement, L²", "energy_norm": "energy norm",
    "jump_l2": "jump across the cut, L²",
}  # fmt: skip
_ALIKE = 0.05  # by which errors differ with the position of a mesh: less is no difference
_SWEPT = 4  # values of one number that make it the question
_QUESTIONS = {"ghost": "Does a ghost penalty lock?"}


def swept_number(solvers: Sequence[str] | dict[str, None]) -> tuple[str, dict[str, float]] | None:
    """Return the number that alone is varied, with its value in each label, if there is one."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for label in solvers:
        if match := re.fullmatch(r"(\S+) (\w+)=([-+.\de]+)", label):
            found.setdefault((match[1], match[2]), {})[label] = float(match[3])
    return next(((key[1], own) for key, own in found.items() if len(own) >= _SWEPT), None)


def sweep_lead(measured: Records, name: str, values: Mapping[str, float]) -> Lead | None:
    """Return the largest error over ε against the number, over that at its least value."""
    families = dict.fromkeys(m["family"] for m in measured)
    worst: dict[str, dict[float, float]] = {error: {} for error in _OF_SWEEPS}
    labels = sorted(values, key=lambda label: values[label])

    def most(label: str, error: str, rival: str) -> float:
        own = [r for f in families for r in ratios_of(measured, f, label, error, rival).values()]
        return max(own, default=0.0)

    for label in labels:
        for error, own in worst.items():
            if found := most(label, error, labels[0]):
                own[values[label]] = found
    worst = {error: own for error, own in worst.items() if len(own) >= _SWEPT}
    if not worst:
        return None
    first = f"{name} = {values[labels[0]]:g}"
    palette, title = Palette(), f"largest over ε of the error over that at {first}"
    series = [Series(_OF_SWEEPS[error], list(own.items())) for error, own in worst.items()]
    beside = ", ".join(
        f"{_OF_SWEEPS[error]} {number(most(labels[0], error, MEASURE), 3)}" for error in worst
    )
    question, said = _QUESTIONS.get(name, f"What does {name} do to the error?"), []
    if not any(values_of(measured, f, label, STEP) for f in families for label in labels):
        said = [
            f"This is what it costs. What it gains is not measured here: {labels[0].split()[0]} "
            "hands over no system, of which condition and explicit step would be known."
        ]
    return Lead(
        question, [*_said_of_sweep(name, worst), *said], [loglog(title, name, series, palette)],
        f"{len(values)} values of {name} of {labels[0].split()[0]}; each point is the largest over "
        f"ε of {words_of(list(families))}. At {first}, over a conforming mesh of the same size, at "
        f"most: {beside}.",
    )  # fmt: skip


def _said_of_sweep(name: str, worst: Mapping[str, Mapping[float, float]]) -> list[str]:
    """Say up to which value no error grows, and what the larger ones do."""
    values = sorted({value for own in worst.values() for value in own})
    most = {v: max(own.get(v, 0.0) for own in worst.values()) for v in values}
    bad = [value for value in values if most[value] > 1.0 + _ALIKE]
    good = [value for value in values if not bad or value < bad[0]]
    if len(good) < 2:
        said = [f"Every {name} above the least, {values[0]:g}, adds more than {_ALIKE:.0%}."]
    else:
        off = max(most[value] for value in good) - 1.0
        said = [
            f"Up to {name} = {good[-1]:g} it adds no error: at every ε none is more than "
            f"{100 * max(off, 0.0):.1f} % above that at {values[0]:g}."
        ]
    if not bad:
        return [*said, f"Larger values were not tried: {values[-1]:g} is the last."]
    parts = [
        ", ".join(f"{_OF_SWEEPS[error]} {_times(own[at])}"
                  for error, own in worst.items() if own.get(at, 0.0) > 1.0 + _ALIKE)
        + f" at {at:g}"
        for at in dict.fromkeys((bad[0], values[-1]))
    ]  # fmt: skip
    locks = ", and it locks" if most[values[-1]] > 2.0 else ""
    level = next(v for v in values if all(
        max(own.values()) <= (1.0 + _ALIKE) * own.get(v, 0.0) for own in worst.values()
    ) or v == values[-1])  # fmt: skip
    end = f" Beyond {level:g} none grows by more than {_ALIKE:.0%}." if level < values[-1] else ""
    return [*said, f"From {bad[0]:g} on errors grow{locks}: {'; '.join(parts)}.{end}"]


def _times(ratio: float) -> str:
    return f"{100 * (ratio - 1.0):+.0f} %" if ratio < 2.0 else f"{number(ratio, 2)} times"

"""The cheapest adequate model: of all that were tried, what is good enough and takes least time."""

from collections.abc import Sequence
from dataclasses import dataclass

from verify.result import Verdict
from verify.study.finding import Finding


@dataclass(frozen=True)
class Candidate:
    """A model that was tried.

    Parameters
    ----------
    kinematics : str
    choices : str
        What else was chosen (mass, scheme, analysis), in words; may be empty.
    level : int
    size : float
        Element size, m.
    unknowns : int
    error, low, high : float
        Relative error against the user's problem, and the interval in which it lies.
    seconds, fastest, slowest : float
        Wall time: median, least and most of the repetitions; one thread.
    reason : str
        Why there is no error: the solve failed or was refused; empty otherwise.
    analysis : str
        ``"static"`` or ``"dynamic"``.
    """

    kinematics: str
    choices: str
    level: int
    size: float
    unknowns: int
    error: float
    low: float
    high: float
    seconds: float
    fastest: float
    slowest: float
    reason: str = ""
    analysis: str = ""

    @property
    def title(self) -> str:
        """What it is, in words."""
        more = f", {self.choices}" if self.choices else ""
        return f"{self.kinematics}{more}, h = {self.size:.3g} m"


def cheapest_adequate(
    candidates: Sequence[Candidate], tolerance: float, metric: str, contended: str = ""
) -> tuple[Candidate | None, Finding]:
    """Return the fastest candidate whose error certainly is within `tolerance`, and say so.

    The verdict is UNDECIDED if another adequate one may be as fast (their times overlap, or the
    machine was loaded and they differ by less than a factor of two), or if one that is faster
    may be adequate too (the interval of its error holds the tolerance).
    """
    known = [c for c in candidates if not c.reason]
    adequate = sorted((c for c in known if c.high <= tolerance), key=lambda c: c.seconds)
    wanted = f"{metric.replace('_', ' ')} within {100 * tolerance:.3g} %"
    topic = "cheapest adequate model"
    if not adequate:
        best = min(known, key=lambda c: c.high, default=None)
        text = f"None of the {len(candidates)} models tried is certain to be within the tolerance."
        if best is not None:
            text += (
                f" The best is {best.title}: {100 * best.error:.3g} % (to {100 * best.high:.3g})."
            )
        excluded = bool(known) and all(c.low > tolerance for c in known)
        return None, Finding(topic, text, wanted, Verdict.FAIL if excluded else Verdict.UNDECIDED)
    first = adequate[0]
    sentence = (
        f"{first.title}: {100 * first.error:.3g} % (at most {100 * first.high:.3g} %) in "
        f"{1e3 * first.seconds:.3g} ms with {first.unknowns} unknowns."
    )
    sentence += _of_the_others(first, adequate[1:], known, "kinematics")
    sentence += _of_the_others(first, adequate[1:], known, "analysis")
    room = 2.0 if contended else 1.0
    rivals = [c for c in adequate[1:] if c.fastest <= room * first.slowest]
    maybe = [c for c in known if c.low <= tolerance < c.high and c.seconds < first.seconds]
    if rivals:
        sentence += f" Its time cannot be told from that of {rivals[0].title}."
    if maybe:
        sentence += f" {maybe[0].title} is faster and may be adequate; the reference is too coarse."
    verdict = Verdict.UNDECIDED if rivals or maybe else Verdict.PASS
    return first, Finding(topic, sentence, wanted, verdict)


def _of_the_others(
    first: Candidate, adequate: Sequence[Candidate], known: Sequence[Candidate], axis: str
) -> str:
    """Say of the models that differ from the chosen one along an axis what they cost or lack."""
    own = getattr(first, axis)
    word = "kinematics" if axis == "kinematics" else "analysis"
    for other in adequate:
        name = getattr(other, axis)
        if name != own:
            return (
                f" {name.capitalize()} {word} needs {1e3 * other.seconds:.3g} ms "
                f"(h = {other.size:.3g} m) for the same."
            )
    rest = [c for c in known if getattr(c, axis) != own]
    if not rest:
        return ""
    least = min(c.error for c in rest)
    return (
        f" {getattr(rest[0], axis).capitalize()} {word} is not adequate on any mesh tried "
        f"({100 * least:.3g} % at best)."
    )

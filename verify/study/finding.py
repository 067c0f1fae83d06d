"""A finding: one sentence with its numbers, what was expected, and whether it came out so."""

from dataclasses import dataclass

from verify.result import Verdict


@dataclass(frozen=True)
class Finding:
    """What a study has to say.

    Attributes
    ----------
    topic : str
    sentence : str
        With the numbers.
    expected : str
        The stated limit or the known result against which it is held.
    verdict : Verdict or None
        PASS if it came out as expected, FAIL if not, UNDECIDED if the numbers do not tell or there
        are none; None for what is only shown.
    """

    topic: str
    sentence: str
    expected: str
    verdict: Verdict | None

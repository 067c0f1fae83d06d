"""What goes wrong with small pieces: the condition, and how far a force on one moves it."""

from collections.abc import Sequence
from dataclasses import dataclass

from verify.study.slivers.bodies import background, swept_body
from verify.study.slivers.conditioning import HeldStiffness

__all__ = ["SmallPiece", "small_pieces"]


@dataclass(frozen=True)
class SmallPiece:
    """XFEM on a clamped square whose cut leaves small pieces, untreated.

    Attributes
    ----------
    size : float
        ε: distance of the cut from a node, in element sizes.
    condition, scaled : float
        Of the stiffness, and of the stiffness scaled by its diagonal.
    compliance : float
        Displacement of a smallest piece per unit force on it, over that for ε = 0.1.
    """

    size: float
    condition: float
    scaled: float
    compliance: float


def small_pieces(sizes: Sequence[float]) -> list[SmallPiece]:
    """Measure pieces of a layer that the cut leaves ε thick; the first size is 0.1."""
    found: list[SmallPiece] = []
    first = 0.0
    for size in (0.1, *sizes):
        body = swept_body(background(2), "along faces", size, "keep")
        held = HeldStiffness(body)
        first = first or held.compliance
        found.append(
            SmallPiece(
                size,
                held.condition_number("side-wise", "raw"),
                held.condition_number("side-wise", "Jacobi"),
                held.compliance / first,
            )
        )
    return found

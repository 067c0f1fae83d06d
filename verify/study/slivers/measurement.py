"""One number of the sliver study, with all that it depends on."""

from dataclasses import dataclass

__all__ = ["Measurement"]


@dataclass(frozen=True)
class Measurement:
    """A measured quantity, or the reason why there is none.

    Attributes
    ----------
    dimension : int
    placement : str
        Where the cut goes for size 0 (along faces, along edges, through vertices), what is as
        small as the size (two cuts apart, crossing cuts, corner cut off), or "uncut".
    size : float
        Distance ε of the cut from there, in element sizes.
    treatment : str
        Sliver policy (keep, drop, merge, ghost penalty), or a conforming mesh (conforming;
        conforming snapped: nodes near the cut moved onto it before cells are split; snapped: all
        of them moved and no cell split).
    variant : str
        Basis, lumping or integrator, whichever the quantity depends on.
    quantity : str
    value : float or None
    unit : str
    reason : str
        Why there is no value, or what ended a run.
    """

    dimension: int
    placement: str
    size: float
    treatment: str
    variant: str
    quantity: str
    value: float | None
    unit: str = ""
    reason: str = ""

"""Record of a step of a simulated scene: its cost and its events."""

from dataclasses import dataclass

from verify.xfem.arrays import Floats

# in the order in which a step goes through them
PHASES = ("cutting", "assembly", "motion", "mapping", "collision")


@dataclass(frozen=True)
class StepRecord:
    """One step.

    Attributes
    ----------
    step : int
        From 1 on.
    time : float
        At its end, s.
    seconds : dict
        Wall time of each of the `PHASES`: cutting (which elements, their parts and unknowns, the
        surfaces split), assembly (mass, supports and solver of the body where it has changed),
        motion (forces, factorisation, solve), mapping (positions of all surfaces), collision
        (boxes refitted, the tool queried).
    split : int
        Elements split so far.
    newly_split : int
        In this step.
    unknowns : int
        Unknown displacement components.
    delay : (k,) float array
        Of the elements split in this step: from the first edge that the tool passed to the last
        one, s of the scene (Table 4.6).
    kinetic, strain : float
        J (in the plane per metre of thickness).
    potential : float
        Of the weight, J.
    work : float
        Done on the body by hooks, supports and the tool since the start, J; NaN where no account
        is kept.
    dissipated : float
        By damping and by the scheme since the start, J; likewise.
    contacts : int
        Facets of the collision surface that the tool touches.
    """

    step: int
    time: float
    seconds: dict[str, float]
    split: int
    newly_split: int
    unknowns: int
    delay: Floats
    kinetic: float
    strain: float
    potential: float
    work: float
    dissipated: float
    contacts: int

    @property
    def total_seconds(self) -> float:
        """Wall time of the step."""
        return sum(self.seconds.values())

    @property
    def mechanical(self) -> float:
        """Kinetic, strain and gravity energy, J."""
        return self.kinetic + self.strain + self.potential

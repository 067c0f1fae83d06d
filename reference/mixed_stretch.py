"""Rotation, stretch and pressure of an unknown of displacement and pressure, for forms."""

from typing import Any

from reference.polar_stretch import PolarStretch


class MixedStretch(PolarStretch):
    """Like `PolarStretch`, with a pressure that is an unknown of its own.

    Parameters
    ----------
    solution : dolfinx.fem.Function
        Of the function space of a `MixedSpace`.
    degree : int
        Of the quadrature.

    Attributes
    ----------
    p : ufl expression
        Pa; positive in tension.
    """

    def __init__(self, solution: Any, degree: int) -> None:
        super().__init__(solution, degree)
        self.p = solution[solution.function_space.mesh.geometry.dim]

    def gradient(self, of: Any) -> Any:
        """Gradient of the displacement in a function or argument of both."""
        import ufl

        # not that of a part split off: UFL does not differentiate it along its own direction
        gradient = ufl.grad(of)
        d = len(gradient[0, :])
        return ufl.as_tensor([[gradient[i, j] for j in range(d)] for i in range(d)])

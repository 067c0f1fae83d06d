"""Errors of the compact solver: wrong input, and systems that have no solution."""


class XfemError(ValueError):
    """Bad input to the compact solver: what it was, where, and what was expected."""


class SingularStiffnessError(XfemError):
    """The matrix is not positive definite: something moves freely, or a sign is wrong.

    Attributes
    ----------
    node : int or None
        Node at which the factorisation stopped, where it is known.
    """

    def __init__(self, node: int | None) -> None:
        self.node = node
        where = "" if node is None else f" (at dof node {node})"
        super().__init__(
            f"the stiffness is not positive definite{where}: a free piece without support, "
            "or a wrong sign"
        )


class NotConvergedError(XfemError):
    """The iterations ran out before the residual was small enough."""

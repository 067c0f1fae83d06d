"""The processes among which a reference is distributed."""

from typing import Any


def all_ranks() -> tuple[Any, str]:
    """Return the communicator of all MPI ranks that find each other, and whose MPI it is."""
    from mpi4py import MPI

    return MPI.COMM_WORLD, MPI.get_vendor()[0]

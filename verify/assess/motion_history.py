"""Energies and momenta of a moving solution over its output times, as a report shows them."""

from verify.assess.motion_account import MotionAccount
from verify.assess.part_account import momentum_components
from verify.compare.ledger import total_energy


def motion_history(account: MotionAccount) -> dict[str, list[float]]:
    """Return what moves, by name, with ``time`` (s).

    Energies keep the names of their ledger (J, in 2D per metre); ``total`` is the sum that
    physics keeps constant. ``linear_momentum_x`` … (N s) and ``angular_momentum_z`` (in space
    also x, y; N m s, about the origin) are integrated from the velocities, if there are any.
    Empty for a single output time.
    """
    if len(account.times) < 2:
        return {}
    rows = {"time": account.times, **account.ledger}
    total = total_energy(account.ledger)
    if total is not None:
        rows["total"] = total
    found = {name: [float(value) for value in row] for name, row in rows.items()}
    if account.whole is not None:
        found |= momentum_components(account.whole.linear, account.whole.angular)
    return found

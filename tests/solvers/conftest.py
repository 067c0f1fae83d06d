"""Fixtures of the tests of motions."""

import pytest

from verify.solvers.motion_of_scene import StagedLedger
from verify.xfem.energy_balance import BalanceRecorder


@pytest.fixture
def openings(monkeypatch):
    """What the ledger says of the body before and after each opening, as it happens."""
    found = []
    genuine = StagedLedger.open

    def opened(self, body, state, further, inherited):
        rows = []
        for of in ((body, state), (further, inherited)):
            one = BalanceRecorder(*of).close()
            rows.append([[one.kinetic[0], one.strain[0]], one.momentum[0], one.angular_momentum[0]])
        found.append((state.time, rows))
        genuine(self, body, state, further, inherited)

    monkeypatch.setattr(StagedLedger, "open", opened)
    return found

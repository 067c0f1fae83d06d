"""The whole sweep reproduces the table of the formulation."""

import pytest

from verify.result import Verdict
from verify.study.slivers import sliver_study

EXPECTED = [  # variant, exponent of the critical step as the sliver vanishes
    ("consistent", 1.0),
    ("row sum", 1.0),
    ("HRZ", 1.0),
    ("thesis", 0.0),
    ("side-wise", 0.0),
]


def check_table(study, dimension):
    laws = {
        (g["placement"], g["treatment"], g["quantity"], g["variant"]): g["exponent"]
        for g in study.growths
    }
    for lumping, exponent in EXPECTED:
        found = laws["along faces", "keep", "critical step", lumping]
        assert found == pytest.approx(exponent, abs=0.02), lumping
    raw = -2.0 if dimension == 2 else -3.0
    place = "along faces" if dimension == 2 else "through vertices"
    for basis in ("side-wise", "shifted", "heaviside"):
        found = laws[place, "keep", "condition number", f"{basis}, raw"]
        assert found == pytest.approx(raw, abs=0.02), basis
    for basis in ("side-wise", "shifted"):
        for scaling in ("Jacobi", "nodal blocks"):
            found = laws["along faces", "keep", "condition number", f"{basis}, {scaling}"]
            assert found == pytest.approx(0.0, abs=0.02)
    assert laws["along faces", "keep", "condition number", "heaviside, Jacobi"] < -1.9
    assert laws["along faces", "conforming", "critical step", "side-wise"] == pytest.approx(
        1.0, abs=0.05
    )
    steps = {
        (m.variant, m.size): m.value
        for m in study.measurements
        if m.quantity == "critical step" and m.treatment == "keep"
    }
    (element,) = (
        m.value for m in study.measurements if m.quantity == "critical step of the smallest element"
    )
    for (lumping, _), step in steps.items():
        if lumping == "side-wise":
            assert step >= (1.0 - 1e-9) * element
        if lumping == "thesis":
            assert step >= 0.7071 * element
    failed = [f.sentence for f in study.findings if f.verdict is not Verdict.PASS]
    assert not failed
    blown = {
        m.variant: m.value is not None
        for m in study.measurements
        if m.quantity == "steps to blow-up, explicit" and m.size == 1e-7
    }
    assert blown["consistent"]
    assert not blown["side-wise"]


def test_the_table_is_reproduced_in_the_plane():
    check_table(sliver_study([2], quick=True), 2)


@pytest.mark.heavy
def test_the_table_is_reproduced_in_space():
    check_table(sliver_study([3], quick=True), 3)

"""Slow-downs are ratios to a kernel timed beside the solve; what is noisy is undecided."""

import pytest
import runs

from verify.provenance import KERNEL

NOISY = f"kernel {KERNEL}: 0.010 0.016 0.012 0.019 0.011"


def speed(answer):
    (row,) = [row for row in answer["rows"] if row["axis"] == "speed"]
    return row["verdict"], row["reason"]


def checked(baseline, folder, solve, **run):
    return speed(baseline("check", runs.run(folder, runs.result(solve), **run))[1])


@pytest.fixture
def saved(baseline, tmp_path):
    baseline("save", runs.run(tmp_path / "old", runs.result(runs.solve())))
    return baseline


def test_a_slow_down_beyond_the_limit_fails_and_says_by_how_much(saved, tmp_path):
    slow = runs.solve(seconds=(0.200, 0.201, 0.202))
    verdict, reason = checked(saved, tmp_path / "new", slow)
    assert verdict == "FAIL"
    # 0.201 / 0.101, ± half the ranges of both solves and both kernels (0.5 % to 1 % each)
    assert reason.startswith("takes 1.99 times as long (1.9")


def test_a_slower_machine_is_not_a_slower_solver(saved, tmp_path):
    kernel = f"kernel {KERNEL}: 0.0200 0.0202 0.0200 0.0202 0.0200"
    slow = runs.solve(seconds=(0.200, 0.201, 0.202), calibration=kernel)
    assert checked(saved, tmp_path / "new", slow) == ("PASS", "")


@pytest.mark.parametrize(
    "solve, said",
    [
        (runs.solve(seconds=(0.10, 0.15, 0.25)), "noisy"),
        (runs.solve(seconds=(0.15, 0.151, 0.152), calibration=NOISY), "noisy"),
        (runs.solve(seconds=(0.2, 0.2)), "2 repetitions; a spread needs 3"),
        (runs.solve(calibration=""), "calibration"),
        (runs.solve(calibration="kernel 0: 0.01 0.01"), "calibration"),
    ],
)
def test_what_cannot_be_told_is_undecided_with_the_reason(saved, tmp_path, solve, said):
    verdict, reason = checked(saved, tmp_path / "new", solve)
    assert verdict == "UNDECIDED"
    assert said in reason


def test_contended_timings_and_another_cpu_decide_nothing(saved, tmp_path):
    contended = runs.solve(seconds=(0.9, 0.9, 0.9))
    contended.notes["timing"] = "contended: up to 4 processes at the same time"
    verdict, reason = checked(saved, tmp_path / "one", contended)
    assert (verdict, reason[:9]) == ("UNDECIDED", "contended")
    slow = runs.solve(seconds=(0.9, 0.9, 0.9))
    verdict, reason = checked(saved, tmp_path / "two", slow, cpu="another CPU")
    assert verdict == "UNDECIDED"
    assert "on another CPU than 'a CPU'" in reason


def test_speeds_move_only_by_name_and_keep_their_limit(saved, tmp_path):
    new = runs.run(tmp_path / "new", runs.result(runs.solve(seconds=(0.2, 0.201, 0.202))))
    saved.file.write_text(
        saved.file.read_text().replace('"slower_at_most": 1.5', '"slower_at_most": 1.7')
    )
    code, answer = saved("update", new, "--only", "a/case:speed")
    assert (code, answer["moved"]) == (0, 1)
    assert '"slower_at_most": 1.7' in saved.file.read_text()
    assert speed(saved("check", new)[1])[0] == "PASS"

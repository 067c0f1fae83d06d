"""Two runs side by side: which verdicts changed, the worse first."""

import runs
from runs import verdict

OLD = [
    verdict("error", "sag", "PASS", 0.01),
    verdict("rate", "energy_norm", "UNDECIDED"),
    verdict("value", "strain_energy", "FAIL"),
    verdict("value", "strain_energy", "PASS"),
    verdict("ratio", "jump_l2", "PASS"),
]


def test_changed_verdicts_are_listed_with_what_was_observed(baseline, tmp_path):
    new = [
        verdict("error", "sag", "FAIL", 0.09),
        verdict("rate", "energy_norm", "PASS"),
        verdict("value", "strain_energy", "FAIL"),
        verdict("value", "strain_energy", "PASS"),
        verdict("error", "jump_l2", "PASS"),
    ]
    old_run = runs.run(tmp_path / "old", runs.result(verdicts=OLD))
    new_run = runs.run(tmp_path / "new", runs.result(verdicts=new))
    code, answer = baseline("diff", old_run, new_run)
    assert code == 1
    said = [(c["check"], c["old"], c["new"], c["direction"]) for c in answer["changes"]]
    assert said == [
        ("error of sag (xfem)", "PASS", "FAIL", "worse"),
        ("ratio of jump_l2 (xfem)", "PASS", None, "gone"),
        ("error of jump_l2 (xfem)", None, "PASS", "new"),
        ("rate of energy_norm (xfem)", "UNDECIDED", "PASS", "better"),
    ]
    assert [answer["changes"][0][k] for k in ("old_observed", "new_observed")] == [0.01, 0.09]


def test_a_fail_is_worse_than_a_check_that_could_not_be_judged(baseline, tmp_path):
    old_run = runs.run(tmp_path / "old", runs.result(verdicts=[verdict("error", "sag", "ERROR")]))
    new_run = runs.run(tmp_path / "new", runs.result(verdicts=[verdict("error", "sag", "FAIL")]))
    code, answer = baseline("diff", old_run, new_run)
    assert (code, [c["direction"] for c in answer["changes"]]) == (1, ["worse"])


def test_two_runs_say_which_numbers_mean_something_else_in_the_newer(baseline, tmp_path):
    scene = {"supports": [{"where": "x < 0.3", "displacement": [0.0, 0.0]}]}
    old_run = runs.run(tmp_path / "old", runs.result(scene=scene))
    new_run = runs.run(tmp_path / "new", runs.result(scene=scene), meaning=2)
    code, answer = baseline("diff", old_run, new_run)
    assert code == 0
    numbers, widths = answer["meaning"]
    assert "a/case:xfem/1/displacement_l2, a/case:xfem/1/strain_energy" in numbers
    assert "half-widths" in widths
    assert baseline("diff", new_run, new_run)[1]["meaning"] == []

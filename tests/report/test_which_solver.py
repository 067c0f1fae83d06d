"""The section "Which solver": what its tables say of pairs, groups and coverage."""

import itertools
from dataclasses import asdict
from types import SimpleNamespace

from verify.report.which import baseline, which_view
from verify.result import Comparison, LeftOut, Pair, Ranking, Standing

SCORES = {  # (solver, rival): wins, ties, losses, ratio; the mirror is made
    ("a", "conforming"): (1, 1, 6, 1.4),
    ("a", "twin"): (1, 1, 4, 1.4),
    ("a", "b"): (3, 0, 2, 0.9),
    ("conforming", "twin"): (0, 6, 0, 1.0),
    ("b", "conforming"): (0, 2, 3, 1.6),
    ("b", "twin"): (0, 1, 2, 1.7),
}
COVERAGE = {"conforming": [8, 9], "a": [8, 9], "twin": [6, 9], "b": [5, 9], "none": [0, 9]}


def ranking(metric="displacement_l2", kind="rest", without=(), **more):
    pairs = []
    for (solver, rival), (won, tied, lost, ratio) in SCORES.items():
        for one, other, w, l, r in ((solver, rival, won, lost, ratio),
                                    (rival, solver, lost, won, 1 / ratio)):  # fmt: skip
            pairs.append(Pair(metric, kind, one, other, w, tied, l, r, r / 2, r * 2, w + l))
    names = [name for name in ("a", "conforming", "twin", "b", "none") if name not in without]
    found = Ranking(
        schema=2, cases=["c"], solvers=names, conformance={},
        pairs=[p for p in pairs if p.solver in names and p.rival in names],
        groups=[] if "twin" in without or "conforming" in without else [["conforming", "twin"]],
        coverage={n: {"rest": COVERAGE[n], "motion": [0, 2]} for n in names},
        stability=[], left_out=[], contended=[], energy=more.get("energy", []),
    )  # fmt: skip
    return asdict(found)


def rows(table):
    return [[(cell.text, cell.note) for cell in row] for row in table.rows]


def test_one_discretisation_has_one_row_and_counts_once_against_the_others():
    view = which_view(ranking())
    (table,) = view["errors"]
    assert [row[0][0] for row in rows(table)] == ["conforming P1, twin", "a", "b", "none"]
    lead, a, b, none = rows(table)
    # of the row (1, 1, 6) + (3, 0, 2), the twin is not counted again
    assert a[1:3] == [("1.40 (0.700–2.80)", "7 scenes"), ("4, 1, 8", "")]
    assert b[2] == ("2, 2, 6", "")
    assert lead[1:] == [("1", ""), ("9, 3, 1", ""), ("8 of 9", "twin 6 of 9")]
    assert none[1:] == [("–", "no scene in common"), ("–", ""), ("0 of 9", "")]
    assert view["scenes"] == "9 scenes at rest and 2 scenes in motion"


def test_who_misses_a_part_of_the_body_is_marked():
    """Less material is softer, linear elements are stiffer: together the error looks small."""
    whole, part = ({}, {"coverage": "the cells of the solution cover 0.98 of the body"})
    solves = [
        SimpleNamespace(solver=s, metrics=[1], notes=n) for s, n in (("a", whole), ("b", part))
    ]
    (table,) = which_view(ranking(), [SimpleNamespace(solves=solves)])["errors"]
    names = {row[0] for row in rows(table)}
    assert ("b†", "a part of the body is missing") in names
    assert ("a", "") in names


def test_times_of_one_discretisation_stay_apart():
    view = which_view(ranking("time"))
    assert not view["errors"]
    (table,) = view["times"]
    assert [row[0][0] for row in rows(table)] == ["conforming P1", "twin", "a", "b", "none"]
    twin = rows(table)[1]
    assert twin[1:3] == [("1.00 (0.500–2.00)", "0 scenes"), ("6, 8, 1", "")]


def test_each_kind_of_scene_and_metric_has_its_table():
    one = ranking()
    one["pairs"] += ranking("jump_l2")["pairs"] + ranking(kind="motion")["pairs"]
    said = [table.caption for table in which_view(one)["errors"]]
    assert len(said) == 3
    kinds = [words.rpartition(", scenes ")[2] for words in said]
    assert kinds == ["at rest", "in motion", "at rest"]
    assert "jump" in said[2]


def test_without_conforming_ratios_are_to_the_first_that_answered_most():
    one = ranking(without=("conforming",))
    assert baseline(one) == "a"
    (table,) = which_view(one)["errors"]
    assert [row[0][0] for row in rows(table)] == ["twin", "a", "b", "none"]
    assert rows(table)[0][1][0].startswith(f"{1 / 1.4:.3f}")
    assert table.head[1].text == "ratio to a"


def test_the_order_of_solvers_moves_no_number():
    one = ranking(without=("none",))
    before = rows(which_view(one)["errors"][0])
    for order in itertools.permutations(["a", "conforming", "twin", "b"]):
        assert rows(which_view({**one, "solvers": list(order)})["errors"][0]) == before


def test_a_pair_without_a_ratio_says_so_and_is_last():
    one = ranking()
    for pair in one["pairs"]:
        if "a" in (pair["solver"], pair["rival"]):
            pair.update(ratio=None, low=None, high=None, count=0)
    (table,) = which_view(one)["errors"]
    assert [row[0][0] for row in rows(table)[:2]] == ["conforming P1, twin", "b"]
    a = next(row for row in rows(table) if row[0][0] == "a")
    assert a[1][0] == "–"
    assert a[2][0] == "4, 1, 8"
    one = ranking()  # of one scene there is no range
    for pair in one["pairs"]:
        pair.update(count=1, low=pair["ratio"], high=pair["ratio"])
    assert rows(which_view(one)["errors"][0])[1][1] == ("1.40", "1 scene")


def test_energy_has_its_ranks_and_what_was_left_out_once_for_all_metrics():
    standings = [Standing("b", 1, False, 1e-5, 9e-6, 1.1e-5, 2, "c"),
                 Standing("a", None, False, 1e-3, 1e-3, 1e-3, 1, "d")]  # fmt: skip
    why = [LeftOut("d", "a", "singular")]
    energy = [Comparison(name, 2, standings, why) for name in ("energy_drift", "energy_jump")]
    table, left = which_view(ranking(energy=energy))["energy_tables"]
    assert [row[0][0] for row in rows(table)][:2] == ["b", "a"]
    assert rows(table)[0][1] == ("1: 1.00×10⁻⁵ [9.00×10⁻⁶, 1.10×10⁻⁵]", "(c)")
    assert rows(table)[1][1][0].startswith("–: ")
    assert rows(table)[1][1][1] == "1 of 2 (d)"
    assert len(left.rows) == 1
    assert rows(left)[0][2][0].count("relative") == 2

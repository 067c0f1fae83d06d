"""Fingerprints: what an answer or a verdict depends on is found again in the sources."""

import ast

import grimp
import pytest
import scenes

from verify.runner import fingerprint
from verify.runner.fingerprint import Sources, code_of_comparison, code_of_solver, modules_in
from verify.scene import scene_hash

SOLVING = "verify.runner.solve"
ROOTS = [
    "verify.solvers.conforming", "verify.solvers.xfem", "verify.solvers.methods_adapter",
    "verify.runner.judging", "verify.conformance.suite", "verify.report.rendering",
    "verify.xfem.statics",
]  # fmt: skip


@pytest.fixture(scope="module")
def sources():
    return Sources()


def test_what_a_module_depends_on_is_what_another_program_finds(sources):
    """Of grimp, the program behind the import contracts; and the packages on the way."""
    graph = grimp.build_graph(
        "verify", "reference", include_external_packages=False, cache_dir=None,
        exclude_type_checking_imports=True,
    )  # fmt: skip
    for module in sorted(graph.modules):
        if module.startswith("verify.foreign.programs"):
            continue  # run by another Python, with other paths
        own = {name for name in sources._imported(module) if name in graph.modules}
        assert own == graph.find_modules_directly_imported_by(module), module
    for module in ROOTS:
        found = sources.closure(module) & graph.modules
        above = {name for name in found if any(one.startswith(f"{name}.") for one in found)}
        assert found - above <= graph.find_upstream_modules(module) | {module} <= found, module


@pytest.mark.parametrize("module", modules_in("reference"))
def test_a_statement_changes_a_digest_and_a_comment_or_docstring_does_not(module, sources):
    text = sources.file(module).read_text("utf-8")
    package = module if sources.file(module).name == "__init__.py" else module.rpartition(".")[0]
    digest, imports = fingerprint._parsed(text.encode(), package)
    said = ast.get_docstring(ast.parse(text), clean=False)
    other = text.replace(said, f"Another text. {said}", 1) + "\n\n# a comment\n"
    assert fingerprint._parsed(other.encode(), package) == (digest, imports)
    assert fingerprint._parsed(f"{text}\n_new = 1\n".encode(), package).digest != digest


def test_a_verdict_depends_on_every_file_of_the_judge_but_the_ranking(sources):
    """Shown once: `judged_by` judged nobody, and stored verdicts were still two PASS."""
    ranking = {f"verify.judge.{name}" for name in ("cost", "pairs", "ranks")}
    assert set(modules_in("verify.judge")) - ranking <= sources.closure("verify.runner.judging")


def test_a_reference_depends_on_no_method_and_no_comparison(sources):
    """So no edit of these makes references be solved anew."""
    found = sources.closure(SOLVING, "verify.solvers.conforming")
    rooms = {".".join(name.split(".")[:2]) for name in found}
    assert not rooms & {"verify.xfem", "verify.accelerated", "verify.methods", "verify.compare"}
    assert not rooms & {"verify.report", "verify.study", "verify.cli", "verify.simulator"}
    assert code_of_solver("reference") == code_of_solver("conforming tip=grading")
    own = sources.closure(SOLVING, "verify.solvers.xfem")
    assert {"verify.accelerated.cholesky", "verify.xfem.clip"} <= own
    assert not {name for name in own if "foreign" in name or name.startswith("verify.compare")}


def test_a_program_that_changes_is_run_again(sources):
    """A stored answer of Kratos is not used for another program, nor for other versions of it."""
    folder = "verify.foreign.programs"
    found = sources.closure(f"{folder}.kratos.program")
    assert {f"{folder}.motion", f"{folder}.exchange_files"} <= found
    data = {path.name for path in sources._data(found)}
    assert {"solver.toml", "requirements.lock"} <= data
    answers = {code_of_solver(name) for name in ("kratos", "akantu", "xfem", "mine:Solver")}
    assert len(answers | {code_of_comparison()}) == 5


def test_versions_and_data_files_are_part_of_a_digest(tmp_path, monkeypatch):
    (tmp_path / "verify").mkdir()
    (tmp_path / "verify/__init__.py").write_text("import numpy\nimport verify.other\n")
    other = tmp_path / "verify/other.py"
    other.write_text("")
    digests = [Sources(tmp_path).digest("verify")]
    for name, text in (("other", "# a comment\n"), ("unrelated", "_new = 1\n")):
        (tmp_path / f"verify/{name}.py").write_text(text)
        assert Sources(tmp_path).digest("verify") == digests[0]
    other.write_text("_new = 1\n")
    digests.append(Sources(tmp_path).digest("verify"))
    (tmp_path / "verify/tables").mkdir()
    (tmp_path / "verify/tables/weights.csv").write_text("1")
    digests.append(Sources(tmp_path).digest("verify"))
    monkeypatch.setattr(fingerprint, "versions", lambda: {"python": "3", "numpy": "0.1"})
    digests.append(Sources(tmp_path).digest("verify"))
    assert len(set(digests)) == 4
    with pytest.raises(KeyError, match=r"verify\.third"):
        Sources(tmp_path).digest("verify.third")


@pytest.mark.parametrize("damage", ["", "[1, 2]", '{"a": 1}', "{"])
def test_a_damaged_store_is_read_past(damage, tmp_path):
    (tmp_path / "sources.json").write_text(damage)
    found = Sources(store=tmp_path / "sources.json").digest("verify.errors")
    assert found == Sources().digest("verify.errors")
    assert Sources(store=tmp_path / "sources.json" / "below").digest("verify.errors") == found


def test_contact_is_physics_and_an_overlap_that_is_meant_is_words():
    """So is what a case expects of a cut: references are found again."""
    cut = {"kind": "polyline", "points": [[0.2, 0.5], [0.8, 0.5]]}
    told = [scenes.scene([cut], contact={"expected": e}) for e in ("none", "overlap", "closed")]
    for digest in (fingerprint.physics_digest, scene_hash):
        none, overlap, closed = (digest(scene) for scene in told)
        assert none == overlap != closed
    expecting = scenes.scene([{**cut, "expected": "inner"}])
    assert fingerprint.physics_digest(expecting) == fingerprint.physics_digest(told[0])

"""The tutorial's notebook runs, and is the page."""

import json
import re
import shutil
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_loader

import pytest
from doc_pages import DOCS, ROOT, run_line

from verify.runner import selection
from verify.scene import load_scenes

GUIDE = DOCS / "guide"


@pytest.fixture(scope="module")
def tutorial():
    loader = SourceFileLoader("tutorial", str(ROOT / ".ci/tutorial"))
    module = module_from_spec(spec_from_loader("tutorial", loader))
    loader.exec_module(module)
    return module


def test_the_notebook_is_the_page(tutorial):
    page = (GUIDE / "tutorial.md").read_text("utf-8")
    assert (GUIDE / "tutorial.ipynb").read_text("utf-8") == tutorial.notebook(page)


def two_levels(source):
    rows = load_scenes(source)
    meshes = [one.mesh.model_copy(update={"cells": one.mesh.cells[:2]}) for one in rows]
    return [o.model_copy(update={"mesh": m}) for o, m in zip(rows, meshes, strict=True)]


@pytest.mark.skipif(find_spec("skfem") is None, reason="needs scikit-fem")
def test_every_cell_of_the_notebook_runs_and_the_wrong_solver_alone_fails(
    tutorial, tmp_path, monkeypatch
):
    """On the two coarsest meshes of its case."""
    monkeypatch.setattr(selection, "load_scenes", two_levels)
    shutil.copytree(DOCS / "examples", tmp_path / "docs/examples")
    content = json.loads((GUIDE / "tutorial.ipynb").read_text("utf-8"))
    code = ["".join(cell["source"]) for cell in content["cells"] if cell["cell_type"] == "code"]
    lines = [re.findall(r"^!(.*)", text, flags=re.MULTILINE) for text in code]
    path = tmp_path / "build/tutorial"
    done = [run_line(line, tmp_path, path) for block in lines for line in block]
    assert all(each.returncode in (0, 1) for each in done), [each.stderr for each in done]
    said = [each.stdout for each in done]
    runs = [text for text in said if "report.html" in text]
    assert len(runs) == 2
    assert re.match(r"benchmark/c1_slit +PASS ", runs[0])
    assert re.match(r"benchmark/c1_slit +FAIL ", runs[1])
    for name in ("mine", "wrong"):
        assert (tmp_path / f"build/tutorial/{name}/report.html").is_file()
    shown = next(text for text in said if "cut-patch" in text)
    assert re.search(r"^free-fall +refused", shown, re.MULTILINE)

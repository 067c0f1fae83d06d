"""Claims about the page: whole, self-contained, escaped, complete."""

import json
import re
import subprocess
import sys

from page_parser import parsed
from synthetic_run import HOSTILE, make_run

from verify.report import render


def page_of(root):
    return (root / "report.html").read_text(encoding="utf-8")


def test_the_page_is_well_formed_and_fetches_nothing(pictured_run):
    text = page_of(pictured_run)
    page = parsed(text)
    addresses = [
        a[k] for _, a in page.elements for k in ("src", "href", "srcset", "data") if k in a
    ]
    assert addresses
    assert all(a.startswith(("#", "data:image/")) for a in addresses)
    style = re.search("<style>(.*)</style>", text, re.DOTALL)[1]
    assert "url(" not in style
    assert "@import" not in style
    assert page.all("script") == [{}]  # its own: folding and filtering
    assert not page.all("link")


def test_every_link_within_the_page_leads_somewhere(pictured_run):
    page = parsed(page_of(pictured_run))
    assert {a["href"][1:] for a in page.all("a")} <= set(page.ids)


def test_hostile_words_in_every_text_of_a_result_stay_text(tmp_path):
    root = make_run(tmp_path / "run", pictures=False)
    file = root / "cases" / "statics__griffith_inside" / "result.json"

    def poisoned(value, key=""):
        if isinstance(value, dict):
            return {k: poisoned(v, k) for k, v in value.items()}
        if isinstance(value, list):
            return [poisoned(v, key) for v in value]
        keep = ("case", "status", "verdict", "unit", "solution")
        return HOSTILE + value if isinstance(value, str) and key not in keep else value

    file.write_text(json.dumps(poisoned(json.loads(file.read_text()))))
    record = json.loads((root / "run.json").read_text())
    (root / "run.json").write_text(json.dumps(poisoned({**record, "cases": []})))
    page = parsed(page_of(render(root).parent))
    assert len(page.all("script")) == 1
    assert "griffith_inside" in page.text


def test_rendering_again_gives_the_same_bytes(plain_run):
    names = ("report.html", "results.json", "results.csv", "junit.xml")
    before = [(plain_run / name).read_bytes() for name in names]
    render(plain_run)
    assert [(plain_run / name).read_bytes() for name in names] == before
    assert not list(plain_run.glob("*.partial"))


def test_the_report_needs_no_solver():
    code = (
        "import sys, verify.report\n"
        "wrong = {'dolfinx', 'gmsh', 'petsc4py', 'mpi4py', 'numba', 'reference', 'verify.xfem',"
        " 'verify.compare', 'verify.solvers', 'pyvista', 'vtk'} & set(sys.modules)\n"
        "sys.exit(f'imported {wrong}' if wrong else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

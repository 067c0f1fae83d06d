"""Cache of compiled forms: killed compilations, compilations that run, a home read-only."""

import fcntl
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from reference_scenes import needs_fenicsx

from reference.installation import guard_form_cache
from verify.doctor import examine_forms

pytestmark = needs_fenicsx


def compiled(folder, number):
    """Compile a form, with its forms kept in a folder, and integrate it over the unit square."""
    from reference.installation import import_dolfinx

    import_dolfinx()
    import ufl
    from dolfinx import fem, mesh
    from mpi4py import MPI

    square = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    form = fem.form(number * ufl.dx(square), jit_options={"cache_dir": str(folder)})
    return fem.assemble_scalar(form)


@pytest.mark.parametrize("under_lock", [True, False])
def test_an_empty_form_of_a_killed_compilation_is_compiled_anew(tmp_path, under_lock):
    """Of this program at once; of another if nothing has changed for half a minute."""
    number = 3.25 if under_lock else 4.25
    assert compiled(tmp_path / "known", number) == pytest.approx(number)
    (known,) = (tmp_path / "known").glob("*.c")
    planted = tmp_path / known.name
    planted.touch()
    if under_lock:
        planted.with_suffix(".lock").write_text("begun")
    else:
        os.utime(planted, (0, time.time() - 60))
    began = time.monotonic()
    assert compiled(tmp_path, number) == pytest.approx(number)
    assert time.monotonic() - began < 9  # DOLFINx would have waited for 10 s, and failed


def test_a_compilation_that_runs_is_waited_for_and_not_disturbed(tmp_path):
    """Longer than DOLFINx's 10 s if need be; a lock is enough to know."""
    from ffcx.codegeneration import jit

    guard_form_cache()
    source, ready = tmp_path / "form.c", tmp_path / "form.c.cached"
    source.write_text("half of it")
    os.utime(source, (0, 0))
    found = []

    def look_up():
        with pytest.raises(ModuleNotFoundError):  # what FFCx says: nothing is behind this entry
            jit.get_cached_module("form", [], tmp_path, 1)
        found.append(source.read_text())

    with (tmp_path / "form.lock").open("w") as lock:
        lock.write("begun")
        fcntl.flock(lock, fcntl.LOCK_EX)
        waiting = threading.Thread(target=look_up)
        waiting.start()
        waiting.join(0.3)
        assert waiting.is_alive()
        ready.touch()
        waiting.join(5.0)
    assert found == ["half of it"]


def test_a_home_that_cannot_be_written_has_its_forms_elsewhere_and_says_so(tmp_path):
    (tmp_path / "file").touch()
    home = tmp_path / "file" / "home"  # below a file: root cannot write there either
    environment = {**os.environ, "HOME": str(home), "TMPDIR": str(tmp_path)}
    environment.pop("XDG_CACHE_HOME", None)
    code = (
        "from reference.installation import import_dolfinx; import_dolfinx()\n"
        "import ufl; from dolfinx import fem, mesh; from mpi4py import MPI\n"
        "square = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)\n"
        "print(fem.assemble_scalar(fem.form(5.25 * ufl.dx(square))))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False,
        cwd=Path(__file__).parent.parent.parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == pytest.approx(5.25)
    assert f"{home}/.cache/fenics cannot be written; forms are kept in {tmp_path}" in done.stderr


def test_a_missing_compiler_is_told_from_a_cache_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    forms, cache = examine_forms()
    assert not forms.works
    assert "gcc" in forms.cure
    assert cache.works
    assert "cannot be written" in cache.found

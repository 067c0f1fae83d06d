"""The compact solver needs nothing of the rooms above it, nor private parts of its compiler."""

import subprocess
import sys


def test_the_compact_solver_loads_nothing_of_verify_but_itself():
    code = (
        "import pkgutil, sys, verify.xfem\n"
        "for m in pkgutil.walk_packages(verify.xfem.__path__, 'verify.xfem.'):\n"
        "    __import__(m.name)\n"
        "print(*[m for m in sys.modules if m.startswith('verify.')])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = done.stdout.split()
    assert "verify.xfem.kernels" in loaded
    assert [name for name in loaded if not name.startswith("verify.xfem")] == []

"""The compact solver is read in an order, and needs no private parts of its compiler."""

import ast
import re
from pathlib import Path

import verify.accelerated
import verify.xfem


def test_in_the_order_of_reading_no_module_needs_one_that_comes_later():
    """But `cuts`, of which the docstring says so; each module is in it once."""
    folder = Path(verify.xfem.__path__[0])
    headings = re.findall(r"^(?:`\w+`(?:, )?)+$", verify.xfem.__doc__, re.M)
    order = re.findall(r"`(\w+)`", " ".join(headings))
    assert sorted([*order, "__init__"]) == sorted(path.stem for path in folder.glob("*.py"))
    later = {
        (name, node.module.removeprefix("verify.xfem."))
        for k, name in enumerate(order)
        for node in ast.walk(ast.parse((folder / f"{name}.py").read_text()))
        if isinstance(node, ast.ImportFrom)
        and str(node.module).startswith("verify.xfem.")
        and node.module.removeprefix("verify.xfem.") not in order[:k]
    }
    assert later == {("cuts", "faceted_cuts")}


def test_kernels_are_written_without_private_parts_of_the_compiler():
    """Neither here nor in the fast ones; the documented events of numba are no kernels."""
    for room in (verify.xfem, verify.accelerated):
        sources = list(Path(room.__path__[0]).rglob("*.py"))
        assert sources
        for source in sources:
            found = re.search(
                r"^\s*(?:from|import) (llvmlite|numba\.\w+)", source.read_text(), re.M
            )
            assert not found, f"{source.name}: {found[1]}"

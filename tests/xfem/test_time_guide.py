"""The example of the guide runs as printed."""

import re
from pathlib import Path

GUIDE = Path(__file__).parents[2] / "docs" / "xfem-dynamics.md"


def test_the_example_of_the_guide_cuts_a_moving_body_and_closes_its_account(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(example, str(GUIDE), "exec"), {})
    printed = capsys.readouterr().out
    off, size = re.findall(r"by (\S+) J of (\S+) J", printed)[0]
    assert float(off) < 1e-10 * float(size)

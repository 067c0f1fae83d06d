"""Bodies of the tests of `verify.xfem`, on which methods stand."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "xfem"))

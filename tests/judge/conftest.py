import sys
from pathlib import Path

# the hand-made meshes of the comparison tests
sys.path.append(str(Path(__file__).resolve().parents[1] / "compare"))

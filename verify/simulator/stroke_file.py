"""A stroke of the mouse, written down as a cut that can be pasted into a case file."""

from pathlib import Path

from verify.whole_files import write_whole
from verify.xfem.cuts import ToolPath


def stroke_text(path: ToolPath, name: str = "stroke") -> str:
    """Say a path of a straight blade as a ``[[cuts]]`` of kind ``tool_path``, in TOML."""
    lines = ["[[cuts]]", 'kind = "tool_path"', f'name = "{name}"']
    tips = path.blades[:, 0]
    lines.append(f"points = {_table(tips)}")
    lines.append(f"times = {_row(path.times)}")
    if path.blades.shape[2] == 3:
        blades = path.blades[:, -1] - tips
        lengths = (blades**2).sum(axis=1) ** 0.5
        lines.append(f"direction = {_table(blades)}")
        lines.append(f"depth = {lengths.max():.9g}")
    return "\n".join(lines) + "\n"


def write_stroke(path: ToolPath, file: Path, name: str = "stroke") -> None:
    """Write it into a file, in one step."""
    write_whole(file, stroke_text(path, name))


def _row(values) -> str:  # type: ignore[no-untyped-def]
    return f"[{', '.join(repr(float(f'{value:.9g}')) for value in values)}]"


def _table(rows) -> str:  # type: ignore[no-untyped-def]
    return "[\n" + "".join(f"    {_row(row)},\n" for row in rows) + "]"

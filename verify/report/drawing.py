"""Cases drawn, here or beside solves: ``python -m verify.report.drawing FOLDER``.

Each question in the folder names a run directory, the folder of a case in it, and the file to
write. What is written is read back by the process that asked for it, and by nobody else.
"""

import pickle
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import sleep
from typing import Any, NoReturn

from verify.json_files import read_json
from verify.printable import words_of
from verify.processes import die_with_parent
from verify.report.case_view import CaseView, case_view
from verify.report.drawn_bodies import draw
from verify.report.figures.style import Palette, Style
from verify.report.notation import solver_title
from verify.report.pictures import CasePictures, case_pictures
from verify.report.run_directory import CaseEntry, load_entry, load_record
from verify.whole_files import write_whole

_LOOK_SECONDS = 0.02


@dataclass(frozen=True)
class Drawn:
    """A case as the page shows it, and the styles that its figures give labels."""

    view: CaseView
    styles: dict[str, Style]


def main(folder: Path) -> NoReturn:
    """Draw each case that a question in `folder` names, and remove the question."""
    die_with_parent()
    while True:
        for question in sorted(folder.glob("*.json")):
            asked = read_json(question)
            root = Path(asked["root"])
            palette = run_palette(load_record(root)[0])
            drawn = drawn_case(root, asked["index"], load_entry(root / asked["folder"]), palette)
            write_whole(Path(asked["target"]), pickle.dumps(drawn))
            question.unlink()
        sleep(_LOOK_SECONDS)


def run_palette(record: Mapping[str, Any]) -> Palette:
    """Return the styles of the solvers of a run, whichever of its cases is drawn first."""
    named = record.get("solvers")
    names = [name for name in named if isinstance(name, str)] if isinstance(named, list) else []
    return Palette.of(solver_title(name) for name in names)


def drawn_case(root: Path, index: int, entry: CaseEntry, palette: Palette) -> Drawn:
    """Draw case number `index` of a run; if its pictures fail, nothing else of it does."""
    try:
        pictures = case_pictures(root, entry)
        for picture in pictures.all:
            picture.image = draw(picture.body, picture.view)
    except Exception as error:
        pictures = CasePictures(notes=[f"The pictures of this case failed: {words_of(error)}."])
    return Drawn(case_view(index, entry, pictures, palette), dict(palette))


def drawn_before(file: Path, palette: Palette) -> Drawn | None:
    """Return what `main` wrote into `file`, if the figures would have the same styles now."""
    try:
        drawn: Drawn = pickle.loads(file.read_bytes())  # our own, in a folder of this process
    except (OSError, EOFError, pickle.UnpicklingError):
        return None
    same = all(palette[label] == style for label, style in drawn.styles.items())
    return drawn if same else None


if __name__ == "__main__":
    main(Path(sys.argv[1]))

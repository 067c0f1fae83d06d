"""Renders a run directory: ``report.html``, ``results.json``, ``results.csv``, ``junit.xml``."""

import os
from pathlib import Path

from verify.report.exports import csv_rows, json_document, junit_document
from verify.report.page import page
from verify.report.pictures import CasePictures, Picture, case_pictures, drawn
from verify.report.run_directory import Run, load_run

__all__ = ["render"]

_PICTURE_BYTES = 8_000_000  # of images in a page; with base64 and figures it stays below 15 MB


def render(directory: Path) -> Path:
    """Write the report of the run in `directory`, finished or not, into it.

    Each file is replaced in one step. The same directory gives the same bytes again, pictures
    aside from what a renderer may change.

    Returns
    -------
    Path
        The HTML page.

    Raises
    ------
    InputError
        If `directory` holds no run.
    OSError
        If the files cannot be written.
    """
    run = load_run(directory)
    pictures, notes = _all_pictures(run)
    _write(directory / "results.json", json_document(run))
    _write(directory / "results.csv", csv_rows(run))
    _write(directory / "junit.xml", junit_document(run))
    target = directory / "report.html"
    _write(target, page(run, pictures, notes))
    return target


def _all_pictures(run: Run) -> tuple[list[CasePictures], list[str]]:
    pictures = [case_pictures(run.root, entry) for entry in run.entries]
    everything = [picture for shown in pictures for picture in shown.all]
    notes = []
    if reason := drawn(everything):
        notes.append(
            f"pictures were drawn by matplotlib, without hidden-surface removal, because {reason}."
        )
    return pictures, notes + _left_out(pictures, everything)


def _left_out(pictures: list[CasePictures], everything: list[Picture]) -> list[str]:
    """Leave out the last pictures if all of them would make the page too large."""
    total, dropped = 0, 0
    for shown in pictures:
        total += sum(len(picture.image) for picture in shown.all)
        if total > _PICTURE_BYTES:
            dropped += len(shown.all)
            shown.deformed, shown.error = [], []
            shown.notes.append("Its pictures are left out to keep the page below 15 MB.")
    return [f"{dropped} of {len(everything)} pictures are left out."] if dropped else []


def _write(path: Path, content: str) -> None:
    partial = path.with_name(path.name + ".partial")
    partial.write_text(content, encoding="utf-8")
    os.replace(partial, path)

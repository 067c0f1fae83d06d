"""The report of a run: one HTML page that opens offline, with JSON, CSV and JUnit beside it.

Reads results only (``run.json``, ``result.json``, stored solutions for the pictures) and
computes no error of its own. Needs neither FEniCSx nor gmsh.
"""

from verify.report.rendering import load, render
from verify.report.run_directory import CaseEntry, Run, load_run

__all__ = ["CaseEntry", "Run", "load", "load_run", "render"]

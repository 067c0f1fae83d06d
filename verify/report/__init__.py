"""The report of a run: one HTML page that opens offline, with JSON, CSV and JUnit beside it.

Reads results only (``run.json``, ``result.json``, stored solutions for the pictures) and
computes no error of its own. Needs neither FEniCSx nor gmsh. `rendering.render` writes it; what
draws is imported with it, not with this package.
"""

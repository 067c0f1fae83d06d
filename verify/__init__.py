"""A verification lab for cutting: scenes, solvers, comparison, verdicts, reports.

Importing this package is cheap and needs neither FEniCSx nor gmsh; every sub-package is
imported on first use.
"""

__version__ = "0.1.0"

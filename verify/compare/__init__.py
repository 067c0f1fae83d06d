"""Comparison: measures solutions and trusts no solver.

`verify.compare.locate` evaluates fields, `slabs` and `cut_line` are quadratures that belong to
neither side, and each metric is one small file.
"""

"""Comparison: measures solutions and trusts no solver.

`verify.compare.locate` evaluates fields, `body_rule` and `cut_rule` are quadratures that belong to
neither side, and each metric is one small file.
"""

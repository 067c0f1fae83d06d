"""Runs cases: every solve in a process of its own, with limits; failures are records.

The runner knows solvers by their names only and judges nothing: the comparison of a finished
case (`verify.judge`) runs in a process of its own too. A process that only solves imports nothing
of what runs, so nothing is imported here.
"""

"""Properties of every right solver, whatever its method; asked before any ranking."""

from verify.conformance.check import CheckResult, State
from verify.conformance.suite import conform, exit_code_of

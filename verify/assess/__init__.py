"""Measurements of solutions and their intervals: errors, rates, references, energy balances."""

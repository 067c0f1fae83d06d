"""Studies: what several solutions together say (rates, extrapolation, accuracy)."""

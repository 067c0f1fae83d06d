"""Surfaces that move with a cut body."""

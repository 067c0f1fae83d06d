"""Bounding-volume trees of surfaces, and queries of tools against them."""

"""Vectors as wide as those of the machine, in kernels: eight numbers, nodes of four, records."""

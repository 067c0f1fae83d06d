"""Geometry: points, segments, triangles, and one class per kind of cut, in the material frame.

Scenes, the reference and the comparison use it. The solver under test clips by its own code, so
that a fault here is not made on both sides.
"""

"""The reference: exact solutions, conforming meshes of cut bodies, DOLFINx solves.

Importing this package, or `reference.exact`, needs neither DOLFINx nor gmsh.
"""

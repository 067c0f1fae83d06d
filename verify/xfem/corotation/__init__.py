"""Corotational elasticity: one polar rotation per piece, force, potential and stiffness."""

from verify.xfem.corotation.internal_force import InternalForce, Kinematics, TangentKind

__all__ = ["InternalForce", "Kinematics", "TangentKind"]

"""Sparse matrices of nodal blocks: pattern, Cholesky factorisation, conjugate gradients."""

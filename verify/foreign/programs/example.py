"""Linear elements on the conforming mesh: python example.py FOLDER LEVEL.

A whole program on the exchange of files, with numpy and SciPy. Put your own solver in the place
of `solve`.
"""

import numpy as np
from exchange_files import RefusedError, loose_parts, run
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve


def stiffness(case):
    """Stiffness matrix of linear simplices (n d, n d), dofs node by node."""
    points, cells, d = case.points, case.cells, case.dimension
    edges = points[cells[:, 1:]] - points[cells[:, :1]]  # rows are edges
    volume = np.abs(np.linalg.det(edges)) / {2: 2, 3: 6}[d]
    grad = np.linalg.inv(edges).transpose(0, 2, 1)  # of the shape functions 1, 2, …
    grad = np.concatenate([-grad.sum(axis=1, keepdims=True), grad], axis=1)
    lame, shear = case.constant("lame") * volume, case.constant("shear") * volume
    blocks = np.einsum("m,mai,mbj->maibj", lame, grad, grad)
    blocks += np.einsum("m,maj,mbi->maibj", shear, grad, grad)
    blocks += np.einsum("m,mak,mbk,ij->maibj", shear, grad, grad, np.eye(d))
    dofs = (cells[:, :, None] * d + np.arange(d)).reshape(len(cells), -1)
    size = dofs.shape[1]
    rows, columns = np.repeat(dofs, size, axis=1), np.tile(dofs, (1, size))
    shape = (points.size, points.size)
    return coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()


def solve(case):
    """Solve linear statics and write the answer."""
    analysis = case.content["analysis"]
    if analysis["kind"] != "static" or analysis["kinematics"] != "linear":
        raise RefusedError("only linear statics")
    if case.cells.shape[1] != case.dimension + 1:
        raise RefusedError("no membranes")
    held, values = case.held()
    if len(loose := loose_parts(case.points, case.cells, held)):  # a solver may answer it quietly
        raise RuntimeError(f"nothing holds the part around {loose[0]}")
    free = ~held.ravel()

    def work():
        matrix, u = stiffness(case), values.ravel().copy()
        force = np.ravel(case.problem["nodal_forces"]) - matrix @ u
        u[free] = spsolve(matrix[free][:, free].tocsc(), force[free])
        return u.reshape(case.points.shape)

    u = case.timed("solve", work)
    case.answer(case.points, case.cells, u, unknowns=u.size,
                cut_facets=case.problem["cut_facets"])  # fmt: skip


if __name__ == "__main__":
    run(solve, conforming=True)

"""CutFEM in NGSolve with ngsxfem: two sides of a level set, ghost penalty, linear elasticity.

The level set is that of `cut_body`; a cut that ends inside an element ends at its nearer facet.
With ``space = xfe`` the unknowns are nodal values and those of ngsxfem's XFESpace.
"""

import ngsolve as ng
from cut_body import divided, forces, held_at_rest, uniform_weight
from exchange_files import RefusedError, run
from forms import EnrichedForms, Forms, bits, mesh_of
from motion import run_engine
from newmark import Body, PartedCase


def solve(case):
    """Divide the mesh along the cut; solve statics or a motion."""
    ghost = float(case.parameters.get("ghost", 0.1))
    if ghost < 0:
        raise RefusedError(f"ghost = {ghost}; expected a number from 0 on")
    enriched = case.parameters.get("space") == "xfe"
    if enriched and ghost:
        raise RefusedError(f"space = 'xfe' with ghost = {ghost}; expected ghost = 0")
    body, answer = divided(case)
    forms = (EnrichedForms if enriched else Forms)(case, body, mesh_of(case))
    method = "XFEM" if enriched else "CutFEM"
    notes = {"method": method, "ghost": str(ghost), "ngsolve": ng.__version__}
    if case.content["analysis"]["kind"] == "static":
        solve_static(case, body, answer, forms, ghost, notes)
        return
    notes |= {"scheme": "trapezoidal rule", "mass": "consistent, of each side; no ghost penalty"}
    parted = PartedCase(case, body, answer, forms, ghost)
    run_engine(parted, Body, "consistent", notes=notes)


def solve_static(case, body, answer, forms, ghost, notes):
    """Solve linear statics and write the answer."""
    d, (held, value) = case.dimension, held_at_rest(case, body, answer)
    if any(one.get("history") for one in case.problem["held"] + case.problem["loads"]):
        raise RefusedError("statics with histories are not offered")
    weight = uniform_weight(case)
    outer, joined = forces(case, body), forms.joined(body.group, body.count)
    turned = joined.CreateTranspose()

    def assembled():
        matrix = forms.matrix(1.0, 0.0, ghost)
        return turned @ matrix @ joined, (turned * forms.load(weight)).Evaluate()

    matrix, load = case.timed("assembly", assembled)
    used = answer.used(body.count)
    free = bits((~held & used[:, None]).T.ravel())

    def solved():
        u = load.CreateVector()
        u.FV().NumPy()[:] = value.T.ravel()
        rest = load.CreateVector()
        rest.FV().NumPy()[:] = load.FV().NumPy() + outer.T.ravel()
        rest.data -= matrix * u
        u.data += matrix.Inverse(free, inverse="sparsecholesky") * rest
        return u.FV().NumPy().reshape(d, -1).T.copy()

    u = case.timed("solve", solved)
    case.answer(
        answer.points, answer.cells, answer.values(u), unknowns=int(used.sum()) * d,
        cut_facets=answer.facets(body.on_a_cut), notes=notes,
    )  # fmt: skip


if __name__ == "__main__":
    run(solve)

"""The same solver as a program: reads an exported case, answers with VTU and JSON.

python skfem_program.py DIR LEVEL
"""

import json
import sys
from pathlib import Path

import meshio
import numpy as np
import skfem
from skfem.models.elasticity import linear_elasticity

case_folder, level = Path(sys.argv[1]), int(sys.argv[2])
folder = case_folder / f"level-{level}"
case = json.loads((case_folder / "case.json").read_text())
problem = json.loads((folder / "conforming.json").read_text())
if problem["free_pieces"]:  # scipy would answer with very large numbers
    sys.exit(f"nothing holds the piece around {problem['free_pieces'][0]}")
grid = meshio.read(folder / problem["mesh"])
points, cells = grid.points[:, :2], grid.cells_dict["triangle"]

held, values = np.zeros(points.shape, dtype=bool), np.zeros(points.shape)
for support in problem["held"]:  # a later support wins
    at = np.ix_(support["nodes"], support["components"])
    held[at], values[at] = True, support["values"]

basis = skfem.Basis(skfem.MeshTri(points.T, cells.T), skfem.ElementVector(skfem.ElementTriP1()))
each = case["material"].get("each", [case["material"]])  # one, or those that cells have a number of
number = grid.cell_data["material"][0] if len(each) > 1 else np.zeros(len(cells), dtype=int)
lame, shear = (np.array([one[name] for one in each])[number, None] for name in ("lame", "shear"))
stiffness = linear_elasticity(lame, shear).assemble(basis)
force = np.ravel(problem["nodal_forces"])
fixed = np.flatnonzero(held)
u = skfem.solve(*skfem.condense(stiffness, force, x=values.ravel(), D=fixed)).reshape(-1, 2)

displacement = {"displacement": np.pad(u, ((0, 0), (0, 1)))}
meshio.Mesh(grid.points, [("triangle", cells)], displacement).write(folder / "solution.vtu")
answer = {"schema": 1, "files": ["solution.vtu"], "dimension": 2, "order": 1}
(folder / "solution.json").write_text(json.dumps({**answer, "size": problem["size"]}))

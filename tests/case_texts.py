"""Pieces of case files, which tests put together and change.

Numbers that tests replace are given as text, so that they stand in the file as they are given.
"""

# what every solver can do, exactly
STRETCHED = """[[supports]]
where = "boundary"
displacement = "exact"
[exact]
solution = "linear"
parameters = { matrix = [[0.1, 0.0], [0.0, 0.0]] }
"""


def body_text(title, requirement, upper, cells, young="1.0", poisson="0.3", density=""):
    """Return a rectangle or box from the origin to `upper`, of so many cells on its levels."""
    plane = len(upper) == 2
    return (
        _words(title, requirement)
        + f'[geometry]\nkind = "{"rectangle" if plane else "box"}"\n'
        + f"lower = {[0.0] * len(upper)}\nupper = {upper}\n"
        + f"[mesh]\ncells = {cells}\n"
        + _material(young, poisson, density)
        + ('plane = "strain"\n' if plane else "")
    )


def sheet_text(title, requirement, poisson="0.3"):
    """Return a membrane of 2 mm, with the mesh of the file ``sheet.vtu``."""
    return (
        _words(title, requirement)
        + '[geometry]\nkind = "file"\nfile = "sheet.vtu"\ndimension = 3\ncells = "surface"\n'
        + '[mesh]\npattern = "given"\n'
        + _material("1e4", poisson, "1000.0")
        + "thickness = 0.002\n"
    )


def support_text(where, displacement=(0, 0, 0)):
    """Return a support that moves by `displacement`, in space at rest."""
    values = [float(value) for value in displacement]
    return f'[[supports]]\nwhere = "{where}"\ndisplacement = {values}\n'


def weight_text(dimension=2):
    """Return gravity, down the last axis."""
    return f'[[loads]]\nkind = "gravity"\nacceleration = {[0.0] * (dimension - 1) + [-9.8]}\n'


def cut_text(*points):
    """Return a cut along these points: a polyline in the plane, a polygon in space."""
    kind = "polyline" if len(points[0]) == 2 else "polygon"
    places = [[float(value) for value in point] for point in points]
    return f'[[cuts]]\nkind = "{kind}"\npoints = {places}\n'


def _words(title, requirement):
    return f'title = "{title}"\nrequirement = "{requirement}"\n'


def _material(young, poisson, density):
    dense = f"density = {density}\n" if density else ""
    return f"[material]\nyoung = {young}\npoisson = {poisson}\n{dense}"

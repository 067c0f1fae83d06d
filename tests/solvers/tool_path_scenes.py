"""Bodies that move while a blade goes through them, as text."""

from case_texts import body_text, cut_text

PLANE = body_text(
    "A plate under a blade", "It shall move.", [1.0, 0.7], [[9, 6]], "1e4", density="1e3"
)
UNSTRUCTURED = PLANE.replace("cells = [[9, 6]]", 'sizes = [0.13]\npattern = "unstructured"')
SOLID = body_text(
    "A block under a blade", "It shall move.", [0.4, 0.3, 0.2], [[4, 3, 2]], "1e4", density="1e3"
)
MOTION = '[analysis]\nkind = "dynamic"\nduration = 0.3\ntime_step = 0.02\noutputs = 4\n'
SPUN = '[initial]\nkind = "moving"\nspin = %s\nvelocity = %s\n'


def path_text(points, times, depth=None, name="cut"):
    blade = f"depth = {depth[0]}\ndirection = {depth[1]}\n" if depth else ""
    return (
        f'[[cuts]]\nkind = "tool_path"\nname = "{name}"\n'
        f"points = {points}\ntimes = {times}\n{blade}"
    )


INCLINED = path_text([[-0.1, 0.21], [1.1, 0.52]], [-0.05, 0.25])
KINKED = path_text([[-0.1, 0.2], [0.45, 0.43], [0.8, 0.31], [1.1, 0.5]], [-0.05, 0.1, 0.12, 0.27])
CROSSING = path_text([[0.31, 0.8], [0.53, -0.1]], [0.05, 0.22], name="across")
BLADE = path_text([[-0.05, 0.11, -0.05], [0.45, 0.19, -0.05]], [0.0, 0.25], (0.6, [0.1, 0.2, 1.0]))
SHALLOW = path_text(
    [[-0.05, 0.12, 0.07], [0.2, 0.16, 0.05], [0.45, 0.1, 0.07]], [0.0, 0.1, 0.25],
    (0.3, [0.05, 0.1, 1.0]),
)  # fmt: skip
BODIES = {
    "plane": (PLANE, INCLINED, "3.0", "[0.2, 0.1]"),
    "plane, curved, unstructured, crossed": (UNSTRUCTURED, KINKED + CROSSING, "3.0", "[0.2, 0.1]"),
    "plane, with a cut at a time": (
        PLANE,
        INCLINED + cut_text([0.31, 0.8], [0.53, -0.1]) + 'name = "slit"\nopens_at = 0.11\n',
        "3.0",
        "[0.2, 0.1]",
    ),
    "solid": (SOLID, BLADE, "[1.0, 2.0, -1.5]", "[0.2, 0.1, 0.0]"),
    "solid, not through its depth, curved": (SOLID, SHALLOW, "[1.0, 2.0, -1.5]", "[0.2, 0.1, 0.0]"),
}  # fmt: skip

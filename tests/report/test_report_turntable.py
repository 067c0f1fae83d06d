"""Claims about bodies in space that can be turned in the page."""

import base64
import json
import re
import shutil
import subprocess
import urllib.parse

import numpy as np
import pytest
from synthetic_run import make_run

from verify.report import render
from verify.report.bodies import deformed_body
from verify.report.turntable import packed
from verify.report.view import common_view
from verify.solution import Solution, write_solution

# corners of a cube, 6 tetrahedra around its diagonal
_KUHN = [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]]


def cut_cube(n=4, opening=0.1):
    """Return a cube of n³ (n even) cubes, cut across in the middle and opened."""
    axis = np.arange(n + 1)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    number = {tuple(p): i for i, p in enumerate(grid)}
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    cells = np.array([
        [number[tuple(p + corner[c])] for c in tet]
        for p in grid[(grid < n).all(axis=1)] for tet in _KUHN
    ])  # fmt: skip
    points = grid / n
    below = points[cells][:, :, 2].mean(axis=1) < 0.5
    middle = np.flatnonzero(grid[:, 2] == n // 2)
    twin = np.arange(len(points))
    twin[middle] = len(points) + np.arange(len(middle))
    cells = np.where(below[:, None], cells, twin[cells])
    points = np.vstack([points, points[middle]])
    edges = points[cells][:, 1:] - points[cells][:, :1]
    cells[np.linalg.det(edges) < 0] = cells[np.linalg.det(edges) < 0][:, [0, 2, 1, 3]]
    upper = np.zeros(len(points), dtype=bool)
    upper[cells[~below]] = True
    u = np.zeros_like(points)
    u[upper, 2] = opening * (1 + points[upper, 0])
    return Solution(points=points, cells=cells, displacement=u[None])


def solid_run(root):
    make_run(root, pictures=False)
    for solver in ("xfem", "conforming"):
        target = root / "cases" / "statics__f3_inclined" / f"{solver}-3" / "solution"
        write_solution(cut_cube(), target)
    return root


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_the_surface_of_a_cut_cube_is_packed_whole_with_its_faces_of_the_cut_last():
    n, opening = 4, 0.1
    body = deformed_body(cut_cube(n, opening), 1.0)
    data = packed(body, common_view([body], "cividis"))
    head = json.loads(data["data-head"])
    assert head["triangles"] == 2 * n * n * (6 + 2)
    assert head["outer"] == 2 * n * n * 6
    q = numbers(data["data-vertices"], "<u2").reshape(-1, 4)
    points = np.array(head["low"]) + q[:, :3] / 65535 * np.array(head["span"])
    corners = points[numbers(data["data-triangles"], "<u4").reshape(-1, 3)]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                          axis=1) / 2  # fmt: skip
    # two faces of the cut, the upper one inclined by the opening 0.1 (1 + x)
    assert area[head["outer"] :].sum() == pytest.approx(1 + np.hypot(1, opening), rel=1e-4)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    volume = np.einsum("ij,ij->", corners.mean(axis=1), normal) / 3
    assert volume == pytest.approx(1.0, rel=1e-4)  # closed, and oriented outwards


def test_stills_take_the_place_of_what_the_page_has_no_room_for(tmp_path, monkeypatch):
    root = solid_run(tmp_path / "run")
    whole = render(root).stat().st_size
    monkeypatch.setattr("verify.report.rendering._PAGE_BYTES", whole - 10)
    text = render(root).read_text(encoding="utf-8")
    assert len(text.encode()) < whole
    assert "1 bodies are shown as stills" in text
    assert text.count("data-head") == 1
    assert text.count("<img") == 3


PROBE = """<script>addEventListener('load', () => setTimeout(() => {
  const shot = () => [...document.querySelectorAll('.turn canvas')].map(c => {
    const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
    const seen = new Set(); let white = 0;
    for (let i = 0; i < d.length; i += 4) {
      seen.add(d[i] * 65536 + d[i + 1] * 256 + d[i + 2]);
      white += d[i] + d[i + 1] + d[i + 2] == 765;
    }
    return {colours: seen.size, white: 4 * white / d.length, sum: d.reduce((a, b) => a + b, 0)};
  });
  const found = {before: shot(), hidden: [...document.querySelectorAll('.turn img')].map(
    i => getComputedStyle(i).display)};
  const key = k => document.querySelector('.turn canvas').dispatchEvent(
    new KeyboardEvent('keydown', {key: k, bubbles: true}));
  // how soon a frame is drawn is the machine's affair: look until every canvas has changed
  const changed = (than, then, tries = 80) => setTimeout(() => {
    const now = shot();
    if (tries && now.some((view, i) => view.sum === than[i].sum)) changed(than, then, tries - 1);
    else then(now);
  }, 100);
  key('ArrowRight'); key('ArrowRight');
  changed(found.before, turned => { found.turned = turned; key('0');
    changed(turned, back => { found.back = back;
      document.querySelector('.see-through input').click();
      changed(back, through => { found.through = through;
        document.body.innerHTML = '<pre id=probe>FOUND' + encodeURIComponent(JSON.stringify(found))
          + '</pre>'; }); }); });
}, 300));</script>"""


@pytest.mark.browser
def test_bodies_can_be_turned_in_a_browser_and_all_of_a_figure_turn_together(tmp_path):
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    browser = next((path for name in names if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip(f"no Chromium here (looked for {', '.join(names)})")
    page = tmp_path / "page.html"
    text = render(solid_run(tmp_path / "run")).read_text(encoding="utf-8")
    page.write_text(text.replace("</body>", PROBE + "</body>"), encoding="utf-8")
    command = [browser, "--headless", "--no-sandbox", "--use-angle=swiftshader", "--dump-dom",
               "--enable-unsafe-swiftshader", "--enable-logging=stderr", "--v=0",
               "--window-size=1200,2000", "--virtual-time-budget=60000",
               f"--user-data-dir={tmp_path / 'profile'}", page.as_uri()]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=180)
    # the probe itself reads pixels back, which the browser remarks upon
    remarks = ("getImageData", "GPU stall", "GL Driver Message")
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert [line for line in console if not any(words in line for words in remarks)] == []
    said = re.search(r"FOUND([^<]+)<", done.stdout)
    assert said, done.stderr[-2000:]
    found = json.loads(urllib.parse.unquote(said[1]))
    assert len(found["before"]) == 2
    assert found["hidden"] == ["none", "none"]
    for view in found["before"]:
        assert view["colours"] > 100  # shaded, coloured surfaces
        assert 0.05 < view["white"] < 0.9
    sums = {when: [view["sum"] for view in found[when]] for when in found if when != "hidden"}
    assert all(a != b for a, b in zip(sums["before"], sums["turned"], strict=True))
    assert sums["back"] == sums["before"]
    # the outer surface becomes a sieve: more white is seen
    for solid, sieve in zip(found["back"], found["through"], strict=True):
        assert sieve["white"] > solid["white"] + 0.1

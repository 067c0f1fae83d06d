"""Claims about the page in a real browser: it opens offline, whole, and fits a phone."""

import json
import re
import shutil
import subprocess
import zlib

import pytest

from verify.report.rendering import BROWSERS, print_page

pytestmark = pytest.mark.browser

# a script in a copy of the page writes its measurements into it
PROBE = """<script>addEventListener('load', () => {
  const wide = document.documentElement;
  const left = [...document.querySelectorAll('body *')].filter(e => {
    const box = e.getBoundingClientRect();
    return !e.closest('.scroll') && box.width && (box.right > innerWidth + 1 || box.left < -1);
  }).map(e => e.tagName + '.' + (e.getAttribute('class') || ''));
  const images = [...document.images];
  const found = {width: innerWidth, content: wide.scrollWidth, left: [...new Set(left)],
    cases: [...document.querySelectorAll('details.case')].map(e => e.offsetHeight),
    images: images.length, loaded: images.filter(i => i.complete && i.naturalWidth > 1).length};
  document.body.innerHTML = '<pre id="probe">' + JSON.stringify(found) + '</pre>';
});</script>"""


@pytest.fixture(scope="module")
def browser():
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"no Chromium here (looked for {', '.join(BROWSERS)})")
    return found


def opened(browser, page, width, tmp_path):
    # headless windows are never narrower than 500 px: the page is put into a frame of that width
    frame = tmp_path / "frame.html"
    frame.write_text(
        f"<!DOCTYPE html><body style='margin:0'><iframe id=f src='{page.name}' style='border:0;"
        f"width:{width}px;height:2000px'></iframe><script>const out = () => {{const p ="
        "document.getElementById('f').contentDocument.getElementById('probe'); if (p) document."
        "body.textContent = 'FOUND' + p.textContent; else setTimeout(out, 50);}; "
        "addEventListener('load', out);</script>"
    )
    shutil.copy(page, tmp_path / page.name)
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]
    command += [
        "--v=0",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--allow-file-access-from-files",
    ]
    command += ["--virtual-time-budget=20000", "--window-size=1300,2000", "--dump-dom"]
    done = subprocess.run([*command, frame.as_uri()], capture_output=True, text=True, timeout=120)
    found = re.search(r"FOUND(\{.*\})", done.stdout)
    assert found, done.stdout[-500:] + done.stderr[-500:]
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return json.loads(found[1].replace("&amp;", "&")), console


def probed(page, place):
    """Return a copy of `page` that measures itself."""
    place.mkdir()
    text = page.read_text(encoding="utf-8").replace("</body>", PROBE + "</body>")
    (place / page.name).write_text(text, encoding="utf-8")
    return place / page.name


def test_the_page_opens_whole_on_a_phone_without_errors_and_does_not_overflow(
    browser, pictured_run, tmp_path
):
    width = 390
    page = probed(pictured_run / "report.html", tmp_path / "source")
    found, console = opened(browser, page, width, tmp_path)
    assert console == []
    assert found["width"] == width
    assert found["images"] == found["loaded"] == 12
    assert found["content"] <= width, found["left"]
    assert found["left"] == []


def test_the_print_has_no_empty_page_and_seven_cases_have_ten_pages_at_most(
    browser, pictured_run, tmp_path
):
    page = shutil.copy(pictured_run / "report.html", tmp_path / "report.html")
    target = print_page(page)
    pdf = target.read_bytes()
    pages = re.findall(rb"/Type /Page\b.*?/Contents (\d+) 0 R", pdf, re.DOTALL)
    cases, front_and_back = 3, 3  # ten pages for seven
    assert 3 <= len(pages) <= cases + front_and_back
    for number in pages:
        stream = re.search(rb"\n%s 0 obj.*?stream\r?\n(.*?)endstream" % number, pdf, re.DOTALL)
        shown = zlib.decompress(stream[1])
        assert len(re.findall(rb"T[jJ]", shown)) > 10, f"page of object {number} is empty"

"""Claims about the page in a real browser: it opens offline, whole, and fits a phone."""

import json
import re
import shutil
import subprocess

import pytest

pytestmark = pytest.mark.browser

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# what is measured is written into the page by a script that is added to a copy of it
PROBE = """<script>addEventListener('load', () => {
  const wide = document.documentElement;
  const left = [...document.querySelectorAll('body *')].filter(e => {
    const box = e.getBoundingClientRect();
    return !e.closest('.scroll') && box.width && (box.right > innerWidth + 1 || box.left < -1);
  }).map(e => e.tagName + '.' + (e.getAttribute('class') || ''));
  const images = [...document.images];
  const found = {width: innerWidth, content: wide.scrollWidth, left: [...new Set(left)],
    images: images.length, loaded: images.filter(i => i.complete && i.naturalWidth > 1).length};
  document.body.innerHTML = '<pre id="probe">' + JSON.stringify(found) + '</pre>';
});</script>"""


@pytest.fixture(scope="module")
def browser():
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"no Chromium here (looked for {', '.join(NAMES)})")
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


@pytest.mark.parametrize("width", [390, 768, 1200])
def test_the_page_opens_whole_without_errors_and_does_not_overflow(
    browser, pictured_run, tmp_path, width
):
    text = (pictured_run / "report.html").read_text(encoding="utf-8")
    page = tmp_path / "source" / "probed.html"
    page.parent.mkdir()
    page.write_text(text.replace("</body>", PROBE + "</body>"), encoding="utf-8")
    found, console = opened(browser, page, width, tmp_path)
    assert console == []
    assert found["width"] == width
    assert found["images"] == found["loaded"] == 13
    assert found["content"] <= width, found["left"]
    assert found["left"] == []


def test_the_browser_test_would_see_an_overflow_a_broken_image_and_an_error(browser, tmp_path):
    page = tmp_path / "source" / "bad.html"
    page.parent.mkdir()
    page.write_text(
        "<!DOCTYPE html><body><div style='width:900px'>x</div><img src='data:image/png;base64,AA'>"
        f"<script>console.error('seen')</script>{PROBE}</body>"
    )
    found, console = opened(browser, page, 390, tmp_path)
    assert found["content"] > 390
    assert found["loaded"] < found["images"]
    assert any("seen" in line for line in console)


def test_the_page_prints(browser, pictured_run, tmp_path):
    target = tmp_path / "report.pdf"
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", f"--print-to-pdf={target}"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", (pictured_run / "report.html").as_uri()]
    subprocess.run(command, capture_output=True, timeout=120)
    pdf = target.read_bytes()
    pages = len(re.findall(rb"/Type\s*/Page\b", pdf))
    assert pdf.startswith(b"%PDF")
    assert 5 <= pages <= 14

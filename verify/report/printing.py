"""The report on paper: the page printed to PDF by a browser without a window."""

import shutil
import subprocess
import tempfile
from pathlib import Path

from verify.errors import InputError
from verify.whole_files import whole_file

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_SECONDS = 180.0


def print_page(page: Path) -> Path:
    """Print the HTML file `page` to the PDF file beside it.

    Raises
    ------
    InputError
        If no browser of `BROWSERS` is here, or it does not print.
    """
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        wanted = f"looked for {', '.join(BROWSERS)}"
        raise InputError(
            f"PDF needs Chromium ({wanted}); --format markdown needs nothing, and any browser "
            "prints report.html"
        )
    with tempfile.TemporaryDirectory(prefix="verify-print-") as place:
        printed = Path(place) / "report.pdf"
        command = [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer",
            f"--user-data-dir={place}/profile", f"--print-to-pdf={printed}",
            page.resolve().as_uri(),
        ]  # fmt: skip
        try:
            subprocess.run(command, capture_output=True, timeout=_SECONDS)
        except subprocess.TimeoutExpired:
            raise InputError(f"{browser} did not print within {_SECONDS:g} s", str(page)) from None
        if not printed.is_file():
            raise InputError(f"{browser} did not print", str(page))
        with whole_file(page.with_suffix(".pdf")) as partial:
            shutil.copyfile(printed, partial)
    return page.with_suffix(".pdf")

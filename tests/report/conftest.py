import pytest
from synthetic_run import make_run
from synthetic_studies import make_studies

from verify.report.rendering import render


def pytest_configure(config):
    config.addinivalue_line("markers", "browser: opens the report in headless Chromium")


@pytest.fixture(scope="session")
def plain_run(tmp_path_factory):
    """Return a rendered run of three cases without stored solutions."""
    root = make_run(tmp_path_factory.mktemp("plain") / "run", pictures=False)
    render(root)
    return root


@pytest.fixture(scope="session")
def pictured_run(tmp_path_factory):
    """Return a rendered run of three cases with pictures, as a page and as Markdown."""
    root = make_run(tmp_path_factory.mktemp("pictured") / "run")
    render(root, "markdown")
    return root


@pytest.fixture(scope="session")
def studies(tmp_path_factory):
    """Return a directory with the records of studies."""
    return make_studies(tmp_path_factory.mktemp("studies"))

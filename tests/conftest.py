"""What all tests share: none of them reads or writes the user's own cache."""

import os
import shutil
import tempfile

_VARIABLE = "VERIFY_CACHE"


def pytest_configure(config):
    """Give the session a cache of its own; the workers of xdist inherit it."""
    if not hasattr(config, "workerinput"):
        config.cache_of_session = os.environ[_VARIABLE] = tempfile.mkdtemp(prefix="verify-cache-")


def pytest_unconfigure(config):
    """Remove it."""
    if folder := getattr(config, "cache_of_session", None):
        shutil.rmtree(folder, ignore_errors=True)

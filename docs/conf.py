"""Sphinx: pages in Markdown, the reference from docstrings; `.ci/docs` calls it."""

import re

from verify import __version__

project = "Verification lab for cutting"
author = "The cutting-verification maintainers"
copyright = author
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["examples"]

# A link that leads nowhere is an error: the build treats warnings as such.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

autodoc_default_options = {"members": True, "member-order": "bysource", "show-inheritance": True}
autodoc_typehints = "description"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
napoleon_preprocess_types = False

default_role = "code"
# The same class name in several modules: a docstring means the nearest; pages made by commands.
suppress_warnings = ["ref.python", "myst.header"]

html_theme = "furo"
html_title = "Verification lab for cutting"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
pygments_style = "friendly"


def _as_written(app, what, name, obj, options, lines):
    """Take |u| and u_ in docstrings for what they are, mathematics, and no markup."""
    for n, line in enumerate(lines):
        if not line.lstrip().startswith((":type", ">>>", "...", ".. ")):
            lines[n] = re.sub(
                r"(``.*?``)|(\||(?<=\w)_(?=\W|$))", lambda m: m[1] or "\\" + m[2], line
            )


def setup(app):
    """Register what is done to docstrings, after napoleon."""
    app.connect("autodoc-process-docstring", _as_written, priority=900)

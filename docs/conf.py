"""How the documentation becomes a site: `make docs`."""

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from generated_reference import write_reference  # noqa: E402

project = "Ankle impedance laboratory"
author = "Ankle perturbation laboratory"
extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "sphinx.ext.mathjax"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["build"]
html_theme = "furo"
html_title = project
html_static_path: list[str] = []

myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
# The folders of results and pictures are linked as files.
myst_links_external_new_tab = False
numpydoc_show_class_members = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the sections of the docstrings say it in words
nitpicky = False

write_reference(HERE / "reference")


def _keep_plain_text(app: Any, what: str, name: str, obj: Any, options: Any, lines: list) -> None:
    """Show the docstring of a module as it is written: its tables and equations are plain text.

    In all other docstrings a vertical bar is an absolute value and no substitution.
    """
    if what == "module":
        lines[:] = ["::", "", *(f"   {line}" for line in lines), ""]
    else:
        lines[:] = [line if "``" in line else line.replace("|", "\\|") for line in lines]


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _keep_plain_text, priority=1)

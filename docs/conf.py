"""How the documentation becomes a site: `make docs`."""

import sys
from pathlib import Path

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
suppress_warnings = ["myst.xref_missing"]
nitpicky = False

write_reference(HERE / "reference")

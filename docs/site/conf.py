"""Sphinx makes the documentation site of docs/*.md: ``make docs``."""

import sys
from pathlib import Path

import hexcontact

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project = "hexcontact"
author = "The hexcontact developers"
copyright = author
version = release = hexcontact.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "mathml",
    "generated",
]
exclude_patterns = ["ford.md", "site/**"]

# Forges show the same pages: Markdown, $math$, and links between files and to headings.
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

html_theme = "furo"
html_title = f"hexcontact {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1f5f8b", "color-brand-content": "#1f5f8b"},
    "dark_css_variables": {"color-brand-primary": "#7cb9e8", "color-brand-content": "#7cb9e8"},
}
html_math_renderer = "mathml"
pygments_style = "friendly"
pygments_dark_style = "native"

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_only_copy_prompt_lines = True

autodoc_member_order = "bysource"
# The docstrings say the types, in words.
autodoc_typehints = "none"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 90
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = True
default_role = "py:obj"
toc_object_entries_show_parents = "hide"
smartquotes_action = "D"

linkcheck_ignore = [r"tcp://.*"]
linkcheck_timeout = 20
linkcheck_retries = 2

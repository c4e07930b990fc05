"""How Sphinx builds the documentation; `make docs` calls it with warnings as errors.

The build needs no network: notebooks run in this environment, formulae become MathML, and no
other project's index is read.
"""

import os
import sys
from hashlib import sha256
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS / "extensions"))
# Pages are built from the checkout, also by the kernels that execute the notebooks.
sys.path.insert(0, str(DOCS.parent))
os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, [str(DOCS.parent), os.environ.get("PYTHONPATH")])
)
# Progress bars belong on a screen, not on a page.
os.environ.setdefault("TQDM_DISABLE", "1")

import robustpolish  # noqa: E402

project = "robustpolish"
author = "the robustpolish developers"
project_copyright = f"2026, {author}"
version = release = robustpolish.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_nb",
    "sphinx_copybutton",
    "copied_notebooks",
    "api_pages",
    "effect_pages",
    "mathml",
]
templates_path = ["_templates"]
exclude_patterns = ["_build", "extensions", "*.md.in", "notebooks/*.ipynb"]
# A name in single backticks is an argument or a field.
default_role = "code"

# Every link inside the documentation has to lead somewhere.
nitpicky = True
# A field that several results have means that of the class whose docstring names it.
suppress_warnings = ["ref.python"]

# --- reference ---------------------------------------------------------------------------------
autosummary_generate = True
autosummary_imported_members = False
autodoc_typehints = "none"  # types are in the docstrings, in words
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

# --- notebooks and text -------------------------------------------------------------------------
myst_enable_extensions = [
    "amsmath",
    "attrs_inline",
    "colon_fence",
    "deflist",
    "dollarmath",
    "fieldlist",
]
myst_heading_anchors = 3
nb_execution_mode = "cache"
# Executed notebooks are kept until the package changes: no page shows what older code computed.
_code = sha256()
for _path in sorted((DOCS.parent / "robustpolish").rglob("*.py")):
    _code.update(_path.read_bytes())
nb_execution_cache_path = str(DOCS / "_build" / "executed" / _code.hexdigest()[:12])
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
nb_render_markdown_format = "gfm"  # tables in the output of cells

# --- pages --------------------------------------------------------------------------------------
html_theme = "pydata_sphinx_theme"
html_title = "robustpolish"
html_static_path = ["_static"]
html_css_files = ["robustpolish.css"]
html_math_renderer = "mathml"
html_show_sourcelink = False
html_theme_options = {
    "show_prev_next": True,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 6,
    "secondary_sidebar_items": ["page-toc"],
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
}
copybutton_exclude = ".linenos, .gp, .go"

# --- links to the outside, for `make linkcheck` --------------------------------------------------
linkcheck_timeout = 20
linkcheck_retries = 2
linkcheck_anchors = False

"""How Sphinx builds the site: `make docs`."""

import os
import re
import sys
import time
from importlib.metadata import version as installed
from pathlib import Path

import numpydoc.xref

import integrators
import problems

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
from first_page import headline  # noqa: E402 -- beside the extensions
from stored import Stored  # noqa: E402 -- beside the extensions

os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = (
    "1"  # the notebooks' kernel then prints no warning about its debugger
)

project = "hbvm-bench"
author = "hbvm-bench contributors"
project_copyright = author
version = release = installed("hbvm-bench")
language = "en"

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "formulas",
    "made",
    "navigation",
    "panels",
    "reports",
]
exclude_patterns = ["_build", "_ext", "reference/made"]
templates_path = ["_templates"]

# --- pages in MyST, executed where they have code cells ---
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
_paper = (HERE.parent / "reports" / "paper" / "report.md").read_text(encoding="utf-8")
_verdicts = re.findall(r"\*\*(\d+)\*\* ([a-z ]+?)(?= ·|\n)", _paper)  # counts and words
myst_substitutions = {  # for pages that enable them
    "version": version,
    "year": time.strftime("%Y"),
    "stored": Stored(),  # a value of a report's table
    "headline": headline(),
    "claims": sum(int(count) for count, _ in _verdicts),
    **{words.replace(" ", "_"): count for count, words in _verdicts},
}
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE / "_build" / "executed")
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True
os.environ["MATPLOTLIBRC"] = str(HERE / "tutorials" / "pictures.mplstyle")
_profile = HERE / "_build" / "ipython" / "profile_default" / "ipython_kernel_config.py"
_profile.parent.mkdir(parents=True, exist_ok=True)
_profile.write_text('get_config().InlineBackend.figure_formats = {"svg"}\n', encoding="utf-8")
os.environ["IPYTHONDIR"] = str(_profile.parents[1])

# --- reference, from the docstrings ---
autosummary_generate = True
autodoc_typehints = "none"  # numpydoc's sections have the types in words
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"  # but for our own classes
numpydoc.xref.DEFAULT_LINKS.clear()  # to the glossaries of others: the site is built without a network
numpydoc_xref_aliases = {
    name: f"{package.__name__}.{name}"
    for package in (problems, integrators)
    for name in package.__all__
    if isinstance(getattr(package, name), type)
}

# --- looks: everything the pages need lies beside them ---
html_theme = "pydata_sphinx_theme"
html_title = "hbvm-bench"
html_static_path = ["_static"]
html_favicon = "_static/favicon.svg"
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_sidebars = {"index": [], "start": [], "faq": []}  # alone in their sections
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 7,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
    "search_bar_text": "Search",
}
copybutton_prompt_text = r">>> |\.\.\. ?|\$ "
copybutton_prompt_is_regexp = True

"""Sphinx: how the documentation is built. Every code cell is executed; a cell that raises stops the build."""

import os
from pathlib import Path

import tadcore

project = "tadcore"
author = "The tadcore developers"
copyright = "the tadcore developers, MIT licence"
version = release = tadcore.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_design",
    "sphinx-mathjax-offline",
]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "jupyter_execute"]

myst_enable_extensions = ["amsmath", "colon_fence", "dollarmath"]
myst_heading_anchors = 3
myst_number_code_blocks = []
math_numfig = True
math_eqref_format = "({number})"

nb_execution_mode = "force"
nb_execution_in_temp = True  # what cells write does not stay among the pages
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
nb_render_image_options = {"width": "660px"}
os.environ["MATPLOTLIBRC"] = str(Path(__file__).parent)  # kernels draw with twice as many pixels

default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the numpydoc sections say the types, with shapes
numpydoc_show_class_members = False
add_module_names = False

html_sidebars = {
    page: [] for page in ("install", "tutorial", "errors", "glossary", "reliability")
}  # no pages below them
html_theme = "pydata_sphinx_theme"
html_title = f"tadcore {release}"
html_static_path = ["_static"]
html_css_files = ["tadcore.css"]
html_show_sourcelink = False
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "header_links_before_dropdown": 9,
    "navbar_persistent": ["search-button"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "friendly",
    "pygments_dark_style": "github-dark",
}
html_context = {"default_mode": "light"}

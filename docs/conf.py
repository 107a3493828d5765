"""The documentation as a site: `make docs` builds it into site/."""

import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
# the pictures' data come from the independent simulator beside the tests
sys.path[:0] = [str(HERE), str(ROOT), str(ROOT / "test")]

import pictures  # noqa: E402

import frac_accel  # noqa: E402

project = "frac_accel"
author = "frac_accel developers"
version = release = frac_accel.__version__
extensions = [
    "myst_parser",          # the pages are Markdown, as the repository shows them
    "sphinx.ext.autodoc",
    "numpydoc",             # docstrings as numpy writes them
    "sphinx.ext.mathjax",
]
exclude_patterns = ["own_cause"]
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
numpydoc_show_class_members = False
autodoc_typehints = "none"
html_theme = "furo"         # reads well on a phone
html_title = f"frac_accel {version}"
html_show_copyright = False  # the licence says whose it is
# what numpydoc makes of docstrings has sections twice on a page
suppress_warnings = ["myst.header", "docutils"]

_LINK = re.compile(r"\[([^\]]*)\]\((\.{1,2}/[^)#]*|own_cause|own_cause/[^)]*)(#[^)]*)?\)")


def outside(app, page, source):
    """Links to files of the repository that are no pages become their names."""
    folder = (HERE / page).parent

    def named(match):
        target = (folder / match[2]).resolve()
        if target.suffix in (".md", ".rst") and HERE in target.parents:
            return match[0]
        where = target.relative_to(ROOT)
        return match[1] if str(where) in match[1] else f"{match[1]} (`{where}`)"
    source[0] = _LINK.sub(named, source[0])


def setup(app):
    """Make the pictures before the pages are read."""
    app.connect("builder-inited", lambda app: pictures.make(HERE / "made"))
    app.connect("source-read", outside)

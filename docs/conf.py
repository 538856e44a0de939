"""The site: pages in Markdown, the API from docstrings, effects from the catalogue, notebooks.

Run: sphinx-build -W --keep-going docs site

Pages are what lies in this folder.  Written before they are read: `effects.md` with its pictures
(`gallery.py`), and in `notebooks/` what `jupyter execute` has not put there yet, without outputs.
"""

from __future__ import annotations

import shutil
import sys
import warnings
from pathlib import Path

from docutils.nodes import SkipNode
from latex2mathml.converter import convert
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.util.nodes import make_refnode

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

import fracjax  # noqa: E402
from docs import docstrings, gallery  # noqa: E402

project = "fracjax"
release = fracjax.__version__
copyright = "the fracjax contributors, Apache-2.0"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "off"
nb_output_stderr = "remove"

html_theme = "furo"
html_title = f"fracjax {release}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_show_sphinx = False
html_show_sourcelink = False
html_copy_source = False
# Dashes are made typographic, quotation marks are not: they stand about names as they are typed.
smartquotes_action = "D"
# Notebooks have shell commands, `!fracjax`, among their Python.
suppress_warnings = ["misc.highlighting_failure"]

# In docstrings `fit` is a name of fracjax where there is one, and otherwise code.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
napoleon_use_ivar = True
napoleon_use_rtype = False
# ArviZ 0.23 warns once a day when it is imported.
warnings.filterwarnings("ignore", r"\nArviZ is undergoing a major refactor", FutureWarning)


def as_rst(_app, what: str, _name, _object, _options, lines: list[str]) -> None:
    """A docstring as Sphinx reads it, in place."""
    lines[:] = docstrings.as_rst(lines)
    if what in ("attribute", "property"):
        lines.insert(0, "")  # or napoleon takes what stands before a colon for its type


def without_constructor(_app, what, _name, _object, _options, signature, returned):
    """The signature of what a user gets and does not make is left out."""
    made = what == "class" and "<factory>" in (signature or "")
    return ("", returned) if made else None


def under_public_name(app: Sphinx, environment, node: pending_xref, content):
    """A reference to what is defined in a private module leads to its public name."""
    domain, name = environment.domains["py"], node.get("reftarget", "").rpartition(".")[2]
    for full in (f"fracjax.{name}", f"fracjax.blocks.{name}", f"fracjax.operators.{name}"):
        entry = domain.objects.get(full)
        if node.get("refdomain") == "py" and entry is not None:
            page = node.get("refdoc", environment.docname)
            return make_refnode(app.builder, page, entry.docname, entry.node_id, [content], full)
    return None


def write_formula(self, node) -> None:
    """A formula as MathML, which browsers draw without a script."""
    display = "block" if node.tagname == "math_block" else "inline"
    self.body.append(convert(node.astext(), display=display))
    raise SkipNode  # The node's text is not written again.


def write_pages(_app: Sphinx) -> None:
    """The pages that are made: the galleries of effects, and notebooks that were not executed."""
    gallery.write(HERE / "effects.md", HERE / "effects")
    gallery.write_inside(HERE / "inside.md")
    executed = HERE / "notebooks"
    executed.mkdir(exist_ok=True)
    for notebook in (HERE.parent / "notebooks").glob("*.ipynb"):
        if not (executed / notebook.name).exists():
            shutil.copy(notebook, executed)


def setup(app: Sphinx) -> None:
    """What Sphinx calls."""
    # Before napoleon, whose priority is 500.
    app.connect("autodoc-process-docstring", as_rst, priority=400)
    app.connect("autodoc-process-signature", without_constructor)
    app.connect("missing-reference", under_public_name)
    app.connect("builder-inited", write_pages)
    app.add_html_math_renderer("mathml", (write_formula, None), (write_formula, None))

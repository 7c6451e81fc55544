"""How Sphinx builds the site: `make docs`.

The pages are the Markdown files as they stand, the Python reference comes from the docstrings, and
the gallery runs `docs/gallery/<group>/plot_*.py`; `-D plot_gallery=0` leaves the examples unrun.
Nothing here needs the network.
"""

import os
import re
import sys
from pathlib import Path

import pydantic
from docutils import nodes

import swimbladder

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))  # for figures.py

project = "swimbladder"
author = "the swimbladder developers"
project_copyright = f"2026, {author}"
version = release = swimbladder.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "myst_parser",
    "numpydoc",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["gallery/**"]
templates_path = ["_templates"]
nitpicky = True
default_role = "autolink"  # `simulate` in a docstring leads to simulate, and `x` stays *x*

# The pages: as GitHub shows them.
source_suffix = {".rst": "restructuredtext", ".md": "markdown", ".markdown": "markdown"}
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # a page may begin its parts at the third level

# The reference: names as a user writes them, `sb.Vehicle` wherever it is defined.
autosummary_generate = True
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_display_short_literal_types = True
python_maximum_signature_line_length = 90
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
numpydoc_xref_ignore = {"or", "of", "None", "optional"}

# The gallery.
GROUPS = ["control", "pool", "team", "ocean", "study"]
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "subsection_order": [f"gallery/{group}" for group in GROUPS],
    "within_subsection_order": "FileNameSortKey",
    "filename_pattern": r"/plot_",
    "abort_on_example_error": True,
    "copyfile_regex": r".*\.toml",
    "run_stale_examples": True,  # an example is as new as the package that it shows
    "image_scrapers": ("matplotlib", "figures.of_answers"),
    "ignore_repr_types": "matplotlib",
    "first_notebook_cell": "%matplotlib inline",
    "backreferences_dir": "api/backreferences",
    "doc_module": ("swimbladder",),
    "prefer_full_module": {r"swimbladder"},
    "inspect_global_variables": False,
    "show_signature": False,
    "write_computation_times": False,
    "download_all_examples": True,
    "plot_gallery": "True",
}

html_theme = "pydata_sphinx_theme"
html_title = "swimbladder"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "header_links_before_dropdown": 7,
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": False,
    "use_edit_page_button": False,
}
html_sidebars = {"index": []}

# `make docs-links` asks each address outside once; a DOI may refuse a machine.
linkcheck_anchors = False
linkcheck_timeout = 20

_LINK = re.compile(r"\[([^\]]*)\]\((?!\w+:|#)([^)\s#]+)(#[^)\s]*)?\)")
_NAME = re.compile(r"(?<!`)`sb\.(\w+)`(?!`)")
_ELSEWHERE = {
    "README.md": "/index.md",
    "CONTRIBUTING.md": "/project/contributing.markdown",
    "CHANGELOG.md": "/project/changelog.markdown",
}


def _on_site(text: str, folder: Path) -> str:
    """Return a page whose links to files above `docs/` lead to the pages that show them.

    And `sb.tune` leads to its place in the reference.
    """

    def mended(found: re.Match[str]) -> str:
        words, target, anchor = found.groups(default="")
        path = Path(os.path.normpath(folder / target))
        if path.is_relative_to(HERE):
            return f"[{words}](/{path.relative_to(HERE)}{anchor})"
        place = _ELSEWHERE.get(str(path.relative_to(HERE.parent)))
        return f"[{words}]({place}{anchor})" if place else words

    return _NAME.sub(r"{py:obj}`sb.\1 <swimbladder.\1>`", _LINK.sub(mended, text))


# The example whose picture a page begins with.
PICTURES = {
    "explanation/actuators": "team/plot_1_datasheet",
    "explanation/conventions": "control/plot_1_paper_step",
    "explanation/filter": "pool/plot_6_compare",
    "explanation/hull": "ocean/plot_2_two_seas",
    "explanation/identification": "pool/plot_2_identify",
    "explanation/laws": "control/plot_4_all_laws",
    "explanation/stability": "control/plot_6_recovery",
    "explanation/supervisor": "team/plot_4_break_it",
    "how-to/analyse": "control/plot_3_margins",
    "how-to/ballast": "ocean/plot_2_two_seas",
    "how-to/board": "team/plot_3_flash",
    "how-to/campaign": "study/plot_3_campaign",
    "how-to/compare": "pool/plot_6_compare",
    "how-to/compare-laws": "control/plot_4_all_laws",
    "how-to/design-experiment": "pool/plot_1_design",
    "how-to/energy": "ocean/plot_3_thruster",
    "how-to/extend": "control/plot_2_own_law",
    "how-to/faults": "team/plot_4_break_it",
    "how-to/firmware": "team/plot_3_flash",
    "how-to/float-logs": "ocean/plot_5_speeds",
    "how-to/identify": "pool/plot_2_identify",
    "how-to/identify-actuator": "pool/plot_3_actuator",
    "how-to/logs": "pool/plot_5_messy_log",
    "how-to/mission": "ocean/plot_1_argo_year",
    "how-to/plan": "control/plot_5_least_time",
    "how-to/pool": "pool/plot_4_stepper",
    "how-to/python": "study/plot_2_ensemble",
    "how-to/simulate": "team/plot_2_profiles",
    "how-to/size": "ocean/plot_4_size",
    "how-to/stability": "control/plot_6_recovery",
    "how-to/tune": "control/plot_4_all_laws",
}


def _pictured(text: str, example: str) -> str:
    """Return a page with the picture of an example below its first paragraph with a full stop."""
    group, _, name = example.partition("/")
    title = (HERE / "gallery" / f"{example}.py").read_text(encoding="utf-8").split("\n")[1]
    figure = (
        f":::{{figure}} /auto_gallery/{group}/images/sphx_glr_{name}_001.png\n"
        f":alt: {title}\n:width: 75%\n\n"
        f"{{doc}}`{title} </auto_gallery/{example}>`, from the gallery.\n:::\n\n"
    )
    first, end, rest = re.split(r"(?<=[.?])(\n\n)", text, maxsplit=1)
    return first + end + figure + rest


def _drawn(text: str) -> str:
    """Return a page whose pictures of examples that were not run are blank ones."""

    def mended(found: re.Match[str]) -> str:
        if (HERE / found[0].lstrip("/")).exists():
            return found[0]
        return f"{found[1]}/thumb/{found[2]}_thumb.png"

    return re.sub(r"(/auto_gallery/\w+/images)/(sphx_glr_\w+)_001\.png", mended, text)


def _read(app, name, source):
    path = Path(app.env.doc2path(name))
    if path.suffix == ".markdown":  # stands for a page above `docs/`
        path = HERE.parent / source[0].strip("<!-> \n")
        app.env.note_dependency(path)
        source[0] = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        source[0] = _on_site(source[0], path.parent)
        if name in PICTURES:
            source[0] = _pictured(source[0], PICTURES[name])
        source[0] = _drawn(source[0])


def _reference(app, env, node, around):
    """Lead to the reference, whatever module a class is named by; what has no page stays words."""
    target = node.get("reftarget", "")
    if node.get("refdomain") != "py" or not target:
        return None
    last, known = target.rpartition(".")[2], env.domains["py"].objects
    places = [f"swimbladder.{target}", f"swimbladder.{last}"]
    classes = [name for name, one in known.items() if one.objtype == "class"]
    places += [name for name in classes if name.endswith(f".{last}")]
    for name in places:
        if name in known:
            return env.domains["py"].resolve_xref(
                env, node["refdoc"], app.builder, "obj", name, node, around
            )
    if target.startswith("swimbladder.") and not _defined(target):
        return None
    return nodes.inline("", "", around)


def _signature(app, what, name, thing, options, signature, returned):
    """Leave what a file's table may hold to the list of its fields."""
    if what == "class" and issubclass(thing, pydantic.BaseModel):
        return "(**fields)", None
    return None


def _skip(app, what, name, thing, skip, options):
    return True if name == "model_config" else None


def _defined(target: str) -> bool:
    """Say whether a name that has no page is there: what answers are made of."""
    module, _, name = target.rpartition(".")
    return hasattr(sys.modules.get(module), name)


def setup(app):
    """Connect what is above."""
    app.connect("source-read", _read)
    app.connect("missing-reference", _reference)
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-skip-member", _skip)

"""Sphinx configuration: MyST pages, tutorials run as notebooks, API from these sources, no network."""

import os
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "_ext")]  # these sources, whatever version may be installed
import module_pages  # noqa: E402  # in docs/_ext, which the line above names

PICTURES = ROOT.parent / "shared" / "data" / "shots" / "open-01"  # 14 MB, not shipped

project = "kolsky"
author = "The kolsky developers"
copyright = "2026, the kolsky developers"
version = release = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]

extensions = [
    "gallery",
    "local_mathjax",
    "made_tables",
    "message_tables",
    "model_pages",
    "module_pages",
    "myst_nb",
    "notebooks_ahead",
    "shell_cells",
    "sphinx.ext.autodoc",
    "sphinx.ext.duration",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_design",
]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

# Pages with a kernel in their front matter are notebooks, run in an empty folder. What they printed is kept
# for as long as no source, shot or extension has changed: the key of the cache is their hash.
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "docs" / "_build" / "notebooks" / module_pages.digest())
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 900  # s a cell: a busy machine needs it
nb_execution_excludepatterns = [] if PICTURES.is_dir() else ["tutorials/pictures.md"]
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
os.environ["PYTHONPATH"] = os.pathsep.join(sys.path[:2])
os.environ["COLUMNS"] = "100"  # of the tables that are printed
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # notebooks run side by side
if os.environ.pop("PYTHONDONTWRITEBYTECODE", ""):  # a tutorial starts Python twenty times: compile it once
    os.environ.setdefault("PYTHONPYCACHEPREFIX", str(ROOT / "docs" / "_build" / "pycache"))

html_theme = "furo"
html_theme_options = {"top_of_page_buttons": []}
templates_path = ["_templates"]
html_title = f"kolsky {release}"

# Documented where they are defined, not again where a package offers them.
autodoc_default_options = {"members": True, "member-order": "bysource", "ignore-module-all": True}
autodoc_typehints_format = "short"
autodoc_class_signature = "separated"
default_role = "code"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False

# A nitpicky build (-n) checks references to our own names; types of others have no page here.
_OTHERS = (
    r"ast|re|np|numpy|wp|warp|pathlib|collections|concurrent|enum|typing|h5py|matplotlib|pydantic\w*|contextlib"
    r"|scipy|jinja2|argparse|subprocess|typer|types|markupsafe"
)
nitpick_ignore_regex = [
    ("py:.*", rf"({_OTHERS})\..*"),
    (
        "py:class",
        r"Path|tuple\[(int|str)|dict\[str|[a-z][a-z_ -]*",
    ),  # words in a type: "array", "callable, optional"
    # Names of ours for types: arrays, the panels of a figure, any kind of shot.
    (
        "py:class",
        r"FloatArray|NDArray|Panels|Kind|Figure|kolsky\.[a-z0-9_.]+\.(AnyShot|Model|Schema|Shown|T|Result)|_P|dic\.chain\.stages\.Result",
    ),
    ("py:.*", module_pages.without_page(module_pages.sources())),  # modules that have no page
    ("py:class", r"(explicit|doe|dic)(\.[a-z_]+)?\.[A-Z]\w*"),  # re-exported: documented where it is defined
]
suppress_warnings = ["ref.python"]  # "shape" in a type is a word, not one of several attributes of that name


def plain_docstring(app, what, name, obj, options, lines):
    """Let docstrings be read as they are written: |x| is an absolute value and `name`s a plural."""
    for i, line in enumerate(lines):
        parts = re.split(r"(`+[^`]*`+)", line)  # code stands at the odd places
        parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
        lines[i] = "".join(
            rf"{part}\ " if odd % 2 and parts[odd + 1][:1].isalnum() else part
            for odd, part in enumerate(parts)
        )
    if lines and what in ("attribute", "data", "property"):
        lines[0] = f": {lines[0]}"  # no type: else napoleon takes "Words: more words" for type and text


def setup(app):
    """Register the docstring hook, ahead of napoleon's (500)."""
    app.connect("autodoc-process-docstring", plain_docstring, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Formulas without a network: the site contains MathJax from the package sphinx-mathjax-offline."""

import importlib.util
import shutil
from pathlib import Path
from typing import Any

FILES = ("tex-chtml.js", "input/tex/extensions", "output/chtml/fonts")
"""Files that MathJax needs to draw TeX with HTML and fonts."""


def copy_files(app: Any, exception: Exception | None) -> None:
    """Copy MathJax to the static files of a finished build."""
    if exception is not None or app.builder.format != "html":
        return
    found = importlib.util.find_spec("sphinx-mathjax-offline")
    if found is None or found.origin is None:
        raise RuntimeError("sphinx-mathjax-offline is not installed: pip install 'kolsky[docs]'")
    source = Path(found.origin).parent / "static" / "mathjax"
    target = Path(app.outdir) / "_static" / "mathjax"
    for name in FILES:
        place = target / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if (source / name).is_dir():
            shutil.copytree(source / name, place, dirs_exist_ok=True)
        else:
            shutil.copyfile(source / name, place)


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx."""
    app.config.mathjax_path = "mathjax/tex-chtml.js"
    app.connect("build-finished", copy_files)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

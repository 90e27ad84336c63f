"""One page per module in `api/generated`, from the tree of sources; nothing is imported to write them.

The pages are linked from their package's and stand in no `toctree`: a sidebar with every module on every page
would be most of the build's time and of the site's size.
"""

import ast
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("kolsky", "explicit", "implicit", "doe", "dic")


class Source(NamedTuple):
    """A module's dotted name and its file."""

    name: str
    file: Path

    @property
    def summary(self) -> str:
        """First paragraph of the docstring."""
        text = ast.get_docstring(ast.parse(self.file.read_text("utf-8"))) or ""
        return " ".join(text.partition("\n\n")[0].split()).replace("|", r"\|")


def inside(package: Source) -> list[Source]:
    """Modules and packages directly inside a package; a `__main__` is a command and would run."""
    if package.file.name != "__init__.py":
        return []
    files = [f for f in package.file.parent.glob("*.py") if f.stem not in ("__init__", "__main__")]
    files += package.file.parent.glob("*/__init__.py")
    named = (Source(f"{package.name}.{(f.parent if f.stem == '__init__' else f).stem}", f) for f in files)
    return sorted(named)


def page(module: Source) -> str:
    """A page in reStructuredText: the way up, the docstrings, what is inside."""
    parent = module.name.rpartition(".")[0]
    up = f"in :doc:`{parent}`" if parent else ":doc:`/api`"
    title = module.name.replace("_", r"\_")
    lines = [":orphan:", "", title, "=" * len(title), "", up, "", f".. automodule:: {module.name}", ""]
    for part in inside(module):
        lines += [f":doc:`{part.name}`", f"   {part.summary}", ""]
    return "\n".join(lines)


def write_pages(app) -> None:
    """Write every page whose text has changed, and remove those of modules that are no more."""
    folder = Path(app.srcdir) / "api" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    old = set(folder.iterdir())
    waiting = [Source(name, ROOT / name / "__init__.py") for name in PACKAGES]
    while waiting:
        module = waiting.pop()
        waiting += inside(module)
        file, text = folder / f"{module.name}.rst", page(module)
        if file not in old or file.read_text("utf-8") != text:
            file.write_text(text, "utf-8")
        old.discard(file)
    for file in old:
        file.unlink()


def setup(app):
    """Write the pages before Sphinx looks for sources."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Pages of public modules in `api/generated`, from the tree of sources; nothing is imported to write them.

Public are the packages, the modules that define what a package offers by name, and those that a page of the
documentation refers to. Any other module is a line on the page of its package: two modules in three, whose
pages were most of the build's time and nobody's reading.

The pages are linked from their package's and stand in no `toctree`: a sidebar with every module on every page
would be most of the build's time and of the site's size.
"""

import ast
import hashlib
import re
import tomllib
from collections.abc import Container
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("kolsky", "explicit", "doe", "dic")
REFERENCE = re.compile(r"\{(?:py:\w+|doc)\}`(?:[^`<]*<)?[~!]?(?:/?api/generated/)?([\w.]+)>?`")
"""A reference of a page to a name or a page of ours."""


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


def digest() -> str:
    """Hash of all that the output of a notebook rests on: packages, shots, what runs the cells."""
    found = hashlib.sha256()
    for folder in (*PACKAGES, "runs", "docs/_ext"):
        for file in sorted((ROOT / folder).rglob("*")):
            inside_of = file.relative_to(ROOT).parts
            if file.is_file() and not {"results", "__pycache__"} & set(inside_of):
                found.update(f"{'/'.join(inside_of)}\0".encode())
                found.update(file.read_bytes())
    return found.hexdigest()[:16]


def sources() -> dict[str, Source]:
    """Every module by its name."""
    found: dict[str, Source] = {}
    waiting = [Source(name, ROOT / name / "__init__.py") for name in PACKAGES]
    while waiting:
        module = waiting.pop()
        found[module.name] = module
        waiting += inside(module)
    return found


def public(modules: dict[str, Source], docs: Path = ROOT / "docs") -> set[str]:
    """Names of the modules that have a page.

    Parameters
    ----------
    modules
        Every module by its name.
    docs
        Folder of the pages; what is built or generated in it is left out.
    """
    named = {name for name, module in modules.items() if module.file.name == "__init__.py"}
    for table, rooms in tomllib.loads((ROOT / "docs" / "rooms.toml").read_text("utf-8")).items():
        package = "kolsky" if table == "room" else table
        named |= {f"{package}.{room['name']}" for room in rooms}  # docs/architecture.md links them
    for package in PACKAGES:  # what they offer by name, imported for type checkers
        for node in ast.walk(ast.parse(modules[package].file.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module in modules:
                named.add(node.module)
    for text in docs.rglob("*.md"):
        if "_build" in text.parts:
            continue
        for target in REFERENCE.findall(text.read_text("utf-8")):
            parts = target.split(".")
            while parts and ".".join(parts) not in modules:
                parts.pop()
            named.add(".".join(parts))
    return named & set(modules)


def without_page(modules: dict[str, Source], docs: Path = ROOT / "docs") -> str:
    """A regular expression of the names in modules that have no page, and of their classes alone."""
    names = sorted(set(modules) - public(modules, docs))
    classes = {
        node.name
        for name in names
        for node in ast.parse(modules[name].file.read_text("utf-8")).body
        if isinstance(node, ast.ClassDef)
    }
    dotted = rf"({'|'.join(re.escape(name) for name in names)})\.\w+(\.\w+)*"
    return rf"{dotted}|{'|'.join(sorted(classes))}"


def page(module: Source, linked: Container[str]) -> str:
    """A page in reStructuredText: the way up, the docstrings, what is inside, linked where it has a page."""
    parent = module.name.rpartition(".")[0]
    up = f"in :doc:`{parent}`" if parent else ":doc:`/api`"
    title = module.name.replace("_", r"\_")
    lines = [":orphan:", "", title, "=" * len(title), "", up, "", f".. automodule:: {module.name}", ""]
    for part in inside(module):
        shown = f":doc:`{part.name}`" if part.name in linked else f"``{part.name}``"
        lines += [shown, f"   {part.summary}", ""]
    return "\n".join(lines)


def write_pages(app) -> None:
    """Write every page whose text has changed, and remove those of modules that have none any more."""
    folder = Path(app.srcdir) / "api" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    old = set(folder.iterdir())
    modules = sources()
    linked = public(modules)
    for name in sorted(linked):
        file, text = folder / f"{name}.rst", page(modules[name], linked)
        if file not in old or file.read_text("utf-8") != text:
            file.write_text(text, "utf-8")
        old.discard(file)
    for file in old:
        file.unlink()


def setup(app):
    """Write the pages before Sphinx looks for sources."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

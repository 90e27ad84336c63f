"""Pages of public modules in `api/generated`, made from the source files without importing them.

Three kinds of modules are public: packages, modules that define the public names of a package, and modules
that a page of the documentation refers to. Every other module is one line on the page of its package. Two
modules in three are such lines, which shortens the build.

The page of a package links the pages of its modules. They are in no `toctree`, because a sidebar with every
module on every page would need much time and space.
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
"""A reference of a page to a name or a page of this project."""


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
    """Modules and packages directly inside a package, without `__main__`, which is a command and would
    run."""
    if package.file.name != "__init__.py":
        return []
    files = [f for f in package.file.parent.glob("*.py") if f.stem not in ("__init__", "__main__")]
    files += package.file.parent.glob("*/__init__.py")
    named = (Source(f"{package.name}.{(f.parent if f.stem == '__init__' else f).stem}", f) for f in files)
    return sorted(named)


def digest() -> str:
    """Hash of all inputs of a notebook's output: packages, shots, and the code that runs the cells."""
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
        Folder of the pages. Built or generated files in it are ignored.
    """
    named = {name for name, module in modules.items() if module.file.name == "__init__.py"}
    for table, rooms in tomllib.loads((ROOT / "docs" / "rooms.toml").read_text("utf-8")).items():
        package = "kolsky" if table == "room" else table
        named |= {f"{package}.{room['name']}" for room in rooms}  # docs/architecture.md links them
    for package in PACKAGES:  # their public names, which are imported for type checkers
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
    """Regular expressions for the names in modules without a page, and for their classes only."""
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
    """A page in reStructuredText: link to the package, docstrings, and members with links to their pages."""
    parent = module.name.rpartition(".")[0]
    up = f"in :doc:`{parent}`" if parent else ":doc:`/api`"
    title = module.name.replace("_", r"\_")
    lines = [":orphan:", "", title, "=" * len(title), "", up, "", f".. automodule:: {module.name}", ""]
    for part in inside(module):
        shown = f":doc:`{part.name}`" if part.name in linked else f"``{part.name}``"
        lines += [shown, f"   {part.summary}", ""]
    return "\n".join(lines)


def write_pages(app) -> None:
    """Write every page whose text has changed, and remove pages of modules that no longer need one."""
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

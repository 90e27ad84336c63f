"""Examples of the gallery as files: a notebook and a script of each page of `docs/gallery`.

They are written into the folder `_downloads/gallery` of the site. Each page links its files.
"""

import ast
import json
import re
from pathlib import Path

CELL = re.compile(r"^```\{code-cell\} ipython3\n((?::tags:[^\n]*\n\n)?)(.*?)\n```$", re.MULTILINE | re.DOTALL)
"""A cell of a page: its tags, its code."""
LINKS = """

```{{raw}} html
<p>Run it from the repository's folder: <a download href="../_downloads/gallery/{0}.ipynb">notebook</a>,
<a download href="../_downloads/gallery/{0}.py">script</a>.</p>
```
"""


def parts(page: str) -> list[tuple[str, str]]:
    """Kind ("markdown" or "code") and text of each part of a page; cells that a page hides are left out."""
    text, found, end = page.split("\n---\n", 1)[1], [], 0
    for cell in CELL.finditer(text):
        found += [("markdown", text[end : cell.start()].strip())]
        found += [("code", cell[2])] if "remove-cell" not in cell[1] else []
        end = cell.end()
    found.append(("markdown", text[end:].strip()))
    plain = re.compile(r"\{doc\}`[./]*(\w+/)?(\w+)`")
    return [(kind, plain.sub(r"`\2`", part) if kind == "markdown" else part) for kind, part in found if part]


def notebook(page: str) -> str:
    """A page as a notebook."""
    cells = []
    for number, (kind, text) in enumerate(parts(page)):
        extra = {"execution_count": None, "outputs": []} if kind == "code" else {}
        source = text.splitlines(keepends=True)
        cells.append({"cell_type": kind, "id": str(number), "metadata": {}, "source": source, **extra})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False)


def script(page: str) -> str:
    """A page as a script: text as comments, figures saved, other values printed."""
    blocks, drawn = [], 0
    for kind, text in parts(page):
        if kind == "markdown":
            blocks.append("\n".join(f"# {line.lstrip('# ')}".rstrip() for line in text.splitlines()))
            continue
        body, last = _split(text)
        if last is None:
            blocks.append(text)
        elif ".plot(" in last or last.startswith("plot("):
            drawn += 1
            blocks.append(f'{body}{last}.savefig("figure-{drawn}.png")')
        else:
            blocks.append(f"{body}print({last})")
    return "\n\n".join(blocks) + "\n"


def _split(code: str) -> tuple[str, str | None]:
    """The code before its last statement, and this statement if it is a value; otherwise None."""
    last = ast.parse(code).body[-1]
    if not isinstance(last, ast.Expr):
        return code, None
    lines = code.splitlines(keepends=True)
    value = ast.get_source_segment(code, last.value)
    return "".join(lines[: last.lineno - 1]), value


def link(app, docname, source) -> None:
    """Add the links to a page of the gallery."""
    if docname.startswith("gallery/") and docname != "gallery/index":
        source[0] = source[0].rstrip() + LINKS.format(docname.rpartition("/")[2])


def write(app, error) -> None:
    """Write the files of all pages."""
    if error is not None or app.builder.format != "html":
        return
    folder = Path(app.outdir) / "_downloads" / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    for path in (Path(app.srcdir) / "gallery").glob("*.md"):
        if path.stem != "index":
            page = path.read_text("utf-8")
            (folder / f"{path.stem}.ipynb").write_text(notebook(page), encoding="utf-8")
            (folder / f"{path.stem}.py").write_text(script(page), encoding="utf-8")


def setup(app):
    """Register with Sphinx: links are added when a page is read, files are written when the site is built."""
    app.connect("source-read", link)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

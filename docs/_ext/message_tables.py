"""Tables of error messages and of outcomes, read from the sources, and the index of figures.

A line ``<!-- messages kolsky/readers dic/images -->`` becomes the table of all error messages in these
folders or files. Its columns are the message, the allowed values and the cure; "…" replaces values of a
message. ``<!-- outcomes NAME -->`` becomes the members of an outcome's enumeration with cause and cure.
``<!-- figures -->`` becomes the figures of all pages with the beginning of their captions.
"""

import ast
import importlib
import re
from pathlib import Path

from made_tables import with_values

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
LINE = re.compile(r"^<!-- (messages|outcomes|figures)((?: [\w./]+)*) -->$", re.MULTILINE)
SPLIT = re.compile(r"^```\{figure\} (\S+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
ROLE = re.compile(r" ?\(?\{\w+\}`[^`]*`\)?")
"""A reference. It would be relative to another page."""
SHORTEST = 60
"""Smallest number of characters of a caption's beginning; "Left:" is too short."""


def text_of(node: ast.expr | None) -> str:
    """A text of the sources as it is printed, with "…" for each value."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(text_of(value) for value in values)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return text_of(left) + text_of(right)
        case None:
            return ""
    return "…"


def refusals(file: Path) -> list[tuple[str, str, str]]:
    """Message, allowed values and cure of every error in a file, in the order of the file."""
    found = []
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        given = {word.arg: word.value for word in node.keywords if word.arg}
        if not (name.endswith("InputError") or "cure" in given or "allowed" in given):
            continue
        texts = [arg for arg in node.args if isinstance(arg, ast.Constant | ast.JoinedStr | ast.BinOp)]
        message = text_of(given.get("message") or (texts[0] if texts else None))
        key = f"{text_of(given['key'])} " if "key" in given else ""
        if len(message.strip(" …")) > 3:
            found.append(
                (node.lineno, f"{key}{message}", text_of(given.get("allowed")), text_of(given.get("cure")))
            )
    return [row[1:] for row in sorted(found)]


def cell(text: str) -> str:
    """A text in the form of a table's cell."""
    plain = " ".join(re.sub("…[… ]*…", "…", text).split()).replace("`", "'").replace("|", "\\|")
    return f"`{plain}`" if plain else ""


def messages(places: str) -> str:
    """The error messages of folders and files."""
    files: list[Path] = []
    for place in places.split():
        path = ROOT / place
        files += sorted(path.rglob("*.py")) if path.is_dir() else [path]
    rows = list(dict.fromkeys(row for file in files for row in refusals(file)))
    lines = ["| what is said | it must be | cure |", "| --- | --- | --- |"]
    return "\n".join([*lines, *(f"| {' | '.join(map(cell, row))} |" for row in rows)])


def outcomes(name: str) -> str:
    """The members of an outcome's enumeration, given by its dotted name."""
    module, _, kind = name.strip().rpartition(".")
    lines = ["| outcome | cause | cure |", "| --- | --- | --- |"]
    return "\n".join(
        [
            *lines,
            *(
                f"| `{m.name}` | {m.cause} | {m.cure} |"
                for m in getattr(importlib.import_module(module), kind)
            ),
        ]
    )


def figures(_: str = "") -> str:
    """The figures of all pages: beginning of the caption, page."""
    rows: list[str] = []
    for page in sorted(DOCS.rglob("*.md")):
        if "_build" in page.parts or page.stem == "figures":
            continue
        text = page.read_text("utf-8")
        for _, body in SPLIT.findall(with_values(page, text) if "{{ " in text else text):
            caption = " ".join(
                line for line in body.splitlines() if line.strip() and not line.startswith(":")
            )
            first = ""
            for sentence in re.split(r"(?<=[.:;])\s", caption.strip()):
                first = f"{first} {sentence}".strip()
                if len(first) >= SHORTEST:
                    break
            first = ROLE.sub("", first).rstrip(".:; ").replace("|", "\\|")
            rows.append(f"| {first} | {{doc}}`/{page.relative_to(DOCS).with_suffix('')}` |")
    return "\n".join(["| figure | page |", "| --- | --- |", *dict.fromkeys(rows)])


TABLES = {"messages": messages, "outcomes": outcomes, "figures": figures}


def fill(app, name, source) -> None:
    """Insert the tables that a page requests."""
    source[0] = LINE.sub(lambda found: TABLES[found[1]](found[2]), source[0])


def setup(app):
    """Register with Sphinx: every page is processed before it is read."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

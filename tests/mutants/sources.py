"""Places of faults: the functions, classes and constants of the packages by their names."""

import ast
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from tests.mutants.fault import Fault

ROOT = Path(__file__).resolve().parents[2]
NO_SOURCES = {"tests", "docs", "build"}  # Top-level folders in which no fault lies

TOKEN = re.compile(
    r"""(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?  # a number
    | \w+
    | \*\*=? | //=? | << | >> | -> | \.\.\. | [-+*/%@&|^<>=!:]=
    | \S""",
    re.VERBOSE,
)
"""A token of code or a word of a text in it."""

TEXT_OR_COMMENT = re.compile(
    r""""{3}(?:\\.|[^\\])*?"{3} | '{3}(?:\\.|[^\\])*?'{3}
    | "(?:\\.|[^"\\])*" | '(?:\\.|[^'\\])*' | \#[^\r\n]*""",
    re.VERBOSE | re.DOTALL,
)
WORD = re.compile(r"\w+")
BLANKED = re.compile(r"[^\r\n]")


@dataclass(frozen=True)
class Token:
    """A token and where it lies in its file."""

    text: str
    start: int
    end: int


def tokens(code: str, *, start: int = 0, end: int | None = None) -> tuple[Token, ...]:
    """The tokens of a piece of code, or of a part of it; a comma before a closing bracket is none."""
    stop = len(code) if end is None else end
    found = [Token(one[0], *one.span()) for one in TOKEN.finditer(code, start, stop)]
    followers = [*(one.text for one in found[1:]), ""]
    return tuple(
        one
        for one, after in zip(found, followers, strict=True)
        if not (one.text == "," and after in (")", "]", "}"))
    )


def occurrences(part: Sequence[str], whole: Sequence[str]) -> tuple[int, ...]:
    """Where a sequence of tokens begins in a longer one."""
    size, part = len(part), tuple(part)
    return tuple(
        at
        for at in range(len(whole) - size + 1 if size else 0)
        if whole[at] == part[0] and tuple(whole[at : at + size]) == part
    )


def texts(code: str) -> tuple[str, ...]:
    """The tokens of a pattern."""
    return tuple(one.text for one in tokens(code))


class Module:
    """A source file, and its code without comments and docstrings; parsed where a fault may lie in it."""

    def __init__(self, file: str, source: str) -> None:
        self.file, self.source = file, source

    @cached_property
    def tree(self) -> ast.Module:
        """What the source means."""
        return ast.parse(self.source)

    @cached_property
    def places(self) -> dict[str, list["Place"]]:
        """Every function, class and constant by its name."""
        found: dict[str, list[Place]] = {}
        for place in _places(self, self.tree, "", in_function=False):
            found.setdefault(place.name, []).append(place)
        return found

    @cached_property
    def line_starts(self) -> tuple[int, ...]:
        """Where each line begins, and where the last one ends."""
        starts = [0]
        for line in self.source.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        return tuple(starts)

    @cached_property
    def code(self) -> str:
        """The source with spaces in place of comments and docstrings: every place is kept."""
        spans = [
            (self.line_starts[node.lineno - 1], self.line_starts[node.end_lineno or node.lineno])
            for node in _statements(self.tree)
            if isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ]
        spans += [one.span() for one in TEXT_OR_COMMENT.finditer(self.source) if one[0][0] == "#"]
        parts, at = [], 0
        for start, end in sorted(spans):
            parts += [self.source[at:start], BLANKED.sub(" ", self.source[start:end])]
            at = end
        return "".join([*parts, self.source[at:]])

    @cached_property
    def texts(self) -> tuple[str, ...]:
        """The tokens of the code."""
        return texts(self.code)


@dataclass(frozen=True, eq=False)
class Place:
    """A function, class or constant of a module, as whole lines."""

    module: Module
    name: str
    first: int
    last: int
    constant: bool = False

    @cached_property
    def tokens(self) -> tuple[Token, ...]:
        """The tokens of its lines."""
        starts = self.module.line_starts
        return tokens(self.module.code, start=starts[self.first - 1], end=starts[self.last])

    def found(self, code: str) -> tuple[int, ...]:
        """Where the tokens of a piece of code begin among those of the place."""
        return occurrences(texts(code), self.texts)

    def is_near(self, code: str) -> bool:
        """Whether code stands in a function or class, or in the module of a constant."""
        if not self.constant:
            return bool(self.found(code))
        return bool(occurrences(texts(code), self.module.texts))

    @cached_property
    def texts(self) -> tuple[str, ...]:
        """The tokens without their places."""
        return tuple(one.text for one in self.tokens)

    def changed(self, fault: Fault) -> str:
        """The lines of the place with a fault in them."""
        starts, planted = self.module.line_starts, self.planted(fault)
        return planted[starts[self.first - 1] : len(planted) - len(self.module.source) + starts[self.last]]

    def planted(self, fault: Fault) -> str:
        """The source of the module with a fault in it; lines of the wrong code after its first are indented
        as the line that they follow is."""
        begin = self.found(fault.right)[0]
        start = self.tokens[begin].start
        end = self.tokens[begin + len(texts(fault.right)) - 1].end
        source = self.module.source
        line = source[source.rfind("\n", 0, start) + 1 :]
        indent = line[: len(line) - len(line.lstrip())]
        return source[:start] + fault.wrong.replace("\n", f"\n{indent}") + source[end:]


def _places(module: Module, parent: ast.AST, within: str, *, in_function: bool) -> Iterator[Place]:
    for node in ast.iter_child_nodes(parent):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
            yield Place(module, within + node.name, first, node.end_lineno or node.lineno)
            function = not isinstance(node, ast.ClassDef)
            yield from _places(module, node, f"{within}{node.name}.", in_function=function)
        elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign) and not in_function:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for one in (name for target in targets for name in ast.walk(target)):
                if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store):
                    last = node.end_lineno or node.lineno
                    yield Place(module, within + one.id, node.lineno, last, constant=True)
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "__name__ == '__main__'":
            yield Place(module, "__main__", node.lineno, node.end_lineno or node.lineno)
        elif isinstance(node, ast.stmt | ast.excepthandler | ast.match_case):
            yield from _places(module, node, within, in_function=in_function)


def _statements(parent: ast.AST) -> Iterator[ast.AST]:
    for node in ast.iter_child_nodes(parent):
        if isinstance(node, ast.stmt | ast.excepthandler | ast.match_case):
            yield node
            yield from _statements(node)


class Sources:
    """The sources under a folder, where faults are looked for."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.modules: dict[str, list[Module]] = {}  # by the words in them
        for folder in sorted(root.iterdir()):
            if folder.name.startswith(".") or folder.name in NO_SOURCES or not folder.is_dir():
                continue
            if not (folder / "__init__.py").is_file():
                continue
            for path in sorted(folder.rglob("*.py")):
                module = Module(path.relative_to(root).as_posix(), path.read_text("utf-8"))
                for word in set(WORD.findall(module.source)):
                    self.modules.setdefault(word, []).append(module)

    def place(self, fault: Fault) -> Place:
        """The one place that a fault fits.

        Raises ValueError if it fits none, or several, or nothing would change.
        """
        named = [
            place
            for module in self.modules.get(fault.function.rpartition(".")[2], ())
            for place in module.places.get(fault.function, ())
            if not fault.near or place.is_near(fault.near)
        ]
        near = f" near {fault.near!r}" if fault.near else ""
        if not named:
            raise ValueError(f"{fault.name}: nothing is called {fault.function}{near}")
        times = [len(place.found(fault.right)) for place in named]
        if times.count(1) != 1:
            counted = ", ".join(
                f"{count} times in {place.module.file}" for place, count in zip(named, times, strict=True)
            )
            raise ValueError(
                f"{fault.name}: {fault.right!r} must stand once in one {fault.function}{near}, "
                f"but stands {counted}"
            )
        place = named[times.index(1)]
        if place.planted(fault) == place.module.source:
            raise ValueError(f"{fault.name}: nothing changes")
        return place


@cache
def sources(root: Path = ROOT) -> Sources:
    """The sources under a folder, read once."""
    return Sources(root)

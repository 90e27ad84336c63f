"""A loop that looks up a table, in two passes: to the place in the table, and on from there.

An element's chain of operations is longer than what a core looks ahead, so one element alone fills it and the
core waits. Of a few elements together first one half, then the other half is done: each half is short enough
that two elements overlap. What the second half needs of the first is kept between them; what is only a number
from memory is read again. Every operation is that of the loop in one pass, and so are the bits.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

BLOCK = 8
"""Turns of the loop that go together. Measured: 4 to 8 alike, 2 slower than one pass; what 16 and more keep
(35 packs each) leaves no room for the state in a core's first cache."""
LOOKED_UP = "// from here on the place in a table is known"
"""A line of the generated source: where a loop may be divided."""

_NAME = re.compile(r"[A-Za-z_]\w*")
_CONSTANT = re.compile(r"const (auto&|\w+) (\w+) = (.*);")
_PLAIN = re.compile(r"(\w+) = (.*);")
_LOCAL = re.compile(r"(\w+) (\w+);")
_FILL = re.compile(r"for \(int l = 0; l < W; \+\+l\) (\w+)\[l\] = .*;")
_BRACES = re.compile(r"(?:if|while|for) \(.*\) \{|\} else \{|\}")
_READ = re.compile(r"\*\(\w+\*\)\(.*\)|\(\(\w+\*\)\w+\)\[.*\]|\w+")
_FUNCTION = re.compile(r"::|__builtin|\?")
_LANES_OF = re.compile(r"^(?:else )?(?:for \(.*?\) )?(?:if \((?:\w+\[l\]|op::all\(\w+\))\) )?")
_PACKS = frozenset({"f64v", "f32v", "i32v", "mask"})
_TYPES = frozenset({"f64vu", "f32vu", "i32vu"})


@dataclass(frozen=True)
class Loop:
    """A generated loop over elements, ``while (true) { head; first; second; step }``."""

    head: Sequence[str]
    """Its condition, and how it is left."""
    first: Sequence[str]
    """To the place in the table."""
    second: Sequence[str]
    """From there on."""
    step: Sequence[str]
    """How the counter goes on."""
    counter: str
    """C++ name of the counter."""
    kinds: Mapping[str, str]
    """C++ types of the variables that outlive a turn."""


@dataclass
class _FirstPass:
    """What the first pass defines."""

    kinds: dict[str, str] = field(default_factory=dict)
    """C++ type of each name that it gives a value."""
    once: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Line and value of each name that it gives one value, where all lanes are at work."""
    given: dict[str, int] = field(default_factory=dict)
    """How often each gets a value."""


def divided(loop: Loop) -> tuple[list[str], list[str]] | None:
    """Declarations and lines of a loop in two passes, or None where its turns depend on each other.

    They do not if the first half writes nothing but its own variables, reads none that the second half
    assigns, and no array that it writes to.
    """
    found = _first_pass(loop)
    if found is None or _depend(loop, found):
        return None
    kept, again = _handed_over(loop, found)
    if any(found.kinds[name] in ("auto", "auto&") for name in kept):
        return None
    kinds = {**{name: found.kinds[name] for name in kept}, loop.counter: loop.kinds[loop.counter]}
    declared = [f"{kind} kept_{name}[{BLOCK}];" for name, kind in kinds.items()]
    counter = loop.counter
    lines = ["while (true) {", "int turns = 0;", f"while (turns < {BLOCK}) {{", *loop.head, *loop.first]
    lines += [f"kept_{name}[turns] = {name};" for name in kinds]
    lines += [*loop.step, "++turns;", "}", f"const {kinds[counter]} further = {counter};"]
    lines += ["for (int turn = 0; turn < turns; ++turn) {"]
    lines += [
        f"{'' if name in loop.kinds else f'const {kind} '}{name} = kept_{name}[turn];"
        for name, kind in kinds.items()
    ]
    lines += [*again, *loop.second, "}", f"{counter} = further;", f"if (turns < {BLOCK}) break;", "}"]
    return declared, lines


def _first_pass(loop: Loop) -> _FirstPass | None:
    """What the head and the first half define; None if they do anything else."""
    found, depth = _FirstPass(), 0
    for line in (*loop.head, *loop.first):
        if line.endswith(" break;"):
            continue
        if match := _CONSTANT.fullmatch(line):
            kind, name, value = match.groups()
        elif (match := _PLAIN.fullmatch(line)) and match[1] in loop.kinds:
            kind, name, value = loop.kinds[match[1]], match[1], match[2]
        elif match := _LOCAL.fullmatch(line):
            kind, name, value = match[1], match[2], ""
        elif (match := _FILL.fullmatch(line)) and match[1] in found.kinds:
            continue
        elif _BRACES.fullmatch(line):
            depth += line.count("{") - line.count("}")
            continue
        else:
            return None
        if name == loop.counter:
            return None
        found.given[name] = found.given.get(name, 0) + 1
        if depth == 0 or name in loop.kinds:  # others are not known outside their braces
            found.kinds[name] = kind
        if depth == 0 and value:
            found.once[name] = (line, value)
    found.once = {name: held for name, held in found.once.items() if found.given[name] == 1}
    return found


def _depend(loop: Loop, found: _FirstPass) -> bool:
    """Whether the first half reads what the second half of a turn before has written."""
    written = {name for name in map(_written, loop.second) if name} - {loop.counter}
    return bool(written & _read_before_given((*loop.head, *loop.first)))


def _written(line: str) -> str:
    """The variable or the array that a line writes to, if it is not its own."""
    if _CONSTANT.fullmatch(line) or _LOCAL.fullmatch(line) or _BRACES.fullmatch(line):
        return ""
    names = _NAME.findall(_LANES_OF.sub("", line).partition(" = ")[0])
    return next((name for name in names if name not in _TYPES), "")


def _read_before_given(lines: Sequence[str]) -> set[str]:
    """Names that lines read and have not given a value before in every lane."""
    read: set[str] = set()
    given: set[str] = set()
    depth = 0
    for line in lines:
        match = _CONSTANT.fullmatch(line) or _PLAIN.fullmatch(line)
        value = match[match.lastindex or 0] if match else line
        read |= set(_NAME.findall(value)) - given
        if match and depth == 0:
            given.add(match[match.lastindex - 1])  # type: ignore[operator]
        depth += line.count("{") - line.count("}")
    return read


def _handed_over(loop: Loop, found: _FirstPass) -> tuple[list[str], list[str]]:
    """Names to be kept for the second half, in the order in which it reads them, and lines read again."""
    kept: list[str] = []
    again: list[str] = []
    seen: set[str] = {loop.counter}

    def need(name: str) -> None:
        if name in seen or name not in found.kinds:
            return
        seen.add(name)
        if name in found.once and _from_memory(name, loop, found):
            line, value = found.once[name]
            for other in _NAME.findall(value):
                need(other)
            again.append(line)
        else:
            kept.append(name)

    wanted = _read_before_given(loop.second)
    for name in (name for line in loop.second for name in _NAME.findall(line) if name in wanted):
        need(name)
    place = {line: k for k, line in enumerate((*loop.head, *loop.first))}
    return kept, sorted(again, key=place.__getitem__)


def _from_memory(name: str, loop: Loop, found: _FirstPass) -> bool:
    """Whether a value is a number from memory, at a place that is known without the first half."""
    if name == loop.counter or name not in found.kinds:
        return True
    if name not in found.once:
        return False
    value = found.once[name][1]
    if _FUNCTION.search(value) or (found.kinds[name] in _PACKS and not _READ.fullmatch(value)):
        return False
    return all(_from_memory(other, loop, found) for other in _NAME.findall(value))

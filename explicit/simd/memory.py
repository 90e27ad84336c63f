"""Reading and writing Warp arrays from lanes, and loops over tables in two passes.

The operations of one element form a chain that is longer than the instruction window of a core. A loop with a
table lookup is therefore divided into two passes. For a few elements the first pass does the operations up to
the table's index. The second pass does the other operations. The passes are short, so two elements overlap.
The operations are the same as in one pass, so the results are bitwise equal.
"""

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from explicit.layout.structs import GROUP
from explicit.simd.expressions import (
    PACK,
    SCALAR,
    Array,
    Expressions,
    PythonObject,
    Scalar,
    Struct,
    Value,
    Vector,
    is_struct,
    is_vector,
    kind_of,
    literal,
)

BLOCK = 8
"""Number of iterations of the loop in one block. 4 and 8 are equally fast; 2 is slower than one pass. With 16
or more, the stored values (35 packs each) do not fit into a core's first-level cache with the state."""
LOOKED_UP = "// from here on the place in a table is known"
"""Line of the generated source that marks where a loop may be divided."""

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
    """Lines with the condition and the exit."""
    first: Sequence[str]
    """Lines up to the index in the table."""
    second: Sequence[str]
    """Lines after the index in the table."""
    step: Sequence[str]
    """Lines that increase the counter."""
    counter: str
    """C++ name of the counter."""
    kinds: Mapping[str, str]
    """C++ types of the variables that are kept after an iteration."""


@dataclass
class _FirstPass:
    """Names that the first pass defines."""

    kinds: dict[str, str] = field(default_factory=dict)
    """C++ type of each name that is assigned."""
    once: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Line and value of each name that is assigned once with all lanes active."""
    given: dict[str, int] = field(default_factory=dict)
    """Number of assignments of each name."""


def divided(loop: Loop) -> tuple[list[str], list[str]] | None:
    """Declarations and lines of a loop in two passes, or None if its iterations depend on each other.

    They are independent if the first half writes only its variables and reads nothing that the second half
    writes.
    """
    first_pass = _first_pass(loop)
    if first_pass is None or _depend(loop, first_pass):
        return None
    stored, repeated = _handed_over(loop, first_pass)
    if any(first_pass.kinds[name] in ("auto", "auto&") for name in stored):
        return None
    kinds = {**{name: first_pass.kinds[name] for name in stored}, loop.counter: loop.kinds[loop.counter]}
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
    lines += [*repeated, *loop.second, "}", f"{counter} = further;", f"if (turns < {BLOCK}) break;", "}"]
    return declared, lines


def _first_pass(loop: Loop) -> _FirstPass | None:
    """Names that the head and the first half define. None if they do more than define names."""
    result, depth = _FirstPass(), 0
    for line in (*loop.head, *loop.first):
        if line.endswith(" break;"):
            continue
        if match := _CONSTANT.fullmatch(line):
            kind, name, value = match.groups()
        elif (match := _PLAIN.fullmatch(line)) and match[1] in loop.kinds:
            kind, name, value = loop.kinds[match[1]], match[1], match[2]
        elif match := _LOCAL.fullmatch(line):
            kind, name, value = match[1], match[2], ""
        elif (match := _FILL.fullmatch(line)) and match[1] in result.kinds:
            continue
        elif _BRACES.fullmatch(line):
            depth += line.count("{") - line.count("}")
            continue
        else:
            return None
        if name == loop.counter:
            return None
        result.given[name] = result.given.get(name, 0) + 1
        if depth == 0 or name in loop.kinds:  # other names are not defined outside their braces
            result.kinds[name] = kind
        if depth == 0 and value:
            result.once[name] = (line, value)
    result.once = {
        name: line_and_value for name, line_and_value in result.once.items() if result.given[name] == 1
    }
    return result


def _depend(loop: Loop, first_pass: _FirstPass) -> bool:
    """Whether the first half reads a variable that the second half of the previous iteration has written."""
    written = {name for name in map(_written, loop.second) if name} - {loop.counter}
    return bool(written & _read_before_assignment((*loop.head, *loop.first)))


def _written(line: str) -> str:
    """The variable or array outside this iteration that a line writes to."""
    if _CONSTANT.fullmatch(line) or _LOCAL.fullmatch(line) or _BRACES.fullmatch(line):
        return ""
    names = _NAME.findall(_LANES_OF.sub("", line).partition(" = ")[0])
    return next((name for name in names if name not in _TYPES), "")


def _read_before_assignment(lines: Sequence[str]) -> set[str]:
    """Names that lines read before every lane has assigned them."""
    read: set[str] = set()
    assigned: set[str] = set()
    depth = 0
    for line in lines:
        match = _CONSTANT.fullmatch(line) or _PLAIN.fullmatch(line)
        value = match[match.lastindex or 0] if match else line
        read |= set(_NAME.findall(value)) - assigned
        if match and depth == 0:
            assigned.add(match[match.lastindex - 1])  # type: ignore[operator]
        depth += line.count("{") - line.count("}")
    return read


def _handed_over(loop: Loop, first_pass: _FirstPass) -> tuple[list[str], list[str]]:
    """Names to be stored for the second half, in the order of its reads, and lines to be repeated."""
    stored: list[str] = []
    repeated: list[str] = []
    visited: set[str] = {loop.counter}

    def need(name: str) -> None:
        if name in visited or name not in first_pass.kinds:
            return
        visited.add(name)
        if name in first_pass.once and _from_memory(name, loop, first_pass):
            line, value = first_pass.once[name]
            for operand in _NAME.findall(value):
                need(operand)
            repeated.append(line)
        else:
            stored.append(name)

    read = _read_before_assignment(loop.second)
    for name in (name for line in loop.second for name in _NAME.findall(line) if name in read):
        need(name)
    place = {line: k for k, line in enumerate((*loop.head, *loop.first))}
    return stored, sorted(repeated, key=place.__getitem__)


def _from_memory(name: str, loop: Loop, first_pass: _FirstPass) -> bool:
    """Whether a value is a number in memory whose position does not depend on the first half."""
    if name == loop.counter or name not in first_pass.kinds:
        return True
    if name not in first_pass.once:
        return False
    value = first_pass.once[name][1]
    if _FUNCTION.search(value) or (first_pass.kinds[name] in _PACKS and not _READ.fullmatch(value)):
        return False
    return all(_from_memory(operand, loop, first_pass) for operand in _NAME.findall(value))


ZERO = literal(0, "i32")
WITH_SPARE = ("Body", "State")
"""Structs whose arrays have at least as many unused entries after every row as a pack has lanes."""


def _grouped(table: str, k: str, e: str) -> str:
    return f"(long long)({e} / {GROUP}) * {table}_s0 + {k} * {GROUP} + {e} % {GROUP}"


class Memory(Expressions):
    """Translates subscripts: uniform, adjacent over the lanes, or gathered lane by lane."""

    arrays: dict[str, str]
    written: set[str]

    def struct_array(self, dtype: Any, code: str, owner: Struct) -> Array:
        """An array that is a field of a struct. Its pointer and strides are declared once, at the top."""
        name = code.replace(".", "_")
        scratch = owner.type.cls.__name__ == "State"
        if not is_struct(dtype.dtype) and self._kind(dtype.dtype) == "bool":
            raise TypeError(f"{code}: truth values are kept as integers")
        if scratch and (is_struct(dtype.dtype) or is_vector(dtype.dtype)):
            raise TypeError(f"{code}: the state holds plain numbers")
        element = "auto*" if is_struct(dtype.dtype) else f"{SCALAR[self._kind(dtype.dtype)]}*"
        cast = "" if is_struct(dtype.dtype) else f"({element})"
        lines = [f"{element} const {name} = {cast}{code}.data;"]
        for k in range(dtype.ndim - 1):
            lines.append(f"const int {name}_s{k} = (int)({code}.strides[{k}] / (int)sizeof(*{code}.data));")
        lines += [f"const int {name}_n{k} = (int){code}.shape[{k}];" for k in range(dtype.ndim)]
        self.arrays[name] = "\n".join(lines)
        return Array(
            name,
            dtype.dtype,
            dtype.ndim,
            scratch=scratch,
            lanes_inside=scratch and self.lanes_inside,
            spare=owner.type.cls.__name__ in WITH_SPARE,
        )

    @staticmethod
    def _kind(dtype: Any) -> str:
        return kind_of(dtype._wp_scalar_type_ if is_vector(dtype) else dtype)

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.expression(node.value)
        index = self.expression(node.slice)
        places = index if isinstance(index, tuple) else (index,)
        if isinstance(owner, Vector):
            (place,) = places
            if not isinstance(place, Scalar) or place.const is None:
                raise self.refuse(node, "a component is chosen by a known number")
            return owner.items[place.const]
        if isinstance(owner, PythonObject) and isinstance(owner.thing, Array):
            (place,) = places
            offset, ndim = owner.thing.given, owner.thing.ndim
            axis = place.const if isinstance(place, Scalar) else None
            if axis is None or owner.thing.scratch or not 0 <= axis < ndim - offset:
                raise self.refuse(node, "the shape of a constant array by a known number is wanted")
            return Scalar("i32", f"{owner.thing.name}_n{offset + axis}")
        if not isinstance(owner, Array):
            raise self.refuse(node, "only arrays and vectors have parts")
        array = self.part(owner, places, node)
        if array.given < array.ndim:
            return array
        (last,) = places[-1:]
        if owner.header is not None and last.const in owner.header:  # type: ignore[union-attr]
            return owner.header[last.const]  # type: ignore[union-attr, no-any-return]
        return self.load(array)

    def part(self, owner: Array, places: tuple[Any, ...], node: ast.AST) -> Array:
        """An array with more known subscripts."""
        if not all(isinstance(place, Scalar) and place.kind == "i32" for place in places):
            raise self.refuse(node, "a subscript is an integer")
        if owner.given + len(places) > owner.ndim:
            raise self.refuse(node, "too many subscripts")
        offset = owner.offset
        for k, place in enumerate(places, start=owner.given):
            if k == 0 and owner.scratch:
                continue  # the array holds only the rows of this pack
            step = place
            if k < owner.ndim - 1:
                stride = Scalar("i32", f"{owner.name}_s{k}")
                step = self.arithmetic(ast.Mult(), place, stride, node)  # type: ignore[assignment]
            offset = step if offset is None else self._further(offset, step, node)
        return replace(owner, given=owner.given + len(places), offset=offset)

    def field(self, arguments: Sequence[Value], node: ast.AST) -> Array:
        """A simulation's row of an array of the state."""
        fields, sample = arguments[:2]
        assert isinstance(fields, Array)
        return self.part(fields, (sample,), node)

    def entry(self, arguments: Sequence[Value], node: ast.AST) -> Scalar:
        """The k-th constant of element or node e of a grouped table
        (`explicit.layout.structs.entry_function`).

        Consecutive lanes begin at a multiple of their number, so they are in one group.
        """
        table, row, column = arguments
        if not isinstance(table, Array) or not isinstance(row, Scalar) or not isinstance(column, Scalar):
            raise self.refuse(node, "a table and two numbers are wanted")
        if table.ndim != 2 or table.given or table.scratch or row.varying:
            raise self.refuse(node, "a table of constants and a number that all lanes share are wanted")
        kind = self._kind(table.dtype)
        if column.varying and not column.lane:
            if self.mask is not None:  # idle lanes read a harmless place
                column = self.select(Scalar("bool", self.mask, True), column, ZERO)
            name = self.name("g")
            self.emit(f"{PACK[kind]} {name};")
            where = _grouped(table.name, row.code, f"{column.code}[l]")
            self.emit(f"for (int l = 0; l < W; ++l) {name}[l] = {table.name}[{where}];")
            return Scalar(kind, name, True)
        if column.varying:
            where = _grouped(table.name, row.code, f"{column.code}[0]")
            return self.temporary(kind, f"*({PACK[kind]}u*)({table.name} + {where})", True)
        return self.temporary(kind, f"{table.name}[{_grouped(table.name, row.code, column.code)}]", False)

    def four(self, arguments: Sequence[Value], node: ast.AST) -> Vector:
        """Four consecutive numbers of a row.

        If the position varies: one load for each lane and a transposition, which is faster than four gathers.
        """
        row, place = arguments
        if not isinstance(row, Array) or not isinstance(place, Scalar) or row.lanes_inside:
            raise self.refuse(node, "a row of constants and a number are wanted")
        array = self.part(row, (place,), node)
        kind, offset = self._kind(array.dtype), array.offset or ZERO
        if not offset.varying:
            places = (f"{array.name}[{offset.code} + {c}]" for c in range(4))
            return Vector(tuple(self.temporary(kind, place, False) for place in places))
        if self.mask is not None:  # idle lanes read a harmless place
            offset = self.select(Scalar("bool", self.mask, True), offset, ZERO)
        name, quad = self.name("q"), "f64q" if kind == "f64" else "f32q"
        self.emit(LOOKED_UP)
        for lane in range(self.lanes):
            self.emit(f"const {quad} {name}_{lane} = *(const {quad}*)({array.name} + {offset.code}[{lane}]);")
        # Every fourth row is placed side by side, then each quarter is transposed as a 4 x 4 block.
        rows = [self._joined([f"{name}_{lane}" for lane in range(k, self.lanes, 4)]) for k in range(4)]
        firsts, pairs = range(0, self.lanes, 4), []
        for k in (0, 2):
            for half in (0, 2):
                chosen = [i + half + n + m * self.lanes for i in firsts for n in (0, 1) for m in (0, 1)]
                pairs.append(self._shuffled(rows[k], rows[k + 1], chosen))
        items: list[Scalar] = []
        for low, high in ((pairs[0], pairs[2]), (pairs[1], pairs[3])):
            for half in (0, 2):
                chosen = [i + half + n + m * self.lanes for i in firsts for m in (0, 1) for n in (0, 1)]
                whole = self._shuffled(low, high, chosen)
                items.append(self.temporary(kind, f"({PACK[kind]}){whole}", True))
        return Vector(tuple(items))

    def _joined(self, parts: list[str]) -> str:
        """Concatenation of vectors of equal length."""
        width = 4
        while len(parts) > 1:
            width *= 2
            pairs = zip(parts[::2], parts[1::2], strict=True)
            parts = [self._shuffled(a, b, range(width)) for a, b in pairs]
        return parts[0]

    def _shuffled(self, first: str, second: str, chosen: Sequence[int]) -> str:
        """Chosen entries of two vectors, numbered through both."""
        name = self.name("p")
        places = ", ".join(map(str, chosen))
        self.emit(f"const auto {name} = __builtin_shufflevector({first}, {second}, {places});")
        return name

    def _further(self, offset: Scalar, step: Scalar, node: ast.AST) -> Scalar:
        """The sum of two offsets, with its known part stored separately."""
        root = replace(step, code=step.root, const=None, root="", shift=0) if step.root else step
        total = self.arithmetic(ast.Add(), offset, root, node)
        if step.root:
            total = self.arithmetic(ast.Add(), total, literal(step.shift, "i32"), node)
        assert isinstance(total, Scalar)
        return total

    # ---- reading -------------------------------------------------------------------------------------

    def load(self, array: Array) -> Value:
        """An element."""
        if is_struct(array.dtype):
            return self._load_struct(array)
        if is_vector(array.dtype):
            n = array.dtype._length_
            return Vector(tuple(self._load(array, n, k) for k in range(n)))
        return self._load(array, 1, 0)

    def _load(self, array: Array, size: int, component: int) -> Scalar:
        kind, offset = self._kind(array.dtype), array.offset or ZERO
        if array.lanes_inside and not offset.varying:
            return self.temporary(kind, f"(({PACK[kind]}u*){array.name})[{offset.code}]", True)
        if not offset.varying:
            place = f"{size} * {offset.code} + {component}" if size > 1 else offset.code
            return self.temporary(kind, f"{array.name}[{place}]", False)
        if offset.lane and size == 1 and not array.lanes_inside:
            return self.temporary(kind, f"*({PACK[kind]}u*)({array.name} + {offset.code}[0])", True)
        if array.spare and size == 1 and not array.lanes_inside:
            mask = "everywhere" if self.mask is None else self.mask
            return self.temporary(kind, f"op::gather({array.name}, {self._harmless(offset)}, {mask})", True)
        name = self.name("g")
        self.emit(f"{PACK[kind]} {name};")
        self.emit(f"for (int l = 0; l < W; ++l) {name}[l] = {self._element(array, size, component)};")
        return Scalar(kind, name, True)

    def _harmless(self, offset: Scalar) -> str:
        """A varying offset; 0 in idle lanes."""
        if self.mask is None:
            return offset.code
        return self.select(Scalar("bool", self.mask, True), offset, ZERO).code

    def _element(self, array: Array, size: int, component: int, *, write: bool = False) -> str:
        """The element of lane l. Idle lanes read a valid element."""
        offset = array.offset or ZERO
        root, shift = offset.root or offset.code, offset.shift if offset.root else 0
        if self.mask is not None and not write:
            zero = ZERO if shift >= 0 else literal(-shift, "i32")
            root = self.select(Scalar("bool", self.mask, True), Scalar("i32", root, True), zero).code
        where = f"(long long){root}[l]" + (f" + {shift}" if shift else "")
        if array.lanes_inside:  # a row is a pack
            where = f"({where}) * W + l"
        elif size > 1:
            where = f"({where}) * {size} + {component}"
        return f"{array.name}[{where}]"

    def _load_struct(self, array: Array) -> Struct:
        offset = array.offset or ZERO
        name = self.name("s")
        if not offset.varying:
            self.emit(f"const auto& {name} = {array.name}[{offset.code}];")
            return Struct(array.dtype, name)
        fields: dict[str, Value] = {}
        for member, variable in array.dtype.vars.items():
            dtype = variable.type
            length = dtype._length_ if is_vector(dtype) else 0
            items = []
            for k in range(max(length, 1)):
                pack, kind = self.name("f"), self._kind(dtype)
                source = f"{self._element(array, 1, 0)}.{member}{f'.c[{k}]' if length else ''}"
                self.emit(f"{PACK[kind]} {pack};")
                self.emit(f"for (int l = 0; l < W; ++l) {pack}[l] = {source};")
                items.append(Scalar(kind, pack, True))
            fields[member] = Vector(tuple(items)) if length else items[0]
        return Struct(array.dtype, fields=fields)

    # ---- writing -------------------------------------------------------------------------------------

    def store(self, array: Array, value: Value, node: ast.AST) -> None:
        """Write an element in the active lanes."""
        if not isinstance(value, Scalar):
            raise self.refuse(node, "one number is written at a time")
        if is_struct(array.dtype) or is_vector(array.dtype) or array.given < array.ndim:
            raise self.refuse(node, "one number is written at a time")
        kind, offset = kind_of(array.dtype), array.offset or ZERO
        self.written.add(array.name)
        if value.kind != kind:
            raise self.refuse(node, f"a {kind} is wanted, this is a {value.kind}")
        if array.lanes_inside and not offset.varying:
            place = f"(({PACK[kind]}u*){array.name})[{offset.code}]"
            new = self.pack(value)
            self.emit(f"{place} = {new if self.mask is None else f'op::sel({self.mask}, {new}, {place})'};")
        elif not offset.varying:
            if value.varying:
                raise self.refuse(node, "lanes would write different values to one place")
            self.emit(f"{array.name}[{offset.code}] = {value.code};")
        elif offset.lane and not array.lanes_inside:
            new, place = self.pack(value), f"*({PACK[kind]}u*)({array.name} + {offset.code}[0])"
            if self.mask is None:
                self.emit(f"{place} = {new};")
            else:
                pack = self.temporary(kind, new, True).code
                self.emit(f"if (op::all({self.mask})) {place} = {pack};")
                one = f"{array.name}[(long long){offset.code}[0] + l] = {pack}[l]"
                self.emit(f"else for (int l = 0; l < W; ++l) if ({self.mask}[l]) {one};")
        else:
            condition = f"if ({self.mask}[l]) " if self.mask is not None else ""
            entry = f"{value.code}[l]" if value.varying else value.code
            target = self._element(array, 1, 0, write=True)
            self.emit(f"for (int l = 0; l < W; ++l) {condition}{target} = {entry};")

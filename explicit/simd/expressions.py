"""Translation of expressions of the scalar source to C++ over lanes: values, arithmetic, Warp's functions.

A *uniform* value is the same in every lane and is a plain C++ scalar. A *varying* value has one entry per
lane and is a C++ vector ("pack"). A Warp vector is represented by its components, a struct or an array by a
reference.
"""

import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite, isnan
from typing import Any, TypeAlias

import warp as wp

PACK = {"i32": "i32v", "f32": "f32v", "f64": "f64v", "bool": "mask"}
"""C++ type of a varying value of each kind."""
SCALAR = {"i32": "int", "f32": "float", "f64": "double", "bool": "bool"}
"""C++ type of a uniform value of each kind."""
KINDS = {wp.float32: "f32", wp.float64: "f64", wp.int32: "i32", int: "i32", float: "f32", wp.bool: "bool"}
"""Kind of each Warp scalar type."""


@dataclass(frozen=True)
class Scalar:
    """One number or truth value."""

    kind: str
    """ "i32", "f32", "f64" or "bool"."""
    code: str
    """C++ expression without side effects: a name or a literal."""
    varying: bool = False
    """Whether its value may differ between lanes."""
    const: int | bool | None = None
    """Its value if the translator knows it, otherwise None."""
    lane: bool = False
    """Whether it increases by one from lane to lane."""
    root: str = ""
    """For a varying integer that is another one plus a known number: name of the other one. Gathers share
    this name."""
    shift: int = 0
    """The known number."""

    @property
    def ctype(self) -> str:
        """C++ type."""
        return (PACK if self.varying else SCALAR)[self.kind]

    @property
    def is_float(self) -> bool:
        """True for a floating-point number."""
        return self.kind in ("f32", "f64")


@dataclass(frozen=True)
class Vector:
    """A Warp vector by its components."""

    items: tuple[Scalar, ...]
    """Components, all of one kind."""
    bank: str = ""
    """Name of the C++ array of the components, if they are partial sums over elements or nodes."""


@dataclass(frozen=True)
class Struct:
    """A Warp struct: a C++ reference if uniform, its loaded fields if varying."""

    type: Any
    code: str = ""
    """C++ name of a uniform struct."""
    fields: dict[str, "Value"] | None = None
    """Fields of a varying struct, each in packs."""


@dataclass(frozen=True)
class Array:
    """A Warp array. Some leading subscripts may already be known. Rows are contiguous."""

    name: str
    """C++ name of the pointer to its first element; ``{name}_s{k}`` is the stride of subscript k."""
    dtype: Any
    """Warp type of the elements."""
    ndim: int
    """Number of dimensions of the whole array."""
    given: int = 0
    """Number of known subscripts."""
    offset: Scalar | None = None
    """Number of elements from the first one to the part with the known subscripts."""
    scratch: bool = False
    """Whether it contains the rows of one pack only. The first subscript, the simulation, is then implied."""
    lanes_inside: bool = False
    """Whether the lanes of an entry of such an array are adjacent in memory."""
    spare: bool = False
    """Whether a read of a pack may begin at any of its entries."""
    header: Any = None
    """Loaded entries of a row, by subscript. They were loaded when the row was assigned to a name."""


@dataclass(frozen=True)
class PythonObject:
    """A Python object that the source refers to: a module, a type, a Warp function or a builtin."""

    thing: Any


Value: TypeAlias = Scalar | Vector | Struct | Array | PythonObject | tuple
"""Result of an expression. A tuple is the result of a function with several return values."""
Emit: TypeAlias = Callable[[str], None]


def kind_of(dtype: Any) -> str:
    """Kind of a Warp scalar type. Raises TypeError if it has none."""
    if dtype not in KINDS:
        raise TypeError(f"no SIMD kind for {dtype}; known: {sorted(set(KINDS.values()))}")
    return KINDS[dtype]


def is_vector(dtype: Any) -> bool:
    """True if a Warp type is a vector of fixed length."""
    return hasattr(dtype, "_length_") and hasattr(dtype, "_wp_scalar_type_")


def is_struct(dtype: Any) -> bool:
    """True if a Warp type is a struct."""
    return hasattr(dtype, "vars") and hasattr(dtype, "native_name")


def literal(value: int | float | bool, kind: str) -> Scalar:
    """A known number as a C++ literal."""
    if kind == "bool":
        return Scalar("bool", "true" if value else "false", const=bool(value))
    if kind == "i32":
        return Scalar("i32", f"({int(value)})", const=int(value))
    if not isfinite(value):
        sign, name = "-" if value < 0 else "", "nan" if isnan(value) else "inf"
        argument = '""' if name == "nan" else ""
        return Scalar(kind, f"({SCALAR[kind]})({sign}__builtin_{name}({argument}))")
    text = float(value).hex()
    return Scalar(kind, f"({text})" if kind == "f64" else f"({text}f)")


OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%"}
"""C++ operators of the binary operations."""
LANE_BY_LANE = {
    **dict.fromkeys(("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"), 1),
    **dict.fromkeys(("log2", "log10", "floor", "ceil", "round", "rint", "trunc"), 1),
    **dict.fromkeys(("pow", "atan2"), 2),
}
"""Warp functions that are called separately for each lane, and their numbers of arguments."""
CURES = {
    "%": "write x - y * wp.trunc(x / y)",
    "**": "write wp.pow(x, y) with real numbers of one kind",
    "select": "write wp.where(condition, if_true, if_false)",
}
"""Replacements of operators that are not defined over lanes, for error messages."""


class Arithmetic:
    """Emits one temporary for each operation. A product that is added becomes a fused multiply-add.

    The compiler must not fuse operations: all rounding is determined here. A sample then has the same bits in
    every pack.
    """

    lanes: int
    mask: str | None
    lines: list[str]
    sources: list[tuple[str, int]]
    """File and first line of the functions in translation, the innermost last."""

    def __init__(self) -> None:
        self.serial = 0
        self.sources = []

    # ---- emission ------------------------------------------------------------------------------------

    def emit(self, line: str) -> None:
        """Append a line of C++."""
        self.lines.append(line)

    def name(self, stem: str) -> str:
        """An unused C++ name."""
        self.serial += 1
        return f"{stem}_{self.serial}"

    def temporary(self, kind: str, code: str, varying: bool, *, lane: bool = False) -> Scalar:
        """Assign an expression to a new C++ name."""
        name = self.name("t")
        self.emit(f"const {(PACK if varying else SCALAR)[kind]} {name} = {code};")
        return Scalar(kind, name, varying, lane=lane)

    def pack(self, value: Scalar) -> str:
        """C++ expression of a value as a pack."""
        if value.varying:
            return value.code
        return f"op::to_mask({value.code})" if value.kind == "bool" else f"({PACK[value.kind]})({value.code})"

    def operand(self, value: Scalar, varying: bool) -> str:
        """C++ expression of a value, as a pack if `varying`."""
        return self.pack(value) if varying else value.code

    def select(self, mask: Scalar, yes: Scalar, no: Scalar) -> Scalar:
        """``yes`` where the mask is true, ``no`` elsewhere."""
        if not mask.varying and not yes.varying and not no.varying:
            return self.temporary(yes.kind, f"{mask.code} ? {yes.code} : {no.code}", False)
        code = f"op::sel({self.pack(mask)}, {self.pack(yes)}, {self.pack(no)})"
        return self.temporary(yes.kind, code, True)

    def refuse(self, node: ast.AST, why: str) -> TypeError:
        """An error with file and line of the source, the expression there, and why it cannot be
        translated."""
        line = getattr(node, "lineno", None)
        place = ""
        if self.sources and line is not None:
            file, first = self.sources[-1]
            place = f"{file}:{first + line - 1}: "
        return TypeError(f"{place}{ast.unparse(node)}: {why}")

    @classmethod
    def known_functions(cls) -> list[str]:
        """Names of the Warp functions that can be translated."""
        return sorted(name.removeprefix("wp_") for name in dir(cls) if name.startswith("wp_"))

    # ---- operations ----------------------------------------------------------------------------------

    def negated(self, value: Value) -> Value:
        """The negative of a number or vector."""
        if isinstance(value, Vector):
            return Vector(tuple(self.negated(item) for item in value.items))  # type: ignore[misc]
        assert isinstance(value, Scalar)
        if value.const is not None:
            return literal(-value.const, value.kind)
        return self.temporary(value.kind, f"-{value.code}", value.varying)

    def fused(self, a: Value, b: Value, base: Value, node: ast.AST, *, minus_product: bool = False) -> Value:
        """``base + a b`` or ``base - a b``, rounded once; component by component for vectors."""
        if isinstance(base, Vector):
            n = len(base.items)
            left_items = a.items if isinstance(a, Vector) else (a,) * n
            right_items = b.items if isinstance(b, Vector) else (b,) * n
            parts = zip(left_items, right_items, base.items, strict=True)
            items = tuple(self.fused(x, y, z, node, minus_product=minus_product) for x, y, z in parts)
            return Vector(items, "new" if base.bank else "")  # type: ignore[arg-type]
        if not all(isinstance(v, Scalar) and v.kind == base.kind for v in (a, b, base)):  # type: ignore[union-attr]
            raise self.refuse(node, "operands of one kind are wanted")
        assert isinstance(a, Scalar)
        assert isinstance(b, Scalar)
        assert isinstance(base, Scalar)
        if not a.is_float:
            product = self.arithmetic(ast.Mult(), a, b, ast.Constant(0))
            return self.arithmetic(ast.Sub() if minus_product else ast.Add(), base, product, ast.Constant(0))
        varying = a.varying or b.varying or base.varying
        x, y, z = (self.operand(v, varying) for v in (a, b, base))
        sign = "-" if minus_product else ""
        return self.temporary(a.kind, f"__builtin_elementwise_fma({sign}{x}, {y}, {z})", varying)

    def arithmetic(self, operator: ast.operator, left: Value, right: Value, node: ast.AST) -> Value:
        """One operation between two values."""
        if isinstance(left, Vector) or isinstance(right, Vector):
            n = len(left.items) if isinstance(left, Vector) else len(right.items)  # type: ignore[union-attr]
            a = left.items if isinstance(left, Vector) else (left,) * n
            b = right.items if isinstance(right, Vector) else (right,) * n
            bank = any(isinstance(side, Vector) and side.bank for side in (left, right))
            items = tuple(self.arithmetic(operator, x, y, node) for x, y in zip(a, b, strict=True))
            return Vector(items, "new" if bank else "")  # type: ignore[arg-type]
        if not isinstance(left, Scalar) or not isinstance(right, Scalar) or left.kind != right.kind:
            raise self.refuse(node, "operands of one kind are wanted")
        if isinstance(operator, ast.Pow) and left.is_float:
            return self.lane_by_lane("pow", left, right)
        if type(operator) not in OPERATORS or (isinstance(operator, ast.Mod) and left.kind != "i32"):
            cure = {ast.Mod: CURES["%"], ast.Pow: CURES["**"]}.get(type(operator), "write sums and products")
            raise self.refuse(node, f"no such operator over lanes; {cure}")
        if left.const is not None and right.const is not None and left.kind == "i32":
            folded = {"+": int.__add__, "-": int.__sub__, "*": int.__mul__}.get(OPERATORS[type(operator)])
            if folded is not None:
                return literal(folded(left.const, right.const), "i32")
        varying = left.varying or right.varying
        symbol = OPERATORS[type(operator)]
        if symbol in "/%" and right.varying and right.kind == "i32" and self.mask is not None:
            right = self.select(Scalar("bool", self.mask, True), right, literal(1, "i32"))  # idle lanes
        code = f"{self.operand(left, varying)} {symbol} {self.operand(right, varying)}"
        # The sum of a lane counter and a uniform number is a lane counter.
        lane = symbol == "+" and left.lane != right.lane and (left.varying != right.varying)
        result = self.temporary(left.kind, code, varying, lane=lane)
        for one, addend in ((left, right), (right, left)):
            if symbol == "+" and one.varying and one.kind == "i32" and addend.const is not None:
                return replace(result, root=one.root or one.code, shift=one.shift + addend.const)
        return result

    # ---- functions of Warp ---------------------------------------------------------------------------

    def wp_max(self, a: Scalar, b: Scalar) -> Scalar:
        """The larger of two numbers. If one is NaN, the other one, as in Warp and CUDA."""
        return self._extreme(">", a, b)

    def wp_min(self, a: Scalar, b: Scalar) -> Scalar:
        """The smaller of two numbers. If one is NaN, the other one, as in Warp and CUDA."""
        return self._extreme("<", a, b)

    def _extreme(self, sign: str, a: Scalar, b: Scalar) -> Scalar:
        varying = a.varying or b.varying
        x, y = self.operand(a, varying), self.operand(b, varying)
        extreme = self.temporary(a.kind, f"({x}) {sign} ({y}) ? ({x}) : ({y})", varying)
        if not a.is_float:
            return extreme
        return self.temporary(a.kind, f"({y}) == ({y}) ? {extreme.code} : ({x})", varying)

    def wp_clamp(self, x: Scalar, low: Scalar, high: Scalar) -> Scalar:
        """The number limited to two bounds."""
        return self.wp_min(self.wp_max(x, low), high)

    def wp_abs(self, x: Scalar) -> Scalar:
        """Absolute value."""
        return self.temporary(x.kind, f"__builtin_elementwise_abs({x.code})", x.varying)

    def wp_sqrt(self, x: Scalar) -> Scalar:
        """Square root."""
        return self.temporary(x.kind, f"__builtin_elementwise_sqrt({x.code})", x.varying)

    def wp_sign(self, x: Scalar) -> Scalar:
        """-1 where negative, else 1."""
        zero, one, minus = (literal(v, x.kind) for v in (0, 1, -1))
        if not x.varying:
            return self.temporary(x.kind, f"{x.code} < {zero.code} ? {minus.code} : {one.code}", False)
        code = f"{x.code} < {self.pack(zero)} ? {self.pack(minus)} : {self.pack(one)}"
        return self.temporary(x.kind, code, True)

    def wp_cbrt(self, x: Scalar) -> Scalar:
        """Cube root."""
        return self._of_packs("root", x)

    def wp_exp(self, x: Scalar) -> Scalar:
        """e to the power of a number."""
        return self._of_packs("power", x)

    def wp_log(self, x: Scalar) -> Scalar:
        """Natural logarithm."""
        return self._of_packs("logarithm", x)

    def _of_packs(self, name: str, x: Scalar) -> Scalar:
        """A function that is defined for packs; a uniform number gives the same bits."""
        code = f"op::{name}({self.pack(x)})"
        return self.temporary(x.kind, code if x.varying else f"{code}[0]", x.varying)

    def lane_by_lane(self, name: str, *numbers: Scalar) -> Scalar:
        """A Warp function of real numbers, called for each lane. The bits are those of the scalar source."""
        if not all(x.is_float for x in numbers):
            raise self.refuse(ast.Name(f"wp.{name}"), "real numbers are wanted")
        kind = numbers[0].kind
        if not any(x.varying for x in numbers):
            return self.temporary(kind, f"wp::{name}({', '.join(x.code for x in numbers)})", False)
        result = self.name("t")
        entries = ", ".join(f"{x.code}[l]" if x.varying else x.code for x in numbers)
        self.emit(f"{PACK[kind]} {result};")
        self.emit(f"for (int l = 0; l < W; ++l) {result}[l] = wp::{name}({entries});")
        return Scalar(kind, result, True)

    def wp_where(self, condition: Scalar, yes: Scalar, no: Scalar) -> Scalar:
        """The first value where a condition is true, the second one elsewhere."""
        return self.select(condition, yes, no)

    def wp_isnan(self, x: Scalar) -> Scalar:
        """True where the value is NaN."""
        if not x.varying:
            return self.temporary("bool", f"{x.code} != {x.code}", False)
        whole = "i64v" if x.kind == "f64" else "i32v"
        return self.temporary("bool", f"op::to_mask(({whole})({x.code} != {x.code}))", True)

    def wp_isfinite(self, x: Scalar) -> Scalar:
        """True where the value is neither infinite nor NaN."""
        difference = self.temporary(x.kind, f"{x.code} - {x.code}", x.varying)
        if not x.varying:
            return self.temporary("bool", f"{difference.code} == 0", False)
        whole = "i64v" if x.kind == "f64" else "i32v"
        zero = self.pack(literal(0, x.kind))
        return self.temporary("bool", f"op::to_mask(({whole})({difference.code} == {zero}))", True)

    def wp_dot(self, a: Vector, b: Vector) -> Value:
        """Scalar product, summed from the first component."""
        total: Value = self.arithmetic(ast.Mult(), a.items[0], b.items[0], ast.Constant(0))
        for x, y in zip(a.items[1:], b.items[1:], strict=True):
            total = self.fused(x, y, total, ast.Name("dot"))
        return total

    def wp_block_dim(self) -> Scalar:
        """Number of lanes of one simulation; provided by the mapping."""
        raise NotImplementedError


def _function(name: str, count: int) -> Callable[..., Scalar]:
    def unary(self: Arithmetic, x: Scalar) -> Scalar:
        return self.lane_by_lane(name, x)

    def binary(self: Arithmetic, x: Scalar, y: Scalar) -> Scalar:
        return self.lane_by_lane(name, x, y)

    return binary if count == 2 else unary


for _name, _count in LANE_BY_LANE.items():
    setattr(Arithmetic, f"wp_{_name}", _function(_name, _count))


COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
"""C++ operators of the comparisons."""


class Expressions(Arithmetic):
    """Translates the expressions of a syntax tree to values and emits the C++ that computes them."""

    def expression(self, node: ast.expr) -> Value:
        """Translate any expression."""
        method = getattr(self, "_" + type(node).__name__.lower(), None)
        if method is None:
            why = f"{type(node).__name__} has no meaning over lanes"
            if isinstance(node, ast.IfExp):
                why += "; write wp.where(condition, if_true, if_false)"
            raise self.refuse(node, why)
        return method(node)  # type: ignore[no-any-return]

    def scalar(self, node: ast.expr) -> Scalar:
        """Translate an expression; raises TypeError unless it is one number."""
        value = self.expression(node)
        if not isinstance(value, Scalar):
            raise self.refuse(node, "a number is wanted here")
        return value

    def truth(self, node: ast.expr) -> Scalar:
        """Translate an expression to a truth value."""
        value = self.scalar(node)
        if value.kind != "bool":
            raise self.refuse(node, "a truth value is wanted here")
        return value

    def lookup(self, name: str) -> Value:
        """The value of a name; implemented by `explicit.simd.statements`."""
        raise NotImplementedError

    def call(self, thing: Any, arguments: Sequence[Value], node: ast.Call) -> Value:
        """The value of a call of a Warp function; implemented by `explicit.simd.statements`."""
        raise NotImplementedError

    # ---- leaves --------------------------------------------------------------------------------------

    def known(self, thing: Any) -> Value:
        """A Python object of the function's globals or closure as a value."""
        if isinstance(thing, bool):
            return literal(thing, "bool")
        if isinstance(thing, int):
            return literal(thing, "i32")
        if isinstance(thing, (wp.float32, wp.float64, wp.int32)):
            return literal(thing.value, kind_of(type(thing)))
        return PythonObject(thing)

    def _constant(self, node: ast.Constant) -> Value:
        if isinstance(node.value, float):
            return literal(node.value, "f32")
        return self.known(node.value)

    def _name(self, node: ast.Name) -> Value:
        return self.lookup(node.id)

    def _tuple(self, node: ast.Tuple) -> Value:
        return tuple(self.expression(item) for item in node.elts)

    def _attribute(self, node: ast.Attribute) -> Value:
        owner = self.expression(node.value)
        if isinstance(owner, PythonObject):
            if owner.thing is wp and hasattr(self, f"wp_{node.attr}"):
                return PythonObject(getattr(self, f"wp_{node.attr}"))
            return self.known(getattr(owner.thing, node.attr))
        if not isinstance(owner, Struct):
            if isinstance(owner, Array) and node.attr == "shape":
                return PythonObject(owner)
            raise self.refuse(node, "only structs have fields")
        if owner.fields is not None:
            return owner.fields[node.attr]
        return self.member(owner, node.attr)

    def member(self, owner: Struct, field: str) -> Value:
        """A field of a uniform struct."""
        return self._read(owner.type.vars[field].type, f"{owner.code}.{field}", owner)

    def _read(self, dtype: Any, code: str, owner: Struct) -> Value:
        if isinstance(dtype, wp.array):
            return self.struct_array(dtype, code, owner)
        if is_vector(dtype):
            kind = kind_of(dtype._wp_scalar_type_)
            return Vector(tuple(self.temporary(kind, f"{code}.c[{k}]", False) for k in range(dtype._length_)))
        return self.temporary(kind_of(dtype), code, False)

    def struct_array(self, dtype: Any, code: str, owner: Struct) -> Array:
        """An array that is a field of a struct; implemented by `explicit.simd.memory`."""
        raise NotImplementedError

    lanes_inside = False
    """Whether the entries of the state are packs with one simulation in each lane."""

    # ---- arithmetic ----------------------------------------------------------------------------------

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        value = self.expression(node.operand)
        if isinstance(node.op, ast.Not):
            if not isinstance(value, Scalar) or value.kind != "bool":
                raise self.refuse(node, "a truth value is wanted here")
            return self.temporary(
                "bool", f"~{value.code}" if value.varying else f"!{value.code}", value.varying
            )
        if isinstance(node.op, ast.USub):
            return self.negated(value)
        raise self.refuse(node, "no such operator over lanes")

    def _binop(self, node: ast.BinOp) -> Value:
        return self.sum_or_product(node.op, node.left, node.right, node)

    def sum_or_product(
        self, operator: ast.operator, left: "ast.expr | Value", right: ast.expr, node: ast.AST
    ) -> Value:
        """A binary operation; in an augmented assignment the left operand is already a value."""
        if isinstance(operator, (ast.Add, ast.Sub)):
            minus = isinstance(operator, ast.Sub)
            factors = self._factors(right)
            if factors is not None:
                base = self.expression(left) if isinstance(left, ast.expr) else left
                a, b = (self.expression(factor) for factor in factors)
                return self.fused(a, b, base, node, minus_product=minus)
            factors = self._factors(left) if isinstance(left, ast.expr) else None
            if factors is not None:
                a, b = (self.expression(factor) for factor in factors)
                base = self.expression(right)
                return self.fused(a, b, self.negated(base) if minus else base, node)
        first = self.expression(left) if isinstance(left, ast.expr) else left
        return self.arithmetic(operator, first, self.expression(right), node)

    @staticmethod
    def _factors(node: ast.expr) -> tuple[ast.expr, ast.expr] | None:
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            return node.left, node.right
        return None

    # ---- truth ---------------------------------------------------------------------------------------

    def _compare(self, node: ast.Compare) -> Value:
        if len(node.ops) != 1 or type(node.ops[0]) not in COMPARISONS:
            raise self.refuse(node, "one comparison of numbers at a time")
        left, right = self.scalar(node.left), self.scalar(node.comparators[0])
        if left.kind != right.kind:
            raise self.refuse(node, "operands of one kind are wanted")
        symbol = COMPARISONS[type(node.ops[0])]
        if left.const is not None and right.const is not None:
            return literal(bool(eval(f"{left.const} {symbol} {right.const}")), "bool")  # two integers
        varying = left.varying or right.varying
        code = f"{self.operand(left, varying)} {symbol} {self.operand(right, varying)}"
        if not varying:
            return self.temporary("bool", code, False)
        whole = {"i32": "i32v", "f32": "i32v", "f64": "i64v", "bool": "mask"}[left.kind]
        return self.temporary("bool", f"op::to_mask(({whole})({code}))", True)

    def _boolop(self, node: ast.BoolOp) -> Value:
        conjunction = isinstance(node.op, ast.And)
        value = self.truth(node.values[0])
        for following in node.values[1:]:
            value = self._and_then(value, following, conjunction)
        return value

    def _and_then(self, first: Scalar, node: ast.expr, conjunction: bool) -> Scalar:
        """`and` or `or`. The second operand is evaluated only where the first one does not determine the
        result."""
        if first.const is not None:
            return self.truth(node) if first.const == conjunction else first
        if first.varying and _is_harmless(node):
            also = self.pack(self.truth(node))
            return self.temporary("bool", f"{first.code} {'&' if conjunction else '|'} {also}", True)
        result = self.name("both" if conjunction else "either")
        if not first.varying:
            start, outer = len(self.lines), self.lines
            self.lines = []
            second = self.truth(node)
            inner, self.lines = self.lines, outer
            ctype = "mask" if second.varying else "bool"
            decided, guard = literal(not conjunction, "bool"), first.code if conjunction else f"!{first.code}"
            default = self.operand(decided, second.varying)
            self.lines[start:] = [f"{ctype} {result} = {default};", f"if ({guard}) {{", *inner]
            self.emit(f"{result} = {second.code};")
            self.emit("}")
            return Scalar("bool", result, second.varying)
        before, undecided = self.mask, self.name("open")
        guard = first.code if conjunction else f"~{first.code}"
        self.emit(f"const mask {undecided} = {guard if before is None else f'{guard} & {before}'};")
        self.emit(f"mask {result} = {undecided if conjunction else first.code};")
        self.mask = undecided
        self.emit(f"if (op::any({undecided})) {{")
        second = self.truth(node)
        further = f"{undecided} & {self.pack(second)}"
        self.emit(f"{result} = {further if conjunction else f'{first.code} | ({further})'};")
        self.emit("}")
        self.mask = before
        return Scalar("bool", result, True)

    # ---- calls ---------------------------------------------------------------------------------------

    def _call(self, node: ast.Call) -> Value:
        function = self.expression(node.func)
        if not isinstance(function, PythonObject):
            raise self.refuse(node, "not a function")
        if node.keywords:
            raise self.refuse(node, "arguments by position are wanted")
        arguments = [self.expression(argument) for argument in node.args]
        thing = function.thing
        if is_struct(thing):
            return Struct(thing, fields=dict(zip(thing.vars, arguments, strict=True)))
        if isinstance(thing, type):
            return self.convert(thing, arguments, node)
        if getattr(thing, "__self__", None) is self:
            expected = Vector if thing.__name__ == "wp_dot" else Scalar
            count = thing.__func__.__code__.co_argcount - 1
            if len(arguments) != count or not all(isinstance(a, expected) for a in arguments):
                raise self.refuse(node, f"{count} numbers are wanted, or vectors by dot")
            alike = arguments
            if thing.__name__ == "wp_where":
                if arguments[0].kind != "bool":  # type: ignore[union-attr]
                    raise self.refuse(node, "a truth value comes first")
                alike = arguments[1:]
            if len({a.kind for a in alike if isinstance(a, Scalar)}) > 1:
                raise self.refuse(node, "operands of one kind are wanted")
            return thing(*arguments)  # type: ignore[no-any-return]
        return self.call(thing, arguments, node)

    def convert(self, dtype: Any, arguments: Sequence[Value], node: ast.AST) -> Value:
        """A conversion of a number, or a vector from its components."""
        if is_vector(dtype):
            kind = kind_of(dtype._wp_scalar_type_)
            if not arguments:
                return Vector((literal(0, kind),) * dtype._length_)
            items = arguments[0].items if isinstance(arguments[0], Vector) else tuple(arguments)
            if len(items) == 1:
                items *= dtype._length_
            right = all(isinstance(item, Scalar) and item.kind == kind for item in items)
            if len(items) != dtype._length_ or not right:
                raise self.refuse(node, f"{dtype._length_} numbers {kind} are wanted")
            return Vector(items)  # type: ignore[arg-type]
        value = arguments[0] if len(arguments) == 1 else None
        if not isinstance(value, Scalar) or dtype not in KINDS:
            raise self.refuse(node, "a number becomes a number of another kind")
        kind = kind_of(dtype)
        if value.kind == kind:
            return value
        if value.const is not None:
            return literal(value.const, kind)
        if value.varying and kind == "bool":
            whole = "i64v" if value.kind == "f64" else "i32v"
            zero = self.pack(literal(0, value.kind))
            return self.temporary(kind, f"op::to_mask(({whole})({value.code} != {zero}))", True)
        if value.varying:
            one = " & 1" if value.kind == "bool" else ""  # a lane of a mask is 0 or -1
            return self.temporary(kind, f"__builtin_convertvector({value.code}{one}, {PACK[kind]})", True)
        return self.temporary(kind, f"({SCALAR[kind]})({value.code})", False)


def _is_harmless(node: ast.expr) -> bool:
    """True if an expression may be evaluated in all lanes, also where it is not needed: sums, products,
    comparisons."""
    plain = (
        ast.Compare, ast.BinOp, ast.UnaryOp, ast.Name, ast.Constant,
        ast.cmpop, ast.Add, ast.Sub, ast.Mult, ast.unaryop, ast.expr_context,
    )  # fmt: skip
    return all(isinstance(part, plain) for part in ast.walk(node))

"""Numbers over lanes: operations between values, and the functions of Warp that the source uses."""

import ast
from collections.abc import Callable
from dataclasses import replace

from explicit.simd.values import (
    PACK,
    SCALAR,
    Scalar,
    Value,
    Vector,
    literal,
)

OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%"}
"""C++ signs of the binary operations."""
LANE_BY_LANE = {
    **dict.fromkeys(("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"), 1),
    **dict.fromkeys(("log2", "log10", "floor", "ceil", "round", "rint", "trunc"), 1),
    **dict.fromkeys(("pow", "atan2"), 2),
}
"""Functions of Warp that are called for one lane after the other, and how many numbers each takes."""
CURES = {
    "%": "write x - y * wp.trunc(x / y)",
    "**": "write wp.pow(x, y) with real numbers of one kind",
    "select": "write wp.where(condition, if_true, if_false)",
}
"""What may be written instead of some that have no meaning over lanes."""


class Arithmetic:
    """Emits one temporary an operation; a product that is added becomes a fused multiply-add.

    The compiler is told to fuse nothing by itself, so what is rounded is decided here alone and a sample
    gives the same bits whatever shares its pack.
    """

    lanes: int
    mask: str | None
    lines: list[str]
    sources: list[tuple[str, int]]
    """File and first line of the functions that are being translated, the innermost last."""

    def __init__(self) -> None:
        self.serial = 0
        self.sources = []

    # ---- emission ------------------------------------------------------------------------------------

    def emit(self, line: str) -> None:
        """Append a line of C++."""
        self.lines.append(line)

    def name(self, stem: str) -> str:
        """A fresh C++ name."""
        self.serial += 1
        return f"{stem}_{self.serial}"

    def temporary(self, kind: str, code: str, varying: bool, *, lane: bool = False) -> Scalar:
        """Name the value of an expression."""
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
        """``yes`` where the mask holds, ``no`` elsewhere."""
        if not mask.varying and not yes.varying and not no.varying:
            return self.temporary(yes.kind, f"{mask.code} ? {yes.code} : {no.code}", False)
        code = f"op::sel({self.pack(mask)}, {self.pack(yes)}, {self.pack(no)})"
        return self.temporary(yes.kind, code, True)

    def refuse(self, node: ast.AST, why: str) -> TypeError:
        """An error that names the source: file, line, what stands there, and why it cannot be translated."""
        line = getattr(node, "lineno", None)
        place = ""
        if self.sources and line is not None:
            file, first = self.sources[-1]
            place = f"{file}:{first + line - 1}: "
        return TypeError(f"{place}{ast.unparse(node)}: {why}")

    @classmethod
    def known_functions(cls) -> list[str]:
        """Names of the functions of Warp that have a meaning over lanes."""
        return sorted(name.removeprefix("wp_") for name in dir(cls) if name.startswith("wp_"))

    # ---- operations ----------------------------------------------------------------------------------

    def negated(self, value: Value) -> Value:
        """Minus a number or vector."""
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
            left = a.items if isinstance(a, Vector) else (a,) * n
            right = b.items if isinstance(b, Vector) else (b,) * n
            parts = zip(left, right, base.items, strict=True)
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
        # Adding anything uniform keeps the lanes in step.
        lane = symbol == "+" and left.lane != right.lane and (left.varying != right.varying)
        result = self.temporary(left.kind, code, varying, lane=lane)
        for one, other in ((left, right), (right, left)):
            if symbol == "+" and one.varying and one.kind == "i32" and other.const is not None:
                return replace(result, root=one.root or one.code, shift=one.shift + other.const)
        return result

    # ---- functions of Warp ---------------------------------------------------------------------------

    def wp_max(self, a: Scalar, b: Scalar) -> Scalar:
        """The larger; the other where one is not a number, as Warp and CUDA have it."""
        return self._extreme(">", a, b)

    def wp_min(self, a: Scalar, b: Scalar) -> Scalar:
        """The smaller; the other where one is not a number, as Warp and CUDA have it."""
        return self._extreme("<", a, b)

    def _extreme(self, sign: str, a: Scalar, b: Scalar) -> Scalar:
        varying = a.varying or b.varying
        x, y = self.operand(a, varying), self.operand(b, varying)
        found = self.temporary(a.kind, f"({x}) {sign} ({y}) ? ({x}) : ({y})", varying)
        if not a.is_float:
            return found
        return self.temporary(a.kind, f"({y}) == ({y}) ? {found.code} : ({x})", varying)

    def wp_clamp(self, x: Scalar, low: Scalar, high: Scalar) -> Scalar:
        """Between two bounds."""
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
        """A function that is written for packs; of a uniform number it has the same bits."""
        code = f"op::{name}({self.pack(x)})"
        return self.temporary(x.kind, code if x.varying else f"{code}[0]", x.varying)

    def lane_by_lane(self, name: str, *numbers: Scalar) -> Scalar:
        """A function of Warp of real numbers, with the bits that it has of each."""
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
        """The first where a condition holds, the second elsewhere."""
        return self.select(condition, yes, no)

    def wp_isnan(self, x: Scalar) -> Scalar:
        """True where it is not a number."""
        if not x.varying:
            return self.temporary("bool", f"{x.code} != {x.code}", False)
        whole = "i64v" if x.kind == "f64" else "i32v"
        return self.temporary("bool", f"op::to_mask(({whole})({x.code} != {x.code}))", True)

    def wp_isfinite(self, x: Scalar) -> Scalar:
        """True where a number is neither infinite nor not a number."""
        difference = self.temporary(x.kind, f"{x.code} - {x.code}", x.varying)
        if not x.varying:
            return self.temporary("bool", f"{difference.code} == 0", False)
        whole = "i64v" if x.kind == "f64" else "i32v"
        zero = self.pack(literal(0, x.kind))
        return self.temporary("bool", f"op::to_mask(({whole})({difference.code} == {zero}))", True)

    def wp_dot(self, a: Vector, b: Vector) -> Value:
        """Scalar product, from the first component on."""
        total: Value = self.arithmetic(ast.Mult(), a.items[0], b.items[0], ast.Constant(0))
        for x, y in zip(a.items[1:], b.items[1:], strict=True):
            total = self.fused(x, y, total, ast.Name("dot"))
        return total

    def wp_block_dim(self) -> Scalar:
        """Lanes of one simulation; provided by the mapping."""
        raise NotImplementedError


def _function(name: str, count: int) -> Callable[..., Scalar]:
    def unary(self: Arithmetic, x: Scalar) -> Scalar:
        return self.lane_by_lane(name, x)

    def binary(self: Arithmetic, x: Scalar, y: Scalar) -> Scalar:
        return self.lane_by_lane(name, x, y)

    return binary if count == 2 else unary


for _name, _count in LANE_BY_LANE.items():
    setattr(Arithmetic, f"wp_{_name}", _function(_name, _count))

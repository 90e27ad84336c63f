"""Expressions of the scalar source as C++ over lanes."""

import ast
from collections.abc import Sequence
from typing import Any

import warp as wp

from explicit.simd.arithmetic import Arithmetic
from explicit.simd.values import (
    KINDS,
    PACK,
    SCALAR,
    Array,
    Known,
    Scalar,
    Struct,
    Value,
    Vector,
    is_struct,
    is_vector,
    kind_of,
    literal,
)

COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
"""C++ signs of the comparisons."""


class Expressions(Arithmetic):
    """Translates a syntax tree's expressions to values, emitting what computes them."""

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
        """Translate an expression that must be one number."""
        value = self.expression(node)
        if not isinstance(value, Scalar):
            raise self.refuse(node, "a number is wanted here")
        return value

    def truth(self, node: ast.expr) -> Scalar:
        """Translate an expression that must be true or false."""
        value = self.scalar(node)
        if value.kind != "bool":
            raise self.refuse(node, "a truth value is wanted here")
        return value

    def lookup(self, name: str) -> Value:
        """The value of a name; provided by the statements."""
        raise NotImplementedError

    def call(self, thing: Any, arguments: Sequence[Value], node: ast.Call) -> Value:
        """The value of a call to a Warp function; provided by the statements."""
        raise NotImplementedError

    # ---- leaves --------------------------------------------------------------------------------------

    def known(self, thing: Any) -> Value:
        """A Python object from the source's surroundings as a value."""
        if isinstance(thing, bool):
            return literal(thing, "bool")
        if isinstance(thing, int):
            return literal(thing, "i32")
        if isinstance(thing, (wp.float32, wp.float64, wp.int32)):
            return literal(thing.value, kind_of(type(thing)))
        return Known(thing)

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
        if isinstance(owner, Known):
            if owner.thing is wp and hasattr(self, f"wp_{node.attr}"):
                return Known(getattr(self, f"wp_{node.attr}"))
            return self.known(getattr(owner.thing, node.attr))
        if not isinstance(owner, Struct):
            if isinstance(owner, Array) and node.attr == "shape":
                return Known(owner)
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
        """An array that is a field of a struct; provided by the memory."""
        raise NotImplementedError

    lanes_inside = False
    """Whether the state's entries are packs, a simulation a lane."""

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
        """A binary operation; the left operand may be a value already (augmented assignment)."""
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
        both = isinstance(node.op, ast.And)
        value = self.truth(node.values[0])
        for following in node.values[1:]:
            value = self._and_then(value, following, both)
        return value

    def _and_then(self, first: Scalar, node: ast.expr, both: bool) -> Scalar:
        """The second is evaluated only where the first leaves it open: where it holds, or for `or` fails."""
        if first.const is not None:
            return self.truth(node) if first.const == both else first
        if first.varying and _is_harmless(node):
            also = self.pack(self.truth(node))
            return self.temporary("bool", f"{first.code} {'&' if both else '|'} {also}", True)
        result = self.name("both" if both else "either")
        if not first.varying:
            start, outer = len(self.lines), self.lines
            self.lines = []
            second = self.truth(node)
            inner, self.lines = self.lines, outer
            ctype = "mask" if second.varying else "bool"
            decided, held = literal(not both, "bool"), first.code if both else f"!{first.code}"
            default = self.operand(decided, second.varying)
            self.lines[start:] = [f"{ctype} {result} = {default};", f"if ({held}) {{", *inner]
            self.emit(f"{result} = {second.code};")
            self.emit("}")
            return Scalar("bool", result, second.varying)
        before, undecided = self.mask, self.name("open")
        held = first.code if both else f"~{first.code}"
        self.emit(f"const mask {undecided} = {held if before is None else f'{held} & {before}'};")
        self.emit(f"mask {result} = {undecided if both else first.code};")
        self.mask = undecided
        self.emit(f"if (op::any({undecided})) {{")
        second = self.truth(node)
        further = f"{undecided} & {self.pack(second)}"
        self.emit(f"{result} = {further if both else f'{first.code} | ({further})'};")
        self.emit("}")
        self.mask = before
        return Scalar("bool", result, True)

    # ---- calls ---------------------------------------------------------------------------------------

    def _call(self, node: ast.Call) -> Value:
        function = self.expression(node.func)
        if not isinstance(function, Known):
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
            wanted = Vector if thing.__name__ == "wp_dot" else Scalar
            count = thing.__func__.__code__.co_argcount - 1
            if len(arguments) != count or not all(isinstance(a, wanted) for a in arguments):
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
    """True if an expression may be evaluated where nobody asked for it: sums, products and comparisons."""
    plain = (
        ast.Compare, ast.BinOp, ast.UnaryOp, ast.Name, ast.Constant,
        ast.cmpop, ast.Add, ast.Sub, ast.Mult, ast.unaryop, ast.expr_context,
    )  # fmt: skip
    return all(isinstance(part, plain) for part in ast.walk(node))

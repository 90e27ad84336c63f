"""Translation of statements of the scalar source over lanes: inlined functions, assignments, branches, loops.

The input is the syntax tree of a Warp function. The output is lines of C++ over packs. Where lanes disagree
on a branch or a loop, a mask marks the active lanes.
"""

import ast
import inspect
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import warp as wp

from explicit.simd.expressions import (
    CURES,
    PACK,
    SCALAR,
    Array,
    PythonObject,
    Scalar,
    Struct,
    Value,
    Vector,
    literal,
)
from explicit.simd.memory import LOOKED_UP, Loop, Memory, divided

Path = tuple[str, ...]


@dataclass
class Variable:
    """A variable of the source: one C++ variable for each component."""

    names: tuple[str, ...]
    kind: str
    varying: bool
    birth: Path
    vector: bool
    key: str
    bank: str = ""
    lane: bool = False


@cache
def source_of(function: Any) -> ast.FunctionDef:
    """The syntax tree of a function."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    return tree


class Statements(Memory):
    """Translates statements. Functions are inlined. A branch on which the lanes disagree runs under a mask.

    A variable that is assigned with only some active lanes must be varying. This can make other variables
    varying. `translate` repeats the translation until no variable changes.
    """

    own: frozenset[str] = frozenset()
    """Names of the lane functions that the mapping defines."""

    def __init__(self, lanes: int) -> None:
        super().__init__()
        self.lanes = lanes
        self.varying_names: set[str] = set()
        self.out_of_step: set[str] = set()
        self.row_headers: dict[str, set[int]] = {}
        self.outliving: set[str] = set()
        self.written: set[str] = set()
        self.lane_loops: dict[str, Variable] = {}

    def translate(self, function: Any, arguments: dict[str, Value]) -> str:
        """Translate a function without result. The translation is repeated until the kinds of its variables
        are stable."""
        sizes: tuple[int, ...] = ()
        while sizes != self._known_so_far():
            sizes = self._known_so_far()
            self.serial, self.instances, self.masks = 0, 0, 0
            self.lane_loops.clear()
            self.lines: list[str] = []
            self.declared: dict[str, str] = {}
            self.arrays: dict[str, str] = {}
            self.mask: str | None = None
            self.path: Path = ()
            self.scopes: list[dict[str, Value | Variable]] = []
            self.surroundings: list[dict[str, Any]] = []
            self.instance_names: list[str] = []
            self.sources: list[tuple[str, int]] = []
            self.function(function, list(arguments.values()))
        declarations = list(self.arrays.values())
        declarations += [f"{ctype} {name} = ({ctype})(0);" for name, ctype in self.declared.items()]
        return "\n".join([*declarations, *self.lines])

    def _known_so_far(self) -> tuple[int, ...]:
        notes = (self.varying_names, self.out_of_step, self.outliving, self.written)
        return (*map(len, notes), sum(map(len, self.row_headers.values())))

    # ---- functions -----------------------------------------------------------------------------------

    def function(self, function: Any, arguments: Sequence[Value]) -> Value | None:
        """Inline the body of a function and return its result."""
        tree = source_of(function)
        closure = inspect.getclosurevars(function)
        self.instances += 1
        self.instance_names.append(f"{tree.name}{self.instances}")
        self.surroundings.append({**closure.builtins, **closure.globals, **closure.nonlocals})
        self.scopes.append({})
        self.sources.append((inspect.getsourcefile(function) or "?", function.__code__.co_firstlineno))
        for parameter, value in zip(tree.args.args, arguments, strict=True):
            self.assign_name(parameter.arg, value, parameter)
        last = tree.body[-1]
        returned = last.value if isinstance(last, ast.Return) else None
        self.block(tree.body[:-1] if isinstance(last, ast.Return) else tree.body)
        result = None if returned is None else self.expression(returned)
        self.scopes.pop()
        self.surroundings.pop()
        self.instance_names.pop()
        self.sources.pop()
        return result

    def call(self, thing: Any, arguments: Sequence[Value], node: ast.Call) -> Value:
        """Inline a Warp function."""
        if not isinstance(thing, wp.Function) or thing.is_builtin():
            raise self.refuse(node, self._no_meaning(thing))
        name = thing.func.__name__ if thing.func is not None else ""
        if thing.native_snippet is not None or name in self.own:
            return self.together(name, arguments, node)
        result = self.function(thing.func, arguments)
        return PythonObject(None) if result is None else result

    def _no_meaning(self, thing: Any) -> str:
        if not isinstance(thing, wp.Function):
            return "no meaning over lanes; call a function of Warp, or one made by wp.func"
        instead = CURES.get(thing.key, f"of Warp's functions use {', '.join(self.known_functions())}")
        return f"wp.{thing.key} has no meaning over lanes; {instead}"

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """A function that the lanes of one simulation execute together; provided by the mapping."""
        raise NotImplementedError

    def block(self, body: Sequence[ast.stmt]) -> None:
        """Translate statements in order; a return must be the last statement of a function."""
        for statement in body:
            method = getattr(self, "_do_" + type(statement).__name__.lower(), None)
            if method is None:
                raise self.refuse(statement, "no meaning over lanes")
            method(statement)

    # ---- names ---------------------------------------------------------------------------------------

    def lookup(self, name: str) -> Value:
        """A variable of this function, or an object of its globals or closure."""
        variable = self.scopes[-1].get(name)
        if isinstance(variable, Variable):
            if variable.birth != self.path[: len(variable.birth)]:
                self.outliving.add(variable.key)  # lanes that became inactive must keep their value
            items = tuple(
                Scalar(variable.kind, c, variable.varying, lane=variable.lane) for c in variable.names
            )
            return Vector(items, variable.bank) if variable.vector else items[0]
        if variable is not None:
            return variable
        return self.known(self.surroundings[-1][name])

    def assign_name(self, name: str, value: Value, node: ast.AST) -> None:
        """Assign a value to a name."""
        scope = self.scopes[-1]
        if isinstance(value, Array):
            scope[name] = self._with_header(name, value)
            return
        if isinstance(value, (Struct, PythonObject, tuple)):
            scope[name] = value
            return
        items = value.items if isinstance(value, Vector) else (value,)
        key = f"{self.instance_names[-1]}_{name}"
        variable = scope.get(name)
        if not isinstance(variable, Variable):
            bank = key if isinstance(value, Vector) and value.bank else ""
            names = tuple(f"{key}[{k}]" if bank else f"{key}_{k}" for k in range(len(items)))
            varying = bool(bank) or key in self.varying_names
            birth = () if key in self.outliving else self.path
            variable = Variable(names, items[0].kind, varying, birth, isinstance(value, Vector), key, bank)
            if bank:
                self.arrays[bank] = f"f64v {bank}[{len(items)}];"
            variable.lane = all(item.lane for item in items) and key not in self.out_of_step
            scope[name] = variable
        if items[0].kind != variable.kind or len(items) != len(variable.names):
            raise self.refuse(node, f"{name} changes from {variable.kind} to {items[0].kind}")
        # If fewer lanes are active than at the first assignment, the other lanes keep their values.
        outside = variable.birth[: len(self.path)] != self.path
        if any(item.varying for item in items) or (self.mask is not None and outside):
            self.varying_names.add(key)
            variable.varying = True
        # Inactive lanes interrupt the count from lane to lane, except lanes that leave a loop over lanes.
        behind = self.mask is not None and outside and self.lane_loops.get(self.mask) is not variable
        if variable.lane and (behind or not all(item.lane for item in items)):
            self.out_of_step.add(key)
        if variable.bank and isinstance(value, Vector) and value.bank == variable.bank:
            return  # added to in place
        for target, item in zip(variable.names, items, strict=True):
            if not variable.bank:
                self.declared[target] = (PACK if variable.varying else SCALAR)[variable.kind]
            new = self.operand(item, variable.varying)
            if self.mask is not None and outside:
                self.emit(f"{target} = op::sel({self.mask}, {new}, {target});")
            else:
                self.emit(f"{target} = {new};")

    def _with_header(self, name: str, array: Array) -> Array:
        """Load here, once, the entries of a varying row with known subscripts."""
        varying = array.offset is not None and array.offset.varying
        constant = not array.lanes_inside and array.name not in self.written
        if array.ndim - array.given != 1 or not varying or not constant or array.header is not None:
            return array
        rows = self.row_headers.setdefault(f"{self.instance_names[-1]}_{name}", set())
        header = _Header(rows)
        for k in sorted(rows):
            header[k] = self.load(self.part(array, (literal(k, "i32"),), ast.Constant(k)))
        return replace(array, header=header)

    def _do_assign(self, node: ast.Assign) -> None:
        if len(node.targets) != 1:
            raise self.refuse(node, "one assignment at a time")
        (target,) = node.targets
        self._assign(target, self.expression(node.value), node)

    def _assign(self, target: ast.expr, value: Value, node: ast.AST) -> None:
        if isinstance(target, ast.Tuple):
            if not isinstance(value, tuple) or len(value) != len(target.elts):
                raise self.refuse(node, "as many values as names are wanted")
            # Every right-hand side is already a temporary or a name, so the order has no effect.
            for part, item in zip(target.elts, [self._in_temporary(v) for v in value], strict=True):
                self._assign(part, item, node)
        elif isinstance(target, ast.Name):
            self.assign_name(target.id, value, node)
        elif isinstance(target, ast.Subscript):
            owner, index = self.expression(target.value), self.expression(target.slice)
            if not isinstance(owner, Array):
                raise self.refuse(node, "only parts of arrays are assigned")
            places = index if isinstance(index, tuple) else (index,)
            self.store(self.part(owner, places, node), value, node)
        else:
            raise self.refuse(target, "cannot be assigned over lanes")

    def _in_temporary(self, value: Value) -> Value:
        if isinstance(value, Scalar) and value.const is None:
            return self.temporary(value.kind, value.code, value.varying, lane=value.lane)
        if isinstance(value, Vector) and not value.bank:
            return Vector(tuple(self._in_temporary(item) for item in value.items))  # type: ignore[misc]
        return value

    def _do_augassign(self, node: ast.AugAssign) -> None:
        before = self.expression(node.target)
        value = self.sum_or_product(node.op, before, node.value, node)
        self._assign(node.target, value, node)

    def _do_expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.expression(node.value)


class _Header(dict[int, Value]):
    """Loaded entries of a row. A missing entry is recorded and loaded in the next translation."""

    def __init__(self, rows: set[int]) -> None:
        super().__init__()
        self.wanted = rows

    def __contains__(self, key: object) -> bool:
        if isinstance(key, int) and not dict.__contains__(self, key):
            self.wanted.add(key)
        return dict.__contains__(self, key)


class Control(Statements):
    """Translates branches that some lanes take, and loops that some lanes leave early. Both run under a
    mask."""

    # ---- branches ------------------------------------------------------------------------------------

    def _do_if(self, node: ast.If) -> None:
        condition = self.truth(node.test)
        if condition.const is not None:
            self.block(node.body if condition.const else node.orelse)
        elif not condition.varying:
            self.emit(f"if ({condition.code}) {{")
            self.block(node.body)
            if node.orelse:
                self.emit("} else {")
                self.block(node.orelse)
            self.emit("}")
        else:
            branch = self._under(condition.code, node.body)  # the body may change the condition
            if node.orelse:
                self._under(f"~{branch}", node.orelse)

    def _under(self, condition: str, body: Sequence[ast.stmt]) -> str:
        """Execute a body in the lanes where a condition is true, if there are any; returns their mask."""
        self.masks += 1
        mask, outer = f"m{self.masks}", self.mask
        self.emit(f"const mask {mask} = {condition if outer is None else f'{outer} & {condition}'};")
        self.emit(f"if (op::any({mask})) {{")
        self.mask, self.path = mask, (*self.path, mask)
        self.block(body)
        self.mask, self.path = outer, self.path[:-1]
        self.emit("}")
        return mask

    # ---- loops ---------------------------------------------------------------------------------------

    def _do_while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.refuse(node, "a loop has no else over lanes")
        self.masks += 1
        mask, outer = f"m{self.masks}", self.mask
        key = f"loop {self.instance_names[-1]} {node.lineno}"
        if key in self.varying_names:
            self.declared[mask] = "mask"
            self.emit(f"{mask} = {outer or 'everywhere'};")
            start = len(self.lines)
            self.emit("while (true) {")
            self.mask, self.path = mask, (*self.path, mask)
            condition = self.truth(node.test)
            self.emit(f"{mask} = {mask} & {self.pack(condition)};")
            self.emit(f"if (!op::any({mask})) break;")
            counter = self._lane_counter(node.test)
            if counter is not None:
                self.lane_loops[mask] = counter
            body = len(self.lines)
            self.block(node.body[:-1])
            step = len(self.lines)
            self.block(node.body[-1:])
            self.mask, self.path = outer, self.path[:-1]
            if counter is not None:
                counter.lane = False  # lanes that left the loop remained inactive
        else:
            start = len(self.lines)
            self.emit("while (true) {")
            condition = self.truth(node.test)
            if condition.varying:
                self.varying_names.add(key)
            self.emit(f"if (!({condition.code})) break;")
            body = len(self.lines)
            self.block(node.body[:-1])
            step = len(self.lines)
            self.block(node.body[-1:])
        self.emit("}")
        if self._counts(node):
            self._divide(start, body, step, node)

    def _counts(self, node: ast.While) -> bool:
        """Whether a loop is ``while k < n`` and its last statement increases k."""
        test, last = node.test, node.body[-1]
        if not (isinstance(test, ast.Compare) and isinstance(test.left, ast.Name)):
            return False
        if not (isinstance(last, ast.AugAssign) and isinstance(last.target, ast.Name)):
            return False
        return last.target.id == test.left.id

    def _divide(self, start: int, body: int, step: int, node: ast.While) -> None:
        """Divide a loop with one table lookup into two passes."""
        lines, depth, places = self.lines, 0, []
        for k in range(body, step):
            if depth == 0 and lines[k] == LOOKED_UP:
                places.append(k)
            depth += lines[k].count("{") - lines[k].count("}")
        if len(places) != 1:
            return
        (counter,) = self.scopes[-1][node.test.left.id].names  # type: ignore[attr-defined, union-attr]
        loop = Loop(
            head=lines[start + 1 : body],
            first=lines[body : places[0]],
            second=lines[places[0] + 1 : step],
            step=lines[step:-1],
            counter=counter,
            kinds=self.declared,
        )
        passes = divided(loop)
        if passes is not None:
            declared, self.lines[start:] = passes
            self.arrays.update((line, line) for line in declared)

    def _lane_counter(self, test: ast.expr) -> Variable | None:
        """The counter of a loop ``while k < n`` over lanes. The first lane leaves the loop last."""
        if not (isinstance(test, ast.Compare) and isinstance(test.ops[0], ast.Lt)):
            return None
        if not isinstance(test.left, ast.Name) or self.scalar(test.comparators[0]).varying:
            return None
        variable = self.scopes[-1].get(test.left.id)
        return variable if isinstance(variable, Variable) and variable.lane else None

    def _do_for(self, node: ast.For) -> None:
        call = node.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"):
            raise self.refuse(call, "a loop goes over a range")
        if len(call.args) > 2 or call.keywords or node.orelse or not isinstance(node.target, ast.Name):
            raise self.refuse(node, "a range has one or two bounds, and its loop no else")
        # Stored, because the body may change the operands of the bounds.
        bounds: list[Scalar] = [self._in_temporary(self.scalar(argument)) for argument in call.args]  # type: ignore[misc]
        if any(bound.kind != "i32" for bound in bounds):
            raise self.refuse(call, "bounds are integers")
        first, last = bounds if len(bounds) == 2 else (literal(0, "i32"), bounds[0])
        name = node.target.id
        if first.const is not None and last.const is not None:
            for k in range(first.const, last.const):
                self.scopes[-1][name] = literal(k, "i32")
                self.block(node.body)
            return
        if not first.varying and not last.varying:
            counter = self.name("c")
            self.emit(f"for (int {counter} = {first.code}; {counter} < {last.code}; ++{counter}) {{")
            self.scopes[-1][name] = Scalar("i32", counter)
            self.block(node.body)
            self.emit("}")
            return
        self.masks += 1
        mask, outer, counter = f"m{self.masks}", self.mask, self.name("c")
        self.declared[mask] = "mask"
        self.emit(f"i32v {counter} = {self.pack(first)};")
        self.emit(f"{mask} = {outer or 'everywhere'};")
        self.emit("while (true) {")
        self.emit(f"{mask} = {mask} & op::to_mask((i32v)({counter} < {self.pack(last)}));")
        self.emit(f"if (!op::any({mask})) break;")
        self.mask, self.path = mask, (*self.path, mask)
        self.scopes[-1][name] = Scalar("i32", counter, True)
        self.block(node.body)
        self.mask, self.path = outer, self.path[:-1]
        self.emit(f"{counter} = {counter} + 1;")
        self.emit("}")

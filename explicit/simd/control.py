"""Branches and loops on which the lanes may disagree."""

import ast
from collections.abc import Sequence

from explicit.simd.statements import Statements, Variable
from explicit.simd.two_passes import LOOKED_UP, Loop, divided
from explicit.simd.values import Scalar, literal


class Control(Statements):
    """A branch that some lanes take, and a loop that some lanes leave early, run under a mask."""

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
            taken = self._under(condition.code, node.body)  # the body may change what the condition reads
            if node.orelse:
                self._under(f"~{taken}", node.orelse)

    def _under(self, condition: str, body: Sequence[ast.stmt]) -> str:
        """A body in the lanes where a condition holds, if there are any; returns their mask."""
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
                counter.lane = False  # lanes that left stayed behind
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
        """Whether a loop is ``while k < n`` and its last statement takes k on."""
        test, last = node.test, node.body[-1]
        if not (isinstance(test, ast.Compare) and isinstance(test.left, ast.Name)):
            return False
        if not (isinstance(last, ast.AugAssign) and isinstance(last.target, ast.Name)):
            return False
        return last.target.id == test.left.id

    def _divide(self, start: int, body: int, step: int, node: ast.While) -> None:
        """Put a loop that looks up one table in two passes."""
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
        made = divided(loop)
        if made is not None:
            declared, self.lines[start:] = made
            self.arrays.update((line, line) for line in declared)

    def _lane_counter(self, test: ast.expr) -> Variable | None:
        """The variable of a loop ``while k < n``: the first lane, where it begins, is the last to leave."""
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
        # Held: the body may change what the bounds were made of.
        bounds: list[Scalar] = [self._held(self.scalar(argument)) for argument in call.args]  # type: ignore[misc]
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

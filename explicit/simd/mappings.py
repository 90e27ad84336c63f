"""Meanings of a lane: what they have in common, and a simulation each (`explicit.simd.workers`: a worker)."""

import ast
from collections.abc import Sequence

from explicit.simd.control import Control
from explicit.simd.values import Array, Known, Scalar, Value, Vector, literal

BOUNDS = (
    "first_element", "end_element", "sum_first", "boundary_first",
    "first_inner", "end_inner", "control_first",
)  # fmt: skip
"""Functions that say where a sweep begins or ends; asked with the lane or the end of all."""


class Lanes(Control):
    """Common part of both mappings: a lane is worker and control at once."""

    side_by_side = 1
    """Elements of one simulation that are at work at once in a thread."""

    def shared(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """The lane functions whose meaning does not depend on what a lane is."""
        if name == "field":
            return self.field(arguments, node)
        if name == "entry":
            return self.entry(arguments, node)
        if name in ("entries", "entries_if"):
            table, row, column = arguments[-3:]
            rows = [self.arithmetic(ast.Add(), row, literal(k, "i32"), node) for k in range(4)]
            return Vector(tuple(self.entry((table, k, column), node) for k in rows))
        if name == "four":
            return self.four(arguments, node)
        if name == "control_sync":
            return Known(None)
        if name in ("is_worker", "is_writer"):
            return literal(1, "i32")
        if name in ("n_workers", "inner_stride", "control_stride"):
            return literal(self.side_by_side, "i32")
        if name == "stride":
            return arguments[0]
        if name == "get_total":
            parts, k = arguments
            return self.load(self.part(parts, (k,), node))  # type: ignore[arg-type]
        if name == "boundary_totals":
            first, second, n = arguments
            return Vector((self._boundary_total(first, n, node), self._boundary_total(second, n, node)))
        raise self.refuse(node, "no meaning over lanes")

    def _boundary_total(self, numbers: Value, n: Value, node: ast.Call) -> Scalar:
        """One after the other, whatever the lanes are, so that forces keep their bits."""
        if not isinstance(numbers, Array) or not isinstance(n, Scalar) or n.varying:
            raise self.refuse(node, "numbers of boundary nodes and a count that all lanes share are wanted")
        name, counter, varying = self.name("sum"), self.name("c"), numbers.lanes_inside
        ctype = "f64v" if varying else "double"
        place = f"((f64vu*){numbers.name})[{counter}]" if varying else f"{numbers.name}[{counter}]"
        self.emit(f"{ctype} {name} = ({ctype})(0.0);")
        self.emit(f"for (int {counter} = 0; {counter} < {n.code}; ++{counter}) {name} += {place};")
        return Scalar("f64", name, varying)

    def hand_over(self, arguments: Sequence[Value], total: Value, node: ast.Call) -> Value:
        """Keep a total where it is asked for."""
        parts, k, _ = arguments
        self.store(self.part(parts, (k,), node), total, node)  # type: ignore[arg-type]
        return Known(None)


class LaneIsSimulation(Lanes):
    """Every lane is a simulation; elements and nodes come one after the other.

    Fields of the state are laid out with the lanes of an entry side by side.
    """

    lanes_inside = True
    own = frozenset(
        {"empty_sum", "add_to", "add_share", "put_share", "joined", "regroup", "settle", "disband"}
    )

    def wp_tid(self) -> Value:
        """Simulation and lane within it: the last lanes of an incomplete pack repeat its last simulation."""
        self.emit("const i32v index = lane_numbers < (i32v)(count) ? lane_numbers : (i32v)(count - 1);")
        return (Scalar("i32", "index", True), literal(0, "i32"))

    def wp_block_dim(self) -> Scalar:
        """One worker a simulation."""
        return literal(1, "i32")

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """Nobody to wait for; sums are made as the lanes of one simulation would make them."""
        if name == "empty_sum":
            return Vector((literal(0, "f64"),) * self.lanes, bank="new")
        if name in ("add_to", "add_share"):
            sofar, share, place = arguments[0], arguments[-2], arguments[-1]
            return self._add_to(sofar, share, place, node)  # type: ignore[arg-type]
        if name in ("sync", "put_share", "settle"):
            return Known(None)
        if name == "regroup":
            return tuple(arguments)
        if name == "is_control":
            return literal(1, "i32")
        if name in BOUNDS or name in ("joined", "disband"):
            return arguments[0]
        if name == "get_largest":
            parts, k = arguments
            return self.load(self.part(parts, (k,), node))  # type: ignore[arg-type]
        if name == "put_total":
            return self.hand_over(arguments, self._total(arguments[2], node), node)
        if name == "put_largest":
            return self.hand_over(arguments, arguments[2], node)
        return self.shared(name, arguments, node)

    def _add_to(self, sofar: Vector, share: Scalar, place: Scalar, node: ast.AST) -> Vector:
        """The k-th share belongs to partial sum k modulo the lanes."""
        if sofar.bank in ("", "new") or place.varying:
            raise self.refuse(node, "a sum has a name, and all lanes share the element's or node's number")
        part = f"{sofar.bank}[(unsigned)({place.code}) % W]"
        new = self.temporary("f64", f"{part} + {self.pack(share)}", True)
        self.emit(
            f"{part} = {new.code if self.mask is None else f'op::sel({self.mask}, {new.code}, {part})'};"
        )
        return sofar

    def _total(self, sofar: Value, node: ast.AST) -> Value:
        """The partial sums, in the order of `op::sum`."""
        if not isinstance(sofar, Vector) or not sofar.bank:
            raise self.refuse(node, "only sums that began with empty_sum have a total")
        parts = list(sofar.items)
        while len(parts) > 1:
            half = len(parts) // 2
            pairs = zip(parts[:half], parts[half:], strict=True)
            parts = [self.temporary("f64", f"{a.code} + {b.code}", True) for a, b in pairs]
        return parts[0]

"""What becomes a lane: a simulation each, or the elements and nodes of one simulation in turn."""

import ast
from collections.abc import Sequence

from explicit.simd.control import Control
from explicit.simd.values import Known, Scalar, Value, Vector, literal


class LaneIsSimulation(Control):
    """Every lane is a simulation; elements and nodes are walked one after the other.

    Fields of the state are laid out with the lanes of an entry side by side.
    """

    lanes_inside = True
    own = frozenset({"empty_sum", "add_to"})

    def wp_tid(self) -> Value:
        """Simulation and lane within it: the last lanes of an incomplete pack repeat its last simulation."""
        self.emit("const i32v index = lane_numbers < (i32v)(count) ? lane_numbers : (i32v)(count - 1);")
        return (Scalar("i32", "index", True), literal(0, "i32"))

    def wp_block_dim(self) -> Scalar:
        """One walker a simulation."""
        return literal(1, "i32")

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """Nobody to wait for; walked sums are made as the lanes of one simulation would make them."""
        if name == "field":
            return self.field(arguments, node)
        if name == "empty_sum":
            return Vector((literal(0, "f64"),) * self.lanes, bank="new")
        if name == "add_to":
            sofar, share, place = arguments
            return self._add_to(sofar, share, place, node)  # type: ignore[arg-type]
        if name == "total":
            return self._total(arguments[0], node)
        if name in ("largest", "ordered_total"):
            return arguments[0]
        if name in ("ordered_first", "ordered_step"):
            return literal(0 if name == "ordered_first" else 1, "i32")
        if name == "sync":
            return Known(None)
        raise self.refuse(node, "no meaning over lanes")

    def _add_to(self, sofar: Vector, share: Scalar, place: Scalar, node: ast.AST) -> Vector:
        """The k-th share belongs to partial sum k modulo the lanes."""
        if sofar.bank in ("", "new") or place.varying:
            raise self.refuse(node, "a sum has a name, and the walk's number is the place")
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


class LaneIsWalker(Control):
    """The lanes share the elements and nodes of one simulation, as the threads of a block do on a GPU."""

    def wp_tid(self) -> Value:
        """Simulation and lane within it."""
        return (literal(0, "i32"), Scalar("i32", "lane_numbers", True, lane=True))

    def wp_block_dim(self) -> Scalar:
        """As many walkers as lanes."""
        return literal(self.lanes, "i32")

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """Sums and largest values over the lanes, in a fixed order."""
        if name == "field":
            return self.field(arguments, node)
        if name == "sync":
            return Known(None)
        if name == "ordered_total":
            return arguments[0]
        if name in ("ordered_first", "ordered_step"):
            return literal(0 if name == "ordered_first" else 1, "i32")
        (value,) = arguments
        if self.mask is not None or not isinstance(value, Scalar):
            raise self.refuse(node, "every lane must take part")
        if name == "total":
            return self.temporary("f64", f"op::sum({self.pack(value)})", False)
        if name == "largest":
            return self.temporary("f64", f"op::most({self.pack(value)})", False)
        raise self.refuse(node, "no meaning over lanes")

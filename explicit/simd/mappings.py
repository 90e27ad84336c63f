"""Meanings of a lane: a simulation each, or the elements and nodes of one simulation in turn."""

import ast
from collections.abc import Sequence

from explicit.simd.control import Control
from explicit.simd.team import DISBAND, MEET, REGROUP, SETTLE, TOTALS
from explicit.simd.values import PACK, Array, Known, Scalar, Value, Vector, literal


FIRSTS = (
    "first_element", "end_element", "sum_first", "boundary_first", "first_inner", "end_inner", "control_first",
)  # fmt: skip
"""Functions that say where a sweep begins and ends: of one worker a simulation, as they were asked."""


class _Lanes(Control):
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


class LaneIsSimulation(_Lanes):
    """Every lane is a simulation; elements and nodes come one after the other.

    Fields of the state are laid out with the lanes of an entry side by side.
    """

    lanes_inside = True
    own = frozenset({"empty_sum", "add_to", "add_share", "put_share", "joined", "regroup", "settle"})

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
            return self._add_to(arguments[0], *arguments[-2:], node)  # type: ignore[arg-type]
        if name in ("sync", "put_share", "settle", "disband"):
            return Known(None)
        if name == "regroup":
            return tuple(arguments)
        if name == "is_control":
            return literal(1, "i32")
        if name in FIRSTS or name == "joined":
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


class LaneIsWorker(_Lanes):
    """The lanes share the elements and nodes of one simulation, as the threads of a block do on a GPU.

    Those of several threads may, see `explicit.simd.team`.
    """

    own = frozenset({"add_share", "put_share", "joined", "regroup", "settle"})

    def __init__(self, lanes: int) -> None:
        super().__init__(lanes)
        self.side_by_side = lanes

    def wp_tid(self) -> Value:
        """Simulation and lane within it."""
        return (literal(0, "i32"), Scalar("i32", "lane_of_all", True, lane=True))

    def wp_block_dim(self) -> Scalar:
        """As many workers as lanes."""
        return literal(self.lanes, "i32")

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """What depends on the thread, sums and largest values over the lanes, in a fixed order."""
        if name == "sync":
            self.emit(MEET)
            return Known(None)
        if name == "settle":
            (latched,) = arguments
            assert isinstance(latched, Scalar)
            self.lines.extend(SETTLE.replace("LATCHED", self.pack(latched)).strip().splitlines())
            return Known(None)
        if name == "regroup":
            return self._regrouped(arguments)
        if name == "disband":
            self.lines.extend(DISBAND.strip().splitlines())
            return Known(None)
        if name == "is_control":
            return Scalar("i32", "keeps_books")
        if name in FIRSTS:
            return self._bound(name, arguments)
        if name in ("add_share", "put_share", "joined"):
            return self._shared_sum(name, arguments, node)
        if name == "get_largest":
            return self._largest(arguments, node)
        if name not in ("put_total", "put_largest"):
            return self.shared(name, arguments, node)
        value = arguments[2]
        if self.mask is not None or not isinstance(value, Scalar):
            raise self.refuse(node, "every lane must take part")
        if name == "put_total":
            total = self.temporary("f64", f"op::sum({self.pack(value)})", False)
            self.emit("if (keeps_books) {")
            self.hand_over(arguments, total, node)
            self.emit("}")
        else:
            most = self.temporary("f64", f"op::most({self.pack(value)})", False)
            place = self.arithmetic(ast.Add(), arguments[1], Scalar("i32", f"(keeps_books ? 0 : (member + 1) * {TOTALS})"), node)
            self.hand_over((arguments[0], place, value), most, node)
        return Known(None)

    def _bound(self, name: str, arguments: Sequence[Value]) -> Scalar:
        """Where this thread's part of a sweep begins or ends."""
        if name in ("sum_first", "boundary_first"):
            return Scalar("i32", "lane_of_all", True, lane=True)
        if name == "control_first":
            return Scalar("i32", "lane_numbers", True, lane=True)
        made = "begin" if name.startswith("first") else "end"
        n = arguments[name.startswith("first")]
        assert isinstance(n, Scalar)
        place = self.temporary("i32", f"team_op::{made}({n.code}, member, members)", False)
        if name.endswith("inner"):  # a sum is made by the last thread
            adds = arguments[-1]
            assert isinstance(adds, Scalar)
            whole = f"(keeps_books ? 0 : {n.code})" if made == "begin" else n.code
            place = self.temporary("i32", f"{adds.code} ? {whole} : {place.code}", False)
        if made == "end":
            return place
        return self.temporary("i32", f"lane_numbers + {place.code}", True, lane=True)

    def _regrouped(self, arguments: Sequence[Value]) -> tuple[Scalar, ...]:
        """With what this thread goes on."""
        code, found = REGROUP, []
        for key, value in zip(("STEP", "UNTIL", "LATCHED"), arguments, strict=True):
            assert isinstance(value, Scalar)
            name = self.name(key.lower())
            self.emit(f"{PACK['f64'] if key == 'LATCHED' else 'int'} {name} = {self.operand(value, key == 'LATCHED')};")
            code = code.replace(key, name)
            found.append(Scalar(value.kind, name, key == "LATCHED"))
        self.lines.extend(code.strip().splitlines())
        return tuple(found)

    def _shared_sum(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """A sum over the elements of all threads, in the order of one."""
        sofar, which = arguments[:2]
        if not isinstance(sofar, Scalar) or not isinstance(which, Scalar) or which.const is None:
            raise self.refuse(node, "a sum and its known number are wanted")
        room = f"shares + {which.const} * shares_s0"
        if name == "put_share":
            self.emit("if (member == 0 && members > 1) {")
            self.emit(f"*(f64vu*)({room} + shares_s0 - W) = {self.pack(sofar)};")
            self.emit("}")
            return Known(None)
        if name == "joined":
            n, total, at = arguments[2], self.name("sum"), self.name("c")
            assert isinstance(n, Scalar)
            self.emit(f"f64v {total} = {self.pack(sofar)};")
            self.emit("if (keeps_books && members > 1) {")
            self.emit(f"{total} = *(f64vu*)({room} + shares_s0 - W);")
            first = f"team_op::end({n.code}, 0, members)"
            self.emit(f"for (int {at} = {first}; {at} < {n.code}; {at} += W) {total} += *(f64vu*)({room} + {at});")
            self.emit("}")
            return Scalar("f64", total, True)
        share, place = arguments[2:]
        if not isinstance(share, Scalar) or not isinstance(place, Scalar) or not place.lane:
            raise self.refuse(node, "the share of an element is wanted")
        kept = share if self.mask is None else self.select(Scalar("bool", self.mask, True), share, literal(0, "f64"))
        self.emit("if (member > 0) {")
        self.emit(f"*(f64vu*)({room} + {place.code}[0]) = {self.pack(kept)};")
        self.emit("}")
        return self.arithmetic(ast.Add(), sofar, share, node)

    def _largest(self, arguments: Sequence[Value], node: ast.Call) -> Scalar:
        """The largest of all threads' values."""
        parts, k = arguments
        first = self.load(self.part(parts, (k,), node))  # type: ignore[arg-type]
        assert isinstance(parts, Array)
        assert isinstance(k, Scalar)
        assert isinstance(first, Scalar)
        most, other = self.name("most"), self.name("c")
        self.emit(f"double {most} = {first.code};")
        self.emit(f"for (int {other} = 1; {other} < members; ++{other}) {{")
        self.emit(f"const double further = {parts.name}[{k.code} + {other} * {TOTALS}];")
        self.emit(f"if (!({most} > further) && further == further) {most} = further;")
        self.emit("}")
        return Scalar("f64", most)

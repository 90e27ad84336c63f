"""Two mappings of lanes: each lane runs one simulation, or lanes (and threads) share the elements of one
simulation."""

import ast
from collections.abc import Sequence

from explicit.simd.expressions import Array, PythonObject, Scalar, Value, Vector, literal
from explicit.simd.statements import Control
from explicit.simd.team import DISBAND, MEET, REGROUP, SETTLE, TOTALS

BOUNDS = (
    "first_element", "end_element", "sum_first", "boundary_first",
    "first_inner", "end_inner", "control_first",
)  # fmt: skip
"""Functions that return the beginning or end of a sweep. Their argument is the lane or the overall end."""


class Lanes(Control):
    """Common part of both mappings: a lane is worker and control at once."""

    side_by_side = 1
    """Number of elements of one simulation that a thread processes at the same time."""

    def shared(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """The lane functions that are the same in both mappings."""
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
            return PythonObject(None)
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
        """Totals over boundary nodes. The sequential sum does not depend on the lanes, so forces are bitwise
        repeatable."""
        if not isinstance(numbers, Array) or not isinstance(n, Scalar) or n.varying:
            raise self.refuse(node, "numbers of boundary nodes and a count that all lanes share are wanted")
        name, counter, varying = self.name("sum"), self.name("c"), numbers.lanes_inside
        ctype = "f64v" if varying else "double"
        place = f"((f64vu*){numbers.name})[{counter}]" if varying else f"{numbers.name}[{counter}]"
        self.emit(f"{ctype} {name} = ({ctype})(0.0);")
        self.emit(f"for (int {counter} = 0; {counter} < {n.code}; ++{counter}) {name} += {place};")
        return Scalar("f64", name, varying)

    def hand_over(self, arguments: Sequence[Value], total: Value, node: ast.Call) -> Value:
        """Store a total at the requested position."""
        parts, k, _ = arguments
        self.store(self.part(parts, (k,), node), total, node)  # type: ignore[arg-type]
        return PythonObject(None)


class LaneIsSimulation(Lanes):
    """Every lane runs one simulation and processes its elements and nodes sequentially.

    In the fields of the state the lanes of an entry are adjacent.
    """

    lanes_inside = True
    own = frozenset(
        {"empty_sum", "add_to", "add_share", "put_share", "joined", "regroup", "settle", "disband"}
    )

    def wp_tid(self) -> Value:
        """Simulation and lane within it. The last lanes of an incomplete pack repeat its last simulation."""
        self.emit("const i32v index = lane_numbers < (i32v)(count) ? lane_numbers : (i32v)(count - 1);")
        return (Scalar("i32", "index", True), literal(0, "i32"))

    def wp_block_dim(self) -> Scalar:
        """One worker per simulation."""
        return literal(1, "i32")

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """No synchronisation. Sums are computed in the same way as by the lanes of one simulation."""
        if name == "empty_sum":
            return Vector((literal(0, "f64"),) * self.lanes, bank="new")
        if name in ("add_to", "add_share"):
            sofar, share, place = arguments[0], arguments[-2], arguments[-1]
            return self._add_to(sofar, share, place, node)  # type: ignore[arg-type]
        if name in ("sync", "put_share", "settle"):
            return PythonObject(None)
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


class LaneIsWorker(Lanes):
    """The lanes share the elements and nodes of one simulation, as the threads of a block do on a GPU.

    Several threads may share the simulation, each with separate lanes. The variables of
    `explicit.simd.team.TEAM_CODE` give the seat of this thread and the number of threads.
    """

    own = frozenset({"add_share", "put_share", "joined", "regroup", "settle", "disband"})

    def __init__(self, lanes: int) -> None:
        super().__init__(lanes)
        self.side_by_side = lanes

    def wp_tid(self) -> Value:
        """Simulation and lane within it. Sweeps that are not shared run in one thread only."""
        return (literal(0, "i32"), Scalar("i32", "lane_of_all", True, lane=True))

    def wp_block_dim(self) -> Scalar:
        """As many workers as lanes."""
        return literal(self.lanes, "i32")

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """Functions that depend on the thread, and sums and largest values over the lanes in a fixed
        order."""
        if name == "is_control":
            return Scalar("i32", "keeps_books")
        if name == "sync":
            self.emit(MEET)
        elif name == "settle":
            latched = self.pack(self._number(arguments[0], node))
            self.lines.extend(SETTLE.replace("LATCHED", latched).strip().splitlines())
        elif name == "regroup":
            return self._regrouped(REGROUP, ("STEP", "UNTIL", "LATCHED"), arguments, node)
        elif name == "disband":
            return self._regrouped(DISBAND, ("LATCHED",), arguments, node)[0]
        elif name in BOUNDS:
            return self._bound(name, [self._number(argument, node) for argument in arguments])
        elif name == "add_share":
            sofar, which, share, place = (self._number(argument, node) for argument in arguments)
            return self._add_share(sofar, which, share, place, node)
        elif name == "put_share":
            sofar, which = (self._number(argument, node) for argument in arguments)
            self.emit("if (member == 0 && members > 1) {")
            self.emit(f"{self._first_sum(which)} = {self.pack(sofar)};")
            self.emit("}")
        elif name == "joined":
            sofar, which, n = (self._number(argument, node) for argument in arguments)
            return self._joined_sum(sofar, which, n)
        elif name == "get_largest":
            return self._largest(arguments, node)
        elif name in ("put_total", "put_largest"):
            self._hand_over(name, arguments, node)
        else:
            return self.shared(name, arguments, node)
        return PythonObject(None)

    def _number(self, value: Value, node: ast.AST) -> Scalar:
        if not isinstance(value, Scalar):
            raise self.refuse(node, "a number is wanted here")
        return value

    # ---- parts ---------------------------------------------------------------------------------------

    def _bound(self, name: str, arguments: Sequence[Scalar]) -> Scalar:
        """Beginning or end of this thread's part of a sweep."""
        if name in ("sum_first", "boundary_first"):
            return Scalar("i32", "lane_of_all", True, lane=True)
        if name == "control_first":
            return Scalar("i32", "lane_numbers", True, lane=True)
        begins, n = name.startswith("first"), arguments[name.startswith("first")]
        bound = f"team_op::{'begin' if begins else 'end'}({n.code}, member, members)"
        if name.endswith("inner"):  # a sum over nodes is made by one thread
            whole = f"(keeps_books ? 0 : {n.code})" if begins else n.code
            bound = f"{arguments[-1].code} ? {whole} : {bound}"
        place = self.temporary("i32", bound, False)
        return self.temporary("i32", f"lane_numbers + {place.code}", True, lane=True) if begins else place

    def _regrouped(
        self, code: str, keys: Sequence[str], arguments: Sequence[Value], node: ast.AST
    ) -> tuple[Scalar, ...]:
        """Values with which this thread continues after threads have joined or left."""
        scalars = []
        for key, value in zip(keys, arguments, strict=True):
            number, name = self._number(value, node), self.name(key.lower())
            varying = key == "LATCHED"
            scalars.append(Scalar(number.kind, name, varying))
            self.emit(f"{scalars[-1].ctype} {name} = {self.operand(number, varying)};")
            code = code.replace(key, name)
        self.lines.extend(code.strip().splitlines())
        return tuple(scalars)

    # ---- sums over the elements of all threads -------------------------------------------------------

    @staticmethod
    def _first_sum(which: Scalar) -> str:
        """Place of the first thread's sum, after the shares of the elements."""
        return f"*(f64vu*)(shares + ({which.code} + 1) * shares_s0 - W)"

    @staticmethod
    def _share(which: Scalar, element: str) -> str:
        """Place of the shares of a pack of elements."""
        return f"*(f64vu*)(shares + {which.code} * shares_s0 + {element})"

    def _add_share(self, sofar: Scalar, which: Scalar, share: Scalar, place: Scalar, node: ast.Call) -> Value:
        """The sum of this thread. Threads after the first one store their elements' shares, which are added
        later in order."""
        if not place.lane:
            raise self.refuse(node, "the share of an element is wanted")
        addend = share
        if self.mask is not None:  # no addition if the sum starts from 0
            addend = self.select(Scalar("bool", self.mask, True), share, literal(0, "f64"))
        self.emit("if (member > 0) {")
        self.emit(f"{self._share(which, f'{place.code}[0]')} = {self.pack(addend)};")
        self.emit("}")
        return self.arithmetic(ast.Add(), sofar, share, node)

    def _joined_sum(self, sofar: Scalar, which: Scalar, n: Scalar) -> Scalar:
        """The complete sum, in the order of a single thread. Only the thread of the control work has it."""
        total, at = self.name("sum"), self.name("c")
        self.emit(f"f64v {total} = {self.pack(sofar)};")
        self.emit("if (keeps_books && members > 1) {")
        self.emit(f"{total} = {self._first_sum(which)};")
        self.emit(f"for (int {at} = team_op::end({n.code}, 0, members); {at} < {n.code}; {at} += W)")
        self.emit(f"{total} += {self._share(which, at)};")
        self.emit("}")
        return Scalar("f64", total, True)

    # ---- what is handed over -------------------------------------------------------------------------

    def _hand_over(self, name: str, arguments: Sequence[Value], node: ast.Call) -> None:
        """Pass a total, which one thread computes, or each thread's largest value."""
        parts, k, value = arguments
        if self.mask is not None or not isinstance(value, Scalar):
            raise self.refuse(node, "every lane must take part")
        if name == "put_total":
            total = self.temporary("f64", f"op::sum({self.pack(value)})", False)
            self.emit("if (keeps_books) {")
            self.hand_over(arguments, total, node)
            self.emit("}")
            return
        most = self.temporary("f64", f"op::most({self.pack(value)})", False)
        offset = self.temporary("i32", f"keeps_books ? 0 : (member + 1) * {TOTALS}", False)
        place = self.arithmetic(ast.Add(), k, offset, node)
        self.hand_over((parts, place, value), most, node)

    def _largest(self, arguments: Sequence[Value], node: ast.Call) -> Scalar:
        """The largest of all threads' values; NaN only if all values are NaN."""
        parts, k = arguments
        if not isinstance(parts, Array):
            raise self.refuse(node, "an array and a number are wanted")
        place, most, counter = self._number(k, node), self.name("most"), self.name("c")
        self.emit(f"double {most} = {parts.name}[{place.code}];")
        self.emit(f"for (int {counter} = 1; {counter} < members; ++{counter}) {{")
        self.emit(f"const double further = {parts.name}[{place.code} + {counter} * {TOTALS}];")
        self.emit(f"if (!({most} > further) && further == further) {most} = further;")
        self.emit("}")
        return Scalar("f64", most)

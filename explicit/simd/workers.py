"""Lanes, and threads, that share the elements and nodes of one simulation."""

import ast
from collections.abc import Sequence

from explicit.simd.mappings import BOUNDS, Lanes
from explicit.simd.team import DISBAND, MEET, REGROUP, SETTLE, TOTALS
from explicit.simd.values import Array, Known, Scalar, Value, literal


class LaneIsWorker(Lanes):
    """The lanes share the elements and nodes of one simulation, as the threads of a block do on a GPU.

    Several threads may share it, each with lanes of its own: what `explicit.simd.team.CODE` declares says
    which this one is and how many they are.
    """

    own = frozenset({"add_share", "put_share", "joined", "regroup", "settle", "disband"})

    def __init__(self, lanes: int) -> None:
        super().__init__(lanes)
        self.side_by_side = lanes

    def wp_tid(self) -> Value:
        """Simulation and lane within it; sweeps that are not shared out find nothing but in one thread."""
        return (literal(0, "i32"), Scalar("i32", "lane_of_all", True, lane=True))

    def wp_block_dim(self) -> Scalar:
        """As many workers as lanes."""
        return literal(self.lanes, "i32")

    def together(self, name: str, arguments: Sequence[Value], node: ast.Call) -> Value:
        """What depends on the thread, sums and largest values over the lanes, in a fixed order."""
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
        return Known(None)

    def _number(self, value: Value, node: ast.AST) -> Scalar:
        if not isinstance(value, Scalar):
            raise self.refuse(node, "a number is wanted here")
        return value

    # ---- parts ---------------------------------------------------------------------------------------

    def _bound(self, name: str, arguments: Sequence[Scalar]) -> Scalar:
        """Where this thread's part of a sweep begins or ends."""
        if name in ("sum_first", "boundary_first"):
            return Scalar("i32", "lane_of_all", True, lane=True)
        if name == "control_first":
            return Scalar("i32", "lane_numbers", True, lane=True)
        begins, n = name.startswith("first"), arguments[name.startswith("first")]
        made = f"team_op::{'begin' if begins else 'end'}({n.code}, member, members)"
        if name.endswith("inner"):  # a sum over nodes is made by one thread
            whole = f"(keeps_books ? 0 : {n.code})" if begins else n.code
            made = f"{arguments[-1].code} ? {whole} : {made}"
        place = self.temporary("i32", made, False)
        return self.temporary("i32", f"lane_numbers + {place.code}", True, lane=True) if begins else place

    def _regrouped(
        self, code: str, keys: Sequence[str], arguments: Sequence[Value], node: ast.AST
    ) -> tuple[Scalar, ...]:
        """With what this thread goes on where threads come and go."""
        found = []
        for key, value in zip(keys, arguments, strict=True):
            number, name = self._number(value, node), self.name(key.lower())
            varying = key == "LATCHED"
            found.append(Scalar(number.kind, name, varying))
            self.emit(f"{found[-1].ctype} {name} = {self.operand(number, varying)};")
            code = code.replace(key, name)
        self.lines.extend(code.strip().splitlines())
        return tuple(found)

    # ---- sums over the elements of all threads -------------------------------------------------------

    @staticmethod
    def _first_sum(which: Scalar) -> str:
        """Where the first thread leaves its sum: behind the shares of the elements."""
        return f"*(f64vu*)(shares + ({which.code} + 1) * shares_s0 - W)"

    @staticmethod
    def _share(which: Scalar, element: str) -> str:
        """Where the shares of a pack of elements are kept."""
        return f"*(f64vu*)(shares + {which.code} * shares_s0 + {element})"

    def _add_share(self, sofar: Scalar, which: Scalar, share: Scalar, place: Scalar, node: ast.Call) -> Value:
        """The sum of this thread; behind the first, elements' shares are kept to be added in their order."""
        if not place.lane:
            raise self.refuse(node, "the share of an element is wanted")
        kept = share
        if self.mask is not None:  # nothing is added where a sum began with 0
            kept = self.select(Scalar("bool", self.mask, True), share, literal(0, "f64"))
        self.emit("if (member > 0) {")
        self.emit(f"{self._share(which, f'{place.code}[0]')} = {self.pack(kept)};")
        self.emit("}")
        return self.arithmetic(ast.Add(), sofar, share, node)

    def _joined_sum(self, sofar: Scalar, which: Scalar, n: Scalar) -> Scalar:
        """In the last thread the whole sum, in the order of one."""
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
        """A total, which one thread knows, or the largest value of every thread."""
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
        own = self.temporary("i32", f"keeps_books ? 0 : (member + 1) * {TOTALS}", False)
        place = self.arithmetic(ast.Add(), k, own, node)
        self.hand_over((parts, place, value), most, node)

    def _largest(self, arguments: Sequence[Value], node: ast.Call) -> Scalar:
        """The largest of all threads' values; of those that are not a number only where all are."""
        parts, k = arguments
        if not isinstance(parts, Array):
            raise self.refuse(node, "an array and a number are wanted")
        place, most, other = self._number(k, node), self.name("most"), self.name("c")
        self.emit(f"double {most} = {parts.name}[{place.code}];")
        self.emit(f"for (int {other} = 1; {other} < members; ++{other}) {{")
        self.emit(f"const double further = {parts.name}[{place.code} + {other} * {TOTALS}];")
        self.emit(f"if (!({most} > further) && further == further) {most} = further;")
        self.emit("}")
        return Scalar("f64", most)

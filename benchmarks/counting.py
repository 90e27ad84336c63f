"""Floating-point operations of an element update, counted by running the element's source on counting
numbers.

The Python source of the Warp functions is called with `Number`s instead of real numbers. The element is a
deformed element of the benchmark's mesh, which takes the usual branches. Additions and subtractions,
products, divisions and roots are counted; signs, comparisons, conversions and array reads are not.
`Tally.fused` is the number of products that can be fused with the following sum.
"""

import builtins
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import sqrt
from types import CellType, FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from explicit.elements import element
from explicit.model import Model
from explicit.precision import PRECISIONS

NODE_OPERATIONS = 22
"""Operations of one node, counted by hand from `explicit.time_loop.kernel`. The sum of four corners in two
directions takes 8 additions. Force over mass, drag and their sum take 6 operations. The steps of velocity and
position take 4 each. Platens affect few nodes."""
NODE_INSTRUCTIONS = 16
"""Instructions of one node with fused products. Drag, velocity and position need 2 fewer each."""


@dataclass
class Tally:
    """Counts so far."""

    additions: int = 0
    products: int = 0
    divisions: int = 0
    roots: int = 0
    fused: int = 0
    """Products that can be fused with an addition."""

    @property
    def operations(self) -> int:
        """Floating-point operations; a fused product and sum counts as two."""
        return self.additions + self.products + self.divisions + self.roots

    @property
    def instructions(self) -> int:
        """Arithmetic instructions; a fused product and sum counts as one."""
        return self.operations - self.fused


class Number:
    """A real number that counts the operations on it."""

    def __init__(self, value: float, tally: Tally, product: bool = False) -> None:
        self.value, self.tally, self.product = float(value), tally, product

    def _sum(self, other: Any, sign: float, swap: bool = False) -> "Number":
        if not isinstance(other, Number):
            return NotImplemented
        self.tally.additions += 1
        for term in (self, other):
            if term.product:
                term.product = False
                self.tally.fused += 1
                break
        a, b = (other.value, self.value) if swap else (self.value, other.value)
        return Number(a + sign * b, self.tally)

    def __add__(self, other: Any) -> "Number":
        return self._sum(other, 1.0)

    def __sub__(self, other: Any) -> "Number":
        return self._sum(other, -1.0)

    def __mul__(self, other: Any) -> "Number":
        if not isinstance(other, Number):
            return NotImplemented
        self.tally.products += 1
        return Number(self.value * other.value, self.tally, product=True)

    def __truediv__(self, other: Any) -> "Number":
        if not isinstance(other, Number):
            return NotImplemented
        self.tally.divisions += 1
        return Number(self.value / other.value, self.tally)

    def __neg__(self) -> "Number":
        return Number(-self.value, self.tally, self.product)

    def __lt__(self, other: "Number") -> bool:
        return self.value < other.value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Number) and self.value == other.value

    __hash__ = None  # type: ignore[assignment]

    def __le__(self, other: "Number") -> bool:
        return self.value <= other.value

    def __gt__(self, other: "Number") -> bool:
        return self.value > other.value

    def __int__(self) -> int:
        return int(self.value)


class Numbers:
    """A vector of counting numbers."""

    def __init__(self, *items: Number) -> None:
        self.items = items

    def __getitem__(self, k: int) -> Number:
        return self.items[k]

    def __iter__(self) -> Iterator[Number]:
        return iter(self.items)

    def __add__(self, other: "Numbers") -> "Numbers":
        return Numbers(*(a + b for a, b in zip(self, other, strict=True)))

    def __sub__(self, other: "Numbers") -> "Numbers":
        return Numbers(*(a - b for a, b in zip(self, other, strict=True)))

    def __mul__(self, factor: Number) -> "Numbers":
        return Numbers(*(a * factor for a in self))

    __rmul__ = __mul__


def _dot(a: Numbers, b: Numbers) -> Number:
    total = a[0] * b[0]
    for x, y in zip(a.items[1:], b.items[1:], strict=True):
        total = total + x * y
    return total


class Counter:
    """Runs the Python source of Warp functions on counting numbers."""

    def __init__(self) -> None:
        self.tally = Tally()
        self.words = SimpleNamespace(
            dot=_dot, sqrt=self._root, cbrt=self._root, abs=self._abs, min=builtins.min, max=builtins.max
        )

    def _root(self, x: Number) -> Number:
        self.tally.roots += 1
        return Number(sqrt(x.value), self.tally) if x.value >= 0.0 else Number(float("nan"), self.tally)

    def _abs(self, x: Number) -> Number:
        return Number(abs(x.value), self.tally)

    def number(self, value: Any) -> Number:
        """A real number."""
        return Number(float(value.value if isinstance(value, Number) else value), self.tally)

    def vector(self, values: Any) -> Numbers:
        """A vector."""
        return Numbers(*(self.number(value) for value in values))

    def function(self, warp_function: Any) -> Callable[..., Any]:
        """The Python source of a Warp function, on counting numbers.

        Raises
        ------
        TypeError
            If it is not written in Python.
        """
        source = warp_function.func
        if source.__name__ == "four":  # loads four numbers of a row, no arithmetic
            return lambda row, place: Numbers(*(row[place + k] for k in range(4)))
        if warp_function.native_snippet is not None:
            raise TypeError(f"{warp_function.key} is native code: its operations cannot be counted")
        cells = tuple(CellType(self._stand_in(cell.cell_contents)) for cell in source.__closure__ or ())
        known = {**source.__globals__, "wp": self.words}
        return FunctionType(source.__code__, known, source.__name__, source.__defaults__, cells)

    def _stand_in(self, thing: Any) -> Any:
        if isinstance(thing, wp.Function):
            return self.function(thing)
        if isinstance(thing, (wp.float32, wp.float64)):
            return self.number(thing.value)
        if thing in (wp.float32, wp.float64):
            return self.number
        if thing in (wp.vec4f, wp.vec4d):
            return lambda *items: Numbers(*items) if items else self.vector([0.0] * 4)
        return thing


@dataclass(frozen=True)
class Cost:
    """Arithmetic of one element update, including its share of the nodes and of the step bound."""

    operations: float
    """Floating-point operations."""
    instructions: float
    """Arithmetic instructions where products are fused with the sums they go into."""
    divisions: float
    """Divisions and roots among these operations; they take longer than the others."""


def cost(model: Model, measure_every: int) -> Cost:
    """Count an element update of a model whose step bound is measured every `measure_every` steps."""
    plain, bounded = count(model, measure=False), count(model, measure=True)
    nodes = model.mesh.n_nodes / model.mesh.n_elements

    def whole(name: Callable[[Tally], int]) -> float:
        return name(plain) + (name(bounded) - name(plain)) / measure_every

    return Cost(
        operations=whole(lambda t: t.operations) + nodes * NODE_OPERATIONS,
        instructions=whole(lambda t: t.instructions) + nodes * NODE_INSTRUCTIONS,
        divisions=whole(lambda t: t.divisions + t.roots),
    )


def count(model: Model, *, measure: bool) -> Tally:
    """Count the operations for the forces of the central element of a mesh at about 10 % strain, moving and
    damped."""
    numbers, mesh = PRECISIONS["fp64"], model.mesh
    functions = element(model.element).functions(type(model.materials[0]), numbers)
    constants = element(model.element).shapes(mesh, model.density, functions.Shape.numpy_dtype())
    middle = mesh.n_elements // 2
    counter = Counter()

    def value(entry: Any) -> Any:
        return counter.number(entry) if np.ndim(entry) == 0 else counter.vector(entry)

    shape = SimpleNamespace(**{name: value(constants[middle][name]) for name in functions.Shape.vars})
    solid = SimpleNamespace(**{name: counter.number(1.0) for name in functions.Solid.vars})
    row = counter.vector(model.materials[0].parameters())
    r, y = mesh.nodes[mesh.quads[middle]].T
    u_r, u_y = 0.05 * r, -0.1 * y + 0.02 * r
    state = [counter.vector(field) for field in (u_r, u_y, 100.0 * u_r, 100.0 * u_y)]
    counter.function(functions.forces)(shape, solid, row, *state, int(measure))
    return counter.tally

"""Values of a Warp function's expressions while it is turned into lanes of SIMD code.

A value is *uniform*, the same in every lane and a plain C++ scalar, or *varying*, one entry a lane and a C++
vector ("pack"). Vectors of Warp are kept as their components, structs and arrays as references.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, isnan
from typing import Any, TypeAlias

import warp as wp

PACK = {"i32": "i32v", "f32": "f32v", "f64": "f64v", "bool": "mask"}
"""C++ type of a varying value of each kind."""
SCALAR = {"i32": "int", "f32": "float", "f64": "double", "bool": "bool"}
"""C++ type of a uniform value of each kind."""
KINDS = {wp.float32: "f32", wp.float64: "f64", wp.int32: "i32", int: "i32", float: "f32", wp.bool: "bool"}
"""Kind of each Warp scalar type."""


@dataclass(frozen=True)
class Scalar:
    """One number or truth value."""

    kind: str
    """ "i32", "f32", "f64" or "bool"."""
    code: str
    """C++ expression without side effects: a name or a literal."""
    varying: bool = False
    """Whether the lanes differ."""
    const: int | bool | None = None
    """Its value where the translator knows it."""
    lane: bool = False
    """Whether it counts up from lane to lane."""
    root: str = ""
    """For a varying integer that is another plus a known number: the other, so that gathers share it."""
    shift: int = 0
    """That number."""

    @property
    def ctype(self) -> str:
        """C++ type."""
        return (PACK if self.varying else SCALAR)[self.kind]

    @property
    def is_float(self) -> bool:
        """True for a floating-point number."""
        return self.kind in ("f32", "f64")


@dataclass(frozen=True)
class Vector:
    """A Warp vector by its components."""

    items: tuple[Scalar, ...]
    """Components, all of one kind."""
    bank: str = ""
    """C++ array of the components where they are the partial sums over elements or nodes."""


@dataclass(frozen=True)
class Struct:
    """A Warp struct: a C++ reference where uniform, its loaded fields where varying."""

    type: Any
    """The Warp struct."""
    code: str = ""
    """C++ name of a uniform struct."""
    fields: dict[str, "Value"] | None = None
    """Fields of a varying struct, each in packs."""


@dataclass(frozen=True)
class Array:
    """A Warp array of which some leading subscripts may be given already. Rows are contiguous."""

    name: str
    """C++ name of the pointer to its first element; ``{name}_s{k}`` is the stride of subscript k."""
    dtype: Any
    """Warp type of the elements."""
    ndim: int
    """Number of dimensions of the whole array."""
    given: int = 0
    """How many subscripts are given."""
    offset: Scalar | None = None
    """Elements from the first one to what the given subscripts name."""
    scratch: bool = False
    """Whether it holds the rows of one pack only, so that the first subscript, the simulation, is implied."""
    lanes_inside: bool = False
    """Whether the lanes of an entry of such an array lie side by side."""
    spare: bool = False
    """Whether a pack may be read from any of its entries on."""
    header: Any = None
    """Entries of a row that were loaded where the row was named, by their subscript."""


@dataclass(frozen=True)
class Known:
    """A Python object the source refers to: a module, a type, a Warp function or builtin."""

    thing: Any


Value: TypeAlias = Scalar | Vector | Struct | Array | Known | tuple
"""Anything an expression can stand for; a tuple is what a function with several results returns."""
Emit: TypeAlias = Callable[[str], None]


def kind_of(dtype: Any) -> str:
    """Kind of a Warp scalar type.

    Raises
    ------
    TypeError
        If it has none.
    """
    if dtype not in KINDS:
        raise TypeError(f"no SIMD kind for {dtype}; known: {sorted(set(KINDS.values()))}")
    return KINDS[dtype]


def is_vector(dtype: Any) -> bool:
    """True if a Warp type is a vector of fixed length."""
    return hasattr(dtype, "_length_") and hasattr(dtype, "_wp_scalar_type_")


def is_struct(dtype: Any) -> bool:
    """True if a Warp type is a struct."""
    return hasattr(dtype, "vars") and hasattr(dtype, "native_name")


def literal(value: int | float | bool, kind: str) -> Scalar:
    """A known number as C++ writes it."""
    if kind == "bool":
        return Scalar("bool", "true" if value else "false", const=bool(value))
    if kind == "i32":
        return Scalar("i32", f"({int(value)})", const=int(value))
    if not isfinite(value):
        sign, name = "-" if value < 0 else "", "nan" if isnan(value) else "inf"
        argument = '""' if name == "nan" else ""
        return Scalar(kind, f"({SCALAR[kind]})({sign}__builtin_{name}({argument}))")
    text = float(value).hex()
    return Scalar(kind, f"({text})" if kind == "f64" else f"({text}f)")

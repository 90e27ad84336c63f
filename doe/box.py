"""A box of named parameters, and design constraints written by a user.

A design, a surrogate or a search depends on a problem only through its box. A constraint is text, such as
"friction <= 2 * stiffness_factor - 1".
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from doe.arrays import FloatArray

ROUND_OFF = 1e-12
"""A point outside a face counts as on it if its distance in the unit box is smaller than this. The conversion
from units to the unit box and back has an error of a few 1e-16, times |bound| / edge."""


@dataclass(frozen=True)
class Box:
    """Named parameters, each between two bounds.

    Designs, surrogates and searches work in the *unit box* [0, 1]^d; a logarithmic parameter is
    uniform in its logarithm there.

    Raises
    ------
    ValueError
        If a name is empty or used twice, the lengths differ, a bound is not finite, a lower bound is
        not below its upper bound, or a logarithmic parameter has a lower bound <= 0.

    Examples
    --------
    >>> from doe import Box
    >>> box = Box.of({"friction": (0.0, 2.0), "stiffness_factor": (0.75, 1.25)})
    >>> box.scale([0.5, 0.5]).tolist()
    [1.0, 1.0]
    """

    names: tuple[str, ...]
    lower: tuple[float, ...]
    """Lower bounds in parameter units, length d."""
    upper: tuple[float, ...]
    """Upper bounds in parameter units, length d."""
    logarithmic: tuple[bool, ...] = ()
    """Whether each parameter is uniform in its logarithm, length d; none if left out."""

    def __post_init__(self) -> None:
        if isinstance(self.names, str):
            raise ValueError(
                f"names must be a tuple of names, got the text {self.names!r}: write ({self.names!r},)"
            )
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "lower", tuple(float(value) for value in self.lower))
        object.__setattr__(self, "upper", tuple(float(value) for value in self.upper))
        logarithmic = tuple(bool(value) for value in self.logarithmic) or (False,) * len(self.names)
        object.__setattr__(self, "logarithmic", logarithmic)
        self._validate()

    def _validate(self) -> None:
        d = len(self.names)
        if d == 0:
            raise ValueError("a box needs at least one parameter, got none")
        for field in ("lower", "upper", "logarithmic"):
            if len(getattr(self, field)) != d:
                raise ValueError(f"{field} must have one entry a name ({d}), got {len(getattr(self, field))}")
        for name in self.names:
            if not name:
                raise ValueError("a parameter name is empty")
            if self.names.count(name) > 1:
                raise ValueError(
                    f"parameter name {name!r} is used {self.names.count(name)} times; names must differ"
                )
        for name, lower, upper, logarithmic in zip(
            self.names, self.lower, self.upper, self.logarithmic, strict=True
        ):
            if not (np.isfinite(lower) and np.isfinite(upper) and np.isfinite(upper - lower)):
                raise ValueError(f"bounds of {name!r} must be finite, got [{lower}, {upper}]")
            if not lower < upper:
                raise ValueError(
                    f"lower bound of {name!r} must be below its upper bound, got [{lower}, {upper}]"
                )
            if logarithmic and not lower > 0.0:
                raise ValueError(f"logarithmic parameter {name!r} needs a lower bound > 0, got {lower}")

    @classmethod
    def of(cls, bounds: Mapping[str, tuple[float, float]], *, logarithmic: Sequence[str] = ()) -> Box:
        """A box from lower and upper bounds by name, and the names of the parameters that are uniform in
        their logarithm.

        Raises ValueError if `logarithmic` names a parameter that `bounds` does not, or the box is not valid.
        """
        unknown = sorted(set(logarithmic) - set(bounds))
        if unknown:
            raise ValueError(f"logarithmic names {unknown}, but the parameters are {sorted(bounds)}")
        return cls(
            names=tuple(bounds),
            lower=tuple(pair[0] for pair in bounds.values()),
            upper=tuple(pair[1] for pair in bounds.values()),
            logarithmic=tuple(name in logarithmic for name in bounds),
        )

    @property
    def dimension(self) -> int:
        """Number of parameters d."""
        return len(self.names)

    def scale(self, unit_points: ArrayLike) -> FloatArray:
        """Points of the unit box in parameter units, shape [..., d]; 0 and 1 give the bounds to the last bit.

        A linear parameter is x = (1 - u) a + u b, a logarithmic one x = a^(1 - u) b^u, with a and b the
        bounds. Nothing is clipped: u outside [0, 1] gives x outside the box. Raises ValueError if the last
        axis is not d long or a coordinate is not finite.
        """
        u = self._checked(unit_points)
        x = np.empty_like(u)
        for j, (a, b, logarithmic) in enumerate(zip(self.lower, self.upper, self.logarithmic, strict=True)):
            v = u[..., j]
            x[..., j] = a ** (1.0 - v) * b**v if logarithmic else a * (1.0 - v) + b * v
        return x

    def unit(self, points: ArrayLike) -> FloatArray:
        """Points in parameter units as coordinates of the unit box, shape [..., d], the inverse of `scale`.

        Raises ValueError if the last axis is not d long, a value is not finite, or a logarithmic parameter is
        <= 0.
        """
        x = self._checked(points)
        u = np.empty_like(x)
        for j, (a, b, logarithmic) in enumerate(zip(self.lower, self.upper, self.logarithmic, strict=True)):
            v = x[..., j]
            if logarithmic:
                if np.any(v <= 0.0):
                    raise ValueError(f"logarithmic parameter {self.names[j]!r} must be > 0, got {v.min()}")
                u[..., j] = (np.log(v) - np.log(a)) / (np.log(b) - np.log(a))
            else:
                u[..., j] = (v - a) / (b - a)
        return u

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Mask of points, shape [..., d], that are in the box or on its faces (within 1e-12 of the edge, for
        round-off).

        Raises ValueError if the last axis is not d long or a value is not finite.
        """
        return np.asarray(self._inside(self._checked(points)).all(axis=-1))

    def require(self, points: ArrayLike, *, what: str) -> FloatArray:
        """The points as an array [n, d], after a check that all lie in the box.

        ``what``: what a row is, for the message, e.g. "run". Raises ValueError if the shape is not [n, d], a
        value is not finite, or a point lies outside. The message names the row, the parameter, the value and
        the bounds.
        """
        x = self._checked(points)
        if x.ndim != 2:
            raise ValueError(f"points must have shape [n, {self.dimension}], got {list(x.shape)}")
        outside = np.argwhere(~self._inside(x))
        if len(outside):
            row, j = outside[0]
            raise ValueError(
                f"{what} {row}: {self.names[j]} = {x[row, j]:.12g} is outside "
                f"[{self.lower[j]:.12g}, {self.upper[j]:.12g}]"
            )
        return x

    def around(self, centre: ArrayLike, fraction: float) -> Box:
        """A smaller box about a point, shape [d], with `fraction` of this box's edges, intersected with this
        one.

        Edges are measured in the unit box, so a logarithmic parameter has the same ratio everywhere. The part
        outside this box is cut off. Near a face the new box is therefore shorter, and `centre` is not its
        middle. Raises ValueError if `centre` is outside this box or `fraction` outside (0, 1].
        """
        if not 0.0 < fraction <= 1.0:
            raise ValueError(f"fraction must be in (0, 1], got {fraction}")
        u = self.unit(self.require(np.atleast_2d(np.asarray(centre, dtype=np.float64)), what="centre"))[0]
        lower = self.scale(np.maximum(u - 0.5 * fraction, 0.0))
        upper = self.scale(np.minimum(u + 0.5 * fraction, 1.0))
        return Box(self.names, tuple(lower.tolist()), tuple(upper.tolist()), self.logarithmic)

    def as_dict(self, point: ArrayLike) -> dict[str, float]:
        """One point, shape [d], as values by name; ValueError if it is not d long or not finite."""
        x = self._checked(point)
        if x.ndim != 1:
            raise ValueError(f"a point must have shape [{self.dimension}], got {list(x.shape)}")
        return dict(zip(self.names, x.tolist(), strict=True))

    def _inside(self, x: FloatArray) -> NDArray[np.bool_]:
        # A logarithmic parameter <= 0 has no unit coordinate; it is always outside.
        positive = np.where(np.array(self.logarithmic), x, 1.0) > 0.0
        u = self.unit(np.where(positive, x, np.array(self.upper)))
        return np.asarray(positive & (u >= -ROUND_OFF) & (u <= 1.0 + ROUND_OFF))

    def _checked(self, points: ArrayLike) -> FloatArray:
        x = np.asarray(points, dtype=np.float64)
        if x.ndim == 0 or x.shape[-1] != self.dimension:
            raise ValueError(
                f"the last axis must hold the {self.dimension} parameters {list(self.names)}, "
                f"got shape {list(x.shape)}"
            )
        if not np.all(np.isfinite(x)):
            row = np.argwhere(~np.isfinite(x))[0]
            raise ValueError(
                f"{self.names[row[-1]]} is {x[tuple(row)]} at index {row[:-1].tolist()}; must be finite"
            )
        return x


LONGEST = 500
"""Largest number of characters of a constraint. It is enough for manual input and protects the parser."""
ARITHMETIC: dict[type[ast.operator], Callable[[FloatArray, FloatArray], FloatArray]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
COMPARISONS: dict[type[ast.cmpop], Callable[[FloatArray, FloatArray], NDArray[np.bool_]]] = {
    ast.LtE: operator.le,
    ast.Lt: operator.lt,
    ast.GtE: operator.ge,
    ast.Gt: operator.gt,
}


class Constraint:
    """A comparison of two arithmetic expressions in parameters and numbers.

    ``text``: such as "friction * damping < 1e-5". Chains such as "0.1 < friction < stiffness_factor" are
    allowed. Only ``+ - * / **``, brackets, numbers and names are accepted. The text is parsed but not
    executed. ``names``: the parameters that it may use. Raises ValueError if the text is not of this kind or
    uses another name.
    """

    def __init__(self, text: str, names: tuple[str, ...]) -> None:
        self.text, self.names = text, names
        try:
            if len(text) > LONGEST:
                raise ValueError(f"it is longer than {LONGEST} characters")
            body = ast.parse(text.strip(), mode="eval").body
            if not isinstance(body, ast.Compare):
                raise ValueError("there is no <= or >= in it")
            self._comparison = body
            _compare(body, dict.fromkeys(names, np.ones(1)))
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            message = error.msg if isinstance(error, SyntaxError) else str(error)
            raise ValueError(f"{text[:80]!r} cannot be read: {message}") from None

    def __call__(self, points: FloatArray) -> NDArray[np.bool_]:
        """Points that meet the constraint. ``points``: values in SI, shape [n, d], one column for each name.
        Returns: shape [n]. It is also False where the result of the arithmetic is not finite."""
        return _compare(self._comparison, dict(zip(self.names, points.T, strict=True)))


def _compare(node: ast.Compare, values: Mapping[str, FloatArray]) -> NDArray[np.bool_]:
    sides = [_value(side, values) for side in (node.left, *node.comparators)]
    met = np.all(np.isfinite(np.broadcast_arrays(*sides)), axis=0)
    for kind, left, right in zip(node.ops, sides[:-1], sides[1:], strict=True):
        if type(kind) not in COMPARISONS:
            raise ValueError("only <, <=, > and >= compare")
        met = met & COMPARISONS[type(kind)](left, right)
    shape = np.broadcast_shapes(*(side.shape for side in values.values()))
    return np.array(np.broadcast_to(met, shape))


def _value(node: ast.expr, values: Mapping[str, FloatArray]) -> FloatArray:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.asarray(float(number))
        case ast.Name(id=name):
            if name not in values:
                raise ValueError(f"{name} is not varied; varied are {', '.join(values)}")
            return values[name]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
            with np.errstate(all="ignore"):  # a value that is not finite meets no constraint
                return np.asarray(ARITHMETIC[type(op)](_value(left, values), _value(right, values)))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, values)
    raise ValueError(f"{ast.unparse(node)[:40]!r} is neither a number, a parameter nor one of + - * / **")

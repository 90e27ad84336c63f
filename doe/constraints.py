"""Constraints of a design as a user writes them: "friction <= 2 * stiffness_factor - 1"."""

import ast
import operator
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from doe.arrays import FloatArray

LONGEST = 500
"""Most characters of a constraint: what a person writes, and nothing that exhausts a parser."""
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

    Parameters
    ----------
    text
        Such as "friction * damping < 1e-5"; chains as "0.1 < friction < stiffness_factor" are allowed.
        Nothing but ``+ - * / **``, brackets, numbers and names: it is read, not run.
    names
        The parameters that may stand in it.

    Raises
    ------
    ValueError
        If the text is not of this kind or names something else.
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
            said = error.msg if isinstance(error, SyntaxError) else str(error)
            raise ValueError(f"{text[:80]!r} cannot be read: {said}") from None

    def __call__(self, points: FloatArray) -> NDArray[np.bool_]:
        """Points that meet the constraint.

        Parameters
        ----------
        points
            Values in SI, shape [n, d], a column a name.

        Returns
        -------
        met
            Shape [n]; False also where the arithmetic has no finite result.
        """
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
            with np.errstate(all="ignore"):  # what is not finite meets no constraint
                return np.asarray(ARITHMETIC[type(op)](_value(left, values), _value(right, values)))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, values)
    raise ValueError(f"{ast.unparse(node)[:40]!r} is neither a number, a parameter nor one of + - * / **")

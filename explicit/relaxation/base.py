"""The interface of branches that relax, and the tensors that their Warp functions share.

Tensors are symmetric and axisymmetric (rr, yy, ry, tt). They are mapped between the reference and the current
configuration.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import warp as wp

from explicit.arrays import FloatArray
from explicit.precision import Precision


@dataclass(frozen=True)
class PointFunctions:
    """The Warp functions of one stress point."""

    relax: Any
    """``relax(weight, gradient_r, gradient_y, hoop, inverse_mass_r, inverse_mass_y, scale, row, branches,
    memory, first, stride, e, ur, uy, vr, vy, moved, interval, measure) -> (f_r, f_y, done, omega_squared)``:
    corner forces to be added to those of the law at its instantaneous stiffness `scale` [N], work done on the
    branches since the last call in addition to `branch_energy` [J], and their share of the step bound
    [1/s^2]. The k-th state variable is ``memory[(first + k) * stride + e]``, 0 at rest. `moved` is the last
    step. `interval` is the time from the middle of this step to the middle of the next one [s]."""
    branch_energy: Any
    """``branch_energy(weight, gradient_r, gradient_y, hoop, scale, row, branches, memory, first, stride, e,
    ur, uy)``: the part of the work done on the branches that depends only on the present state [J]."""
    memory: int
    """Number of state variables of a stress point."""


class Relaxation(Protocol):
    """A kind of branches, with the largest number of branches in a batch; hashable."""

    @property
    def index_of_rest(self) -> int:
        """Index at which a row of `rows` has the long-term stiffness over the instantaneous one."""
        ...

    def __hash__(self) -> int:
        """Key under which compiled time loops are stored."""
        ...

    def point(self, law: type, precision: Precision, bound: str) -> PointFunctions:
        """Generate the functions of a stress point for a material law and a precision."""
        ...


class RateDependence(Protocol):
    """Entry of `explicit.Model.relaxation`: a series or a network with the constants of one material."""

    @property
    def instantaneous(self) -> float:
        """Instantaneous over long-term stiffness [-], >= 1."""
        ...

    def __len__(self) -> int:
        """Number of branches."""
        ...

    def row(self, n_branches: int) -> FloatArray:
        """The numbers for the kernels, for a given number of branches."""
        ...

    @staticmethod
    def kind(n_branches: int) -> Relaxation:
        """Generator of the kernels for a given number of branches."""
        ...


@dataclass(frozen=True)
class TensorFunctions:
    """Push and pull by F = (f11, f12; f21, f22) in the plane and f33 around it."""

    push: Any
    """``push(A, f11, f12, f21, f22, f33)``: F A F^T."""
    pull: Any
    """``pull(A, f11, f12, f21, f22, f33)``: F^-1 A F^-T."""
    norm: Any
    """``norm(A)``: sqrt(A : A)."""


@cache
def tensor_functions(precision: Precision) -> TensorFunctions:
    """Generate the functions."""
    real, vec4 = precision.real, precision.vec4
    one, two = real(1.0), real(2.0)

    @wp.func
    def push(A: vec4, f11: real, f12: real, f21: real, f22: real, f33: real):
        rr = f11 * f11 * A[0] + two * f11 * f12 * A[2] + f12 * f12 * A[1]
        yy = f21 * f21 * A[0] + two * f21 * f22 * A[2] + f22 * f22 * A[1]
        ry = f11 * f21 * A[0] + (f11 * f22 + f12 * f21) * A[2] + f12 * f22 * A[1]
        return vec4(rr, yy, ry, f33 * f33 * A[3])

    @wp.func
    def pull(A: vec4, f11: real, f12: real, f21: real, f22: real, f33: real):
        per_area, per_hoop = one / (f11 * f22 - f12 * f21), one / f33
        return push(A, f22 * per_area, -f12 * per_area, -f21 * per_area, f11 * per_area, per_hoop)

    @wp.func
    def norm(A: vec4):
        return wp.sqrt(A[0] * A[0] + A[1] * A[1] + two * A[2] * A[2] + A[3] * A[3])

    return TensorFunctions(push, pull, norm)

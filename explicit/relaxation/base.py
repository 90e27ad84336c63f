"""The door for branches that relax: what the time loop asks of a kind of them."""

from dataclasses import dataclass
from typing import Any, Protocol

from explicit.arrays import FloatArray
from explicit.precision import Precision


@dataclass(frozen=True)
class PointFunctions:
    """The Warp functions of one stress point."""

    relax: Any
    """``relax(weight, gradient_r, gradient_y, hoop, inverse_mass_r, inverse_mass_y, scale, row, branches,
    memory, first, stride, e, ur, uy, vr, vy, moved, interval, measure)
    -> (f_r, f_y, done, omega_squared)``: corner forces to be added to those of the law at its instantaneous
    stiffness `scale` [N], what was done on the branches since the last call beyond what `held` knows [J], and
    their share of the step bound [1/s^2]. The k-th number remembered is ``memory[(first + k) * stride + e]``,
    0 at rest; `moved` is the step that led here, `interval` the time from the middle of that step to the
    middle of the next [s]."""
    held: Any
    """``held(weight, gradient_r, gradient_y, hoop, scale, row, branches, memory, first, stride, e, ur, uy)``:
    what was done on the branches, as far as the present state knows it [J]."""
    memory: int
    """Numbers that a stress point remembers."""


class Relaxation(Protocol):
    """A kind of branches, with as many of them as a batch has at most; hashable."""

    @property
    def index_of_rest(self) -> int:
        """Index at which a row of `rows` has the long-term stiffness over the instantaneous one."""
        ...

    def __hash__(self) -> int:
        """Time loops are kept by it."""
        ...

    def point(self, law: type, precision: Precision, bound: str) -> PointFunctions:
        """Generate the functions of a stress point for a material law and a precision."""
        ...


class RateDependence(Protocol):
    """Entry of `explicit.Model.relaxation`: a series or a network, the numbers of one material."""

    @property
    def instantaneous(self) -> float:
        """Instantaneous over long-term stiffness [-], >= 1."""
        ...

    def __len__(self) -> int:
        """Branches."""
        ...

    def row(self, n_branches: int) -> FloatArray:
        """The numbers for the kernels, of as many branches."""
        ...

    @staticmethod
    def kind(n_branches: int) -> Relaxation:
        """Generator of the kernels of as many branches."""
        ...

"""The histories that an instrument could record, in one bundle: values, derivatives, errors or cotangents."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields

import numpy as np

from explicit.arrays import FloatArray
from explicit.response import Response


@dataclass(frozen=True)
class Histories:
    """Forces, impulses and the side surface at the times of an `explicit.Sampling`.

    Leading axes, if any, are said where the bundle is used: samples, parameters or none. Units are those of
    the values; a derivative is per unit of its parameter, a cotangent is per unit of the value.
    """

    force_flyer: FloatArray
    """Force of the flyer's platen [N], shape [..., n_force_times]."""
    force_transmission: FloatArray
    """Force on the transmission platen [N], shape [..., n_force_times]."""
    impulse_flyer: FloatArray
    """Time integral of the flyer force [N s], shape [..., n_force_times]."""
    impulse_transmission: FloatArray
    """Time integral of the transmission force [N s], shape [..., n_force_times]."""
    surface_r: FloatArray
    """Radius of the side surface's nodes [m], shape [..., n_surface_times, n_surface_nodes]."""
    surface_y: FloatArray
    """Height of the same nodes [m], shape [..., n_surface_times, n_surface_nodes]."""

    @classmethod
    def of(cls, response: Response) -> "Histories":
        """The histories of a batch, samples first."""
        return cls(**{name: getattr(response, name) for name in NAMES})

    @classmethod
    def zeros(cls, n_force_times: int, n_surface_times: int, n_surface_nodes: int) -> "Histories":
        """Nothing yet, without leading axes: where a cotangent begins."""
        surface: tuple[int, ...] = (n_surface_times, n_surface_nodes)
        shapes = [(n_force_times,)] * 4 + [surface] * 2
        return cls(**{name: np.zeros(shape) for name, shape in zip(NAMES, shapes, strict=True)})

    def items(self) -> Iterator[tuple[str, FloatArray]]:
        """Name and array of every history."""
        return ((name, getattr(self, name)) for name in NAMES)

    def map(self, change: Callable[[FloatArray], FloatArray]) -> "Histories":
        """The same bundle with every array changed."""
        return Histories(**{name: change(values) for name, values in self.items()})


NAMES: tuple[str, ...] = tuple(field.name for field in fields(Histories))
"""Names of the histories, in order."""

"""The unknowns that shots share: parameters of the simulated test, and nodes of the curve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.parameters import MOVED, design_box
from kolsky.inverse.surrogate_mesh_search import from_search, search_box, to_search

NODE_RANGE = 1.5
"""Largest logarithm of a node's factor, up or down [-]."""


@dataclass(frozen=True)
class Unknowns:
    """Shared unknowns in one order: parameters, then logarithms of the factors at the curve's nodes."""

    bounds: Mapping[str, tuple[float, float] | None]
    """Parameters and their bounds, None for the default ones."""
    nodes: int = 0
    """Nodes of the curve; with them the stiffness factor is 1 by what they mean."""

    def __post_init__(self) -> None:
        if self.nodes and MOVED in self.bounds:
            raise ValueError(f"{MOVED} is the mean of the curve's nodes: it cannot be free beside them")

    @cached_property
    def parameters(self) -> Box | None:
        """The parameters' box in their own units; None if only nodes are free."""
        return design_box(self.bounds) if self.bounds else None

    @property
    def n_parameters(self) -> int:
        """Free parameters."""
        return len(self.bounds)

    @property
    def node_names(self) -> tuple[str, ...]:
        """Names of the nodes."""
        return tuple(f"curve_{k}" for k in range(1, self.nodes + 1))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all unknowns."""
        return (*self.bounds, *self.node_names)

    @cached_property
    def box(self) -> Box:
        """All unknowns in their own units."""
        return _joined(self.parameters, self.node_names)

    @property
    def widths(self) -> FloatArray:
        """Widths of their ranges, in their own units, shape [d]."""
        return np.array(self.box.upper) - np.array(self.box.lower)

    @cached_property
    def inner(self) -> Box:
        """All unknowns in the coordinates of the search."""
        return _joined(None if self.parameters is None else search_box(self.parameters), self.node_names)

    def to_search(self, x: FloatArray) -> FloatArray:
        """Points in the coordinates of the search, shape [..., d]."""
        found = np.array(x, dtype=np.float64)
        if self.parameters is not None:
            n = self.n_parameters
            found[..., :n] = to_search(self.parameters, found[..., :n])
        return found

    def from_search(self, x: FloatArray) -> FloatArray:
        """The inverse of `to_search`."""
        found = np.array(x, dtype=np.float64)
        if self.parameters is not None:
            n = self.n_parameters
            found[..., :n] = from_search(self.parameters, found[..., :n])
        return found

    def relative_stiffness(self, slopes: FloatArray, x: FloatArray) -> FloatArray:
        """Derivative of the data by the logarithm of the whole stiffness, shape [k].

        Parameters
        ----------
        slopes
            By the unknowns, shape [k, d].
        x
            Where, shape [d].
        """
        if self.nodes:
            return np.asarray(slopes[:, self.n_parameters :].sum(axis=1))
        i = self.names.index(MOVED)
        return np.asarray(slopes[:, i] * x[i])


def node_strains(curve: MaterialCurve, nodes: int) -> FloatArray:
    """Nominal strains of the nodes, equally far apart from rest to the curve's end, shape [nodes]."""
    return np.asarray(np.linspace(0.0, float(curve.stretch[-1]) - 1.0, nodes))


def with_factors(curve: MaterialCurve, logs: FloatArray) -> FloatArray:
    """Stress of the curve times its nodes' factors, whose logarithm is linear in the strain between them.

    Parameters
    ----------
    curve
        The slow curve.
    logs
        Logarithms of the factors at `node_strains`, shape [nodes].
    """
    place = np.abs(node_strains(curve, len(logs)))
    return np.asarray(curve.stress * np.exp(np.interp(np.abs(curve.stretch - 1.0), place, logs)))


def smoothness(nodes: int, roughness: float) -> FloatArray:
    """Rows of the prior: second differences over their standard deviation, shape [nodes - 2, nodes]."""
    return np.diff(np.eye(nodes), n=2, axis=0) / roughness


def _joined(parameters: Box | None, nodes: tuple[str, ...]) -> Box:
    bounds: dict[str, tuple[float, float]] = {}
    decades: list[str] = []
    if parameters is not None:
        bounds |= {
            name: (low, high)
            for name, low, high in zip(parameters.names, parameters.lower, parameters.upper, strict=True)
        }
        decades = [name for name, log in zip(parameters.names, parameters.logarithmic, strict=True) if log]
    bounds |= {name: (-NODE_RANGE, NODE_RANGE) for name in nodes}
    return Box.of(bounds, logarithmic=decades)

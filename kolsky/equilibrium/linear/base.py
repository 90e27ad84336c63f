"""The interface of a linear solver, and sums of element arrays into vectors and CSR matrices."""

from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array

from explicit.arrays import FloatArray, IntArray


class SingularError(ValueError):
    """The matrix is singular, or an iteration did not converge."""


class Factors(Protocol):
    """A factorised matrix."""

    def solve(self, right: FloatArray) -> FloatArray:
        """Solutions of K x = b for columns b, shape [n] or [n, n_right]."""
        ...


ENTRIES = 20_000_000
"""Maximum number of matrix entries that are sorted together, which limits the memory [-]."""


class Pattern:
    """Positions of the entries of element arrays in vectors and matrices."""

    def __init__(self, dofs: IntArray, index: IntArray, count: int) -> None:
        """Store the components of each cell, shape [m, k d], the unknown of each component, and the number of
        unknowns. The unknown -1 means none."""
        self.dofs, self.index, self.count = dofs, index, count

    def vector(self, elements: FloatArray) -> FloatArray:
        """Sum of element vectors [m, k d] over all components, shape [n d]."""
        return _summed(self.dofs.ravel(), elements.ravel(), len(self.index))

    def reduced(self, full: FloatArray) -> FloatArray:
        """A vector over all components, summed to the unknowns, shape [count] of [n d] (or [..., n d])."""
        free = self.index >= 0
        if full.ndim == 1:
            return _summed(self.index[free], full[free], self.count)
        return np.array([self.reduced(row) for row in full.reshape(-1, full.shape[-1])]).reshape(
            *full.shape[:-1], self.count
        )

    def expanded(self, unknowns: FloatArray) -> FloatArray:
        """Unknowns in all components, shape [..., n d] of [..., count]. Components without an unknown are
        0."""
        padded = np.concatenate([unknowns, np.zeros((*unknowns.shape[:-1], 1))], axis=-1)
        return padded[..., self.index]

    @cached_property
    def _structure(self) -> tuple[list[IntArray], IntArray, IntArray]:
        """For each group of cells, the place of each entry, with -1 for none; columns and row starts."""
        local = self.index[self.dofs]
        entries = max(local.shape[1] ** 2, 1)
        groups = np.array_split(local, max(1, len(local) * entries // ENTRIES))
        found: IntArray = np.empty(0, dtype=np.int64)
        for group in groups:
            found = np.union1d(found, self._keys(group))
        found = found[found >= 0]
        places = []
        for group in groups:
            keys = self._keys(group)
            place = np.searchsorted(found, keys).astype(np.int32 if len(found) < 2**31 else np.int64)
            places.append(np.where(keys >= 0, place, place.dtype.type(-1)))
        return places, found % self.count, np.searchsorted(found // self.count, np.arange(self.count + 1))

    def _keys(self, local: IntArray) -> IntArray:
        """Row and column of each entry of the cells' matrices as one number; -1 if either is missing."""
        rows, columns = local[:, :, None], local[:, None, :]
        return np.where((rows >= 0) & (columns >= 0), rows * self.count + columns, -1).ravel()

    def matrix(self, elements: FloatArray) -> csr_array:
        """Sum of element matrices [m, k d, k d] over the unknowns."""
        places, columns, starts = self._structure
        data = np.zeros(len(columns))
        first = 0
        for place in places:
            kept = place >= 0
            values = elements.reshape(-1)[first : first + len(place)]
            np.add.at(data, place[kept], values[kept])
            first += len(place)
        return csr_array((data, columns, starts), shape=(self.count, self.count))


def _summed(places: IntArray, values: FloatArray, size: int) -> FloatArray:
    """Sums of the values of each place, shape [size]."""
    return np.asarray(np.bincount(places, weights=values, minlength=size), dtype=np.float64)

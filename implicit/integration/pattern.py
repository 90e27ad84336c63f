"""Sums of element arrays: nodal vectors, and matrices in CSR with a pattern that is found once."""

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from explicit.arrays import FloatArray, IntArray


class Pattern:
    """Where each entry of an element's array goes."""

    def __init__(self, dofs: IntArray, index: IntArray, count: int) -> None:
        """Take the components of each cell, shape [m, k d], the unknown of each component (-1: none), and the
        number of unknowns."""
        self.dofs, self.index, self.count = dofs, index, count

    def vector(self, elements: FloatArray) -> FloatArray:
        """Sum of element vectors [m, k d] over all components, shape [n d]."""
        return _summed(self.dofs.ravel(), elements.ravel(), len(self.index))

    def reduced(self, full: FloatArray) -> FloatArray:
        """A vector over all components summed into the unknowns, shape [count] of [n d] (or [..., n d])."""
        free = self.index >= 0
        if full.ndim == 1:
            return _summed(self.index[free], full[free], self.count)
        return np.array([self.reduced(row) for row in full.reshape(-1, full.shape[-1])]).reshape(
            *full.shape[:-1], self.count
        )

    def expanded(self, unknowns: FloatArray) -> FloatArray:
        """Unknowns in all components, 0 where there is none, shape [..., n d] of [..., count]."""
        padded = np.concatenate([unknowns, np.zeros((*unknowns.shape[:-1], 1))], axis=-1)
        return padded[..., self.index]

    @cached_property
    def _structure(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        local = self.index[self.dofs]
        rows = np.repeat(local, local.shape[1], axis=1).ravel()
        columns = np.tile(local, (1, local.shape[1])).ravel()
        kept = np.flatnonzero((rows >= 0) & (columns >= 0))
        keys, inverse = np.unique(rows[kept] * self.count + columns[kept], return_inverse=True)
        starts = np.searchsorted(keys // self.count, np.arange(self.count + 1))
        return kept, inverse, keys % self.count, starts

    def matrix(self, elements: FloatArray) -> csr_array:
        """Sum of element matrices [m, k d, k d] over the unknowns."""
        kept, inverse, columns, starts = self._structure
        data = _summed(inverse, elements.ravel()[kept], len(columns))
        return csr_array((data, columns, starts), shape=(self.count, self.count))


def _summed(places: IntArray, values: FloatArray, size: int) -> FloatArray:
    """Sums of the values of each place, shape [size]."""
    return np.asarray(np.bincount(places, weights=values, minlength=size), dtype=np.float64)

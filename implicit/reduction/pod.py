r"""A basis of displacements from equilibria: proper orthogonal decomposition by the method of snapshots.

The singular vectors of the snapshots U = [u_1 .. u_n] are the orthonormal basis of r vectors that leaves the
least of them,

    sum_j |u_j - V V^T u_j|^2 = sum_{k > r} s_k^2                                              (R.1)

(Sirovich 1987).
"""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray

SMALLEST = 1e-14
"""Square of the smallest singular value that counts, as a share of that of the largest [-]."""


@dataclass(frozen=True)
class Basis:
    """Modes of displacement."""

    modes: FloatArray
    """Orthonormal columns V [-], shape [n d, r]."""
    values: FloatArray
    """All singular values s_k [m], falling, shape [n_snapshots]."""

    @property
    def lost(self) -> float:
        """Root of the share of the snapshots' sum of squares that the basis leaves, Eq. (R.1) [-]."""
        squares = self.values**2
        return float(np.sqrt(squares[self.modes.shape[1] :].sum() / squares.sum()))


def independent(snapshots: FloatArray) -> int:
    """Number of independent snapshots of shape [n_snapshots, n d]."""
    squares = np.linalg.eigvalsh(snapshots @ snapshots.T)
    return int((squares > SMALLEST * squares[-1]).sum())


def decompose(snapshots: FloatArray, modes: int) -> Basis:
    """Find the modes of snapshots [m] of shape [n_snapshots, n d].

    Raises
    ------
    ValueError
        If there are fewer independent snapshots than modes.
    """
    U = np.asarray(snapshots, dtype=float)
    gram = U @ U.T
    squares, vectors = np.linalg.eigh(gram)
    squares, vectors = np.maximum(squares[::-1], 0.0), vectors[:, ::-1]
    rank = int((squares > SMALLEST * squares[0]).sum())
    if not 1 <= modes <= rank:
        raise ValueError(f"modes must be in [1, {rank}], the independent snapshots, got {modes}")
    V = U.T @ (vectors[:, :modes] / np.sqrt(squares[:modes]))
    # the Gram matrix squares the condition: once more orthonormal
    V, R = np.linalg.qr(V)
    return Basis(V * np.sign(np.diag(R)), np.sqrt(squares))

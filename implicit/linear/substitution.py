"""Solution of one system with Cholesky factors of all fronts."""

from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import FloatArray
from implicit.linear.assembly import Assembled, Assembly, wrapped
from implicit.linear.kernels.substitution import substitution_kernel


class Substitution:
    """Factors in place of the fronts, L11 in F11 and L21 in F21."""

    def __init__(self, assembly: Assembly, assembled: Assembled) -> None:
        kept = assembled.kept
        sizes = assembly.shapes[:, :2].astype(np.int64)
        some = sizes[:, 0] > 0
        table = np.column_stack([sizes, assembled.at[:, :2], assembly.places])[some]
        self._scratch = np.empty(max(1, int(sizes[:, 1].max())), kept.dtype)
        self._given = [wrapped(np.ascontiguousarray(one)) for one in (table, kept, assembly.outside)]
        self._kernel: Any = substitution_kernel(wp.dtype_from_numpy(kept.dtype))

    def solve(self, x: FloatArray) -> None:
        """Solve L L^T x = b in place, the unknowns in the order of elimination, shape [n]."""
        inputs = [*self._given, wrapped(x), wrapped(self._scratch)]
        wp.launch(self._kernel, 1, inputs=inputs, device="cpu")

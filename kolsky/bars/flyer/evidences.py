"""The marginal likelihood of many smoothnesses of one flyer at once.

`kolsky.bars.flyer.jerks.evidence` works on matrices of four rows, so small that Python takes most of its
time. Here each step of the filter is done for all smoothnesses together; the numbers are the same.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kolsky.bars.flyer.jerks import CHANGE_PER_OCTAVE, state_space
from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class Evidences:
    """-2 log of the marginal likelihood of several log scales and log tau, and its gradients; the data are
    those of `kolsky.bars.flyer.jerks.evidence`, which says more of them."""

    thetas: FloatArray
    """Log noise scales, then log tau at the control points, shape [n, n_parts + n_controls]."""
    y: FloatArray
    """Displacement over sigma [-], shape [n_frames]."""
    weight: FloatArray
    """Typical sigma over sigma [-], 0 where a frame has no displacement, shape [n_frames]."""
    spans: FloatArray
    """Lengths of the spans in frames [-], shape [n_spans]."""
    hats: FloatArray
    """Hat functions at the spans [-], shape [n_spans, n_controls]."""
    parts: FloatArray | None = None
    """Parts of each frame's variance, shape [n_frames, n_parts]; None: the declared one alone."""
    shared: tuple[FloatArray, FloatArray] | None = None
    """Size and memory of an error that successive frames have in common; None: there is none."""

    @property
    def values(self) -> FloatArray:
        """The values, with the prior of the changes of log tau, shape [n]."""
        S, miss = self._filtered[:2]
        change = np.diff(self._tau, axis=1) / CHANGE_PER_OCTAVE
        return np.asarray(np.sum(np.log(S) + S * miss**2, axis=1) + np.array([one @ one for one in change]))

    @property
    def gradients(self) -> FloatArray:
        """Their gradients, shape [n, n_parts + n_controls]."""
        S, miss, K, left = self._filtered
        seen, steps, kicks, _ = state_space(self.weight, self.spans, self.shared)
        back, ahead = left @ steps, np.einsum("kj,kji->ki", seen, steps)
        turned = np.swapaxes(back, 2, 3)
        by_miss = miss[:, :, None] * ahead
        by_frame = ahead[:, :, None] * ahead[:, None] / S[:, :, None, None]
        r, N = np.zeros(K.shape), np.zeros(left.shape)
        for k in range(len(self.y) - 1, 0, -1):
            r[:, k - 1] = by_miss[:, k] + (r[:, k, None] @ back[:, k])[:, 0]
            N[:, k - 1] = by_frame[:, k] + turned[:, k] @ N[:, k] @ back[:, k]
        data = self.weight > 0.0
        pushed, kicked = np.sum(seen * kicks, axis=1), (left @ kicks[:, :, None])[..., 0]
        moving = slice(len(self.y) - self.spans.size, len(self.y))
        found = []
        for i, noise in enumerate(self._noise):  # as `evidence` has it, to the last bit
            of_noise = 1.0 / S[i] + np.einsum("ki,kij,kj->k", K[i], N[i], K[i])
            of_noise -= (miss[i] - np.sum(K[i] * r[i], axis=1)) ** 2
            of_kicks = pushed**2 / S[i] + np.einsum("ki,kij,kj->k", kicked[i], N[i], kicked[i])
            of_kicks -= (pushed * miss[i] + np.sum(kicked[i] * r[i], axis=1)) ** 2
            change = np.diff(self._tau[i]) / CHANGE_PER_OCTAVE
            by_change = -2.0 / CHANGE_PER_OCTAVE * np.diff(change, prepend=0.0, append=0.0)
            by_tau = (2.0 * self._variance[i] * of_kicks[moving]) @ self.hats + by_change
            found.append(np.concatenate([2.0 * (of_noise[data] @ noise[data]), by_tau]))
        return np.array(found)

    @property
    def _every_part(self) -> FloatArray:
        return np.ones((self.y.size, 1)) if self.parts is None else self.parts

    @property
    def _tau(self) -> FloatArray:
        """Log tau at the control points, shape [n, n_controls]."""
        return self.thetas[:, self._every_part.shape[1] :]

    @cached_property
    def _noise(self) -> FloatArray:
        """Parts of each frame's variance, shape [n, n_frames, n_parts]."""
        parts = self._every_part
        return np.asarray(parts * np.exp(2.0 * self.thetas[:, None, : parts.shape[1]]))

    @cached_property
    def _variance(self) -> FloatArray:
        """Prior variance of the jerks, shape [n, n_spans]."""
        return np.exp(2.0 * np.array([self.hats @ one for one in self._tau]))

    @cached_property
    def _filtered(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Variances of what the filter expects, what it misses by over them [n, n_frames], its gains [n,
        n_frames, m], and what they leave of the state, [n, n_frames, m, m]."""
        # a frame without a displacement says nothing of the noise
        own = np.where(self.weight > 0.0, np.sum(self._noise, axis=2), 1.0)
        seen, steps, kicks, P = state_space(self.weight, self.spans, self.shared)
        count, (n, m) = len(self.thetas), seen.shape
        growth, eye, still = np.zeros((count, m, m)), np.eye(m), n - self.spans.size
        state, expected = np.zeros((count, m, 1)), np.empty((count, n, m))
        S, K, left = np.empty((count, n)), np.empty((count, n, m)), np.empty((count, n, m, m))
        for k, (z, step) in enumerate(zip(seen, steps, strict=True)):
            if k >= still:
                growth = self._variance[:, k - still, None, None] * kicks[k, :, None] * kicks[k]
            if self.shared is not None:
                growth[:, 4, 4] = 1.0 - self.shared[1][k] ** 2
            P = step @ P @ step.T + growth
            column, noise_k = P @ z, own[:, k, None]
            S[:, k] = total = (column[:, None] @ z)[:, 0] + own[:, k]
            K[:, k] = gain = column / total[:, None]
            upright = gain[:, :, None]
            left[:, k] = rest = eye - upright * z
            P = rest @ P @ np.swapaxes(rest, 1, 2) + (noise_k * gain)[:, :, None] * gain[:, None]
            now = step @ state
            expected[:, k] = now[:, :, 0]
            state = rest @ now + upright * self.y[k]
        return S, (self.y - np.sum(seen * expected, axis=2)) / S, K, left

"""Strains on a surface, with uncertainties, from local least-squares fits over a virtual strain gauge.

The positions of the points in a window are fitted by polynomials in their coordinates of the material
picture. This is done for the reference and for the current state. With the slopes A0 (reference) and A
(current) the surface's deformation gradient is ``F = A M⁻¹``, ``M = Bᵀ A0``. B are the tangent vectors of the
reference. The effect of curvature on the fit is the same in both states and cancels. A homogeneous
deformation is reproduced exactly, also by one-sided windows.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from dic.basics import BoolArray, FloatArray, IntArray
from dic.correlation.subsets import overlap_correlation
from dic.outcome import Outcome
from dic.processes import parts, run_parallel
from dic.surfaces.surface_history import SurfaceHistory


@dataclass(frozen=True)
class Strain:
    """A symmetric tensor in the reference tangent plane: around the axis (1), along it (2), shear (12)."""

    value: FloatArray
    """Components 11, 22, 12 [-], shape [n_frames, n_points, 3]."""
    sigma: FloatArray
    """Their standard uncertainties [-], same shape."""


@dataclass(frozen=True)
class StrainHistory:
    """The surface's deformation gradient at points and frames, and the strains derived from it.

    NaN where the outcome is not VALID.
    """

    t: FloatArray
    """Frame times on the shot's clock [s], shape [n_frames]."""
    F: FloatArray
    """Deformed images of the reference tangent vectors: columns around and along [-], in components of the
    test frame, shape [n_frames, n_points, 3, 2]."""
    basis: FloatArray
    """Unit tangent vectors of the reference, columns around (with x) and along (with y), same shape."""
    covariance: FloatArray
    """Covariance of the components 11, 22, 12 of C = FᵀF [-], shape [n_frames, n_points, 3, 3]."""
    outcome: IntArray
    """`dic.surfaces.strains.StrainOutcome`, shape [n_frames, n_points]."""
    share: FloatArray
    """Number of points used over that of the full window [-], shape [n_frames, n_points]."""
    centre: FloatArray
    """Mean position of the points used relative to the point itself, in the material picture [steps], shape
    [n_frames, n_points, 2]; (0, 0) is a centred gauge."""
    gauge: float
    """Side of the virtual strain gauge in the material picture [px]."""

    @property
    def green_lagrange(self) -> Strain:
        """E = (FᵀF - 1)/2."""
        C = self._C()
        value = 0.5 * np.stack([C[..., 0, 0] - 1.0, C[..., 1, 1] - 1.0, C[..., 0, 1]], axis=-1)
        return Strain(value, 0.5 * np.sqrt(np.einsum("...kk->...k", self.covariance)))

    @property
    def hencky(self) -> Strain:
        """H = ½ ln(FᵀF), the logarithmic strain."""
        return self._isotropic(lambda c: 0.5 * np.log(c), lambda c: 0.5 / c)

    @property
    def nominal(self) -> Strain:
        """U - 1 = (FᵀF)^½ - 1, the engineering strain of fibres along the principal directions."""
        return self._isotropic(lambda c: np.sqrt(c) - 1.0, lambda c: 0.5 / np.sqrt(c))

    def _C(self) -> FloatArray:
        return np.asarray(np.swapaxes(self.F, -1, -2) @ self.F)

    def _principal(self) -> tuple[FloatArray, FloatArray]:
        """Eigenvalues of C, the larger first, and eigenvectors as columns; NaN where there is no strain."""
        C = self._C()
        finite = np.asarray(np.isfinite(C).all(axis=(-1, -2)))
        c, Q = np.linalg.eigh(np.where(finite[..., None, None], C, np.eye(2)))
        c, Q = c[..., ::-1], Q[..., ::-1]
        return np.where(finite[..., None], c, np.nan), np.where(finite[..., None, None], Q, np.nan)

    def _isotropic(
        self, f: Callable[[FloatArray], FloatArray], slope: Callable[[FloatArray], FloatArray]
    ) -> Strain:
        """f(C) and its sigma. In principal axes dC_ab is multiplied by the divided difference f[c_a, c_b]."""
        c, Q = self._principal()
        a, b = c[..., :, None], c[..., None, :]
        near = np.abs(a - b) < 1e-6 * (a + b)
        with np.errstate(divide="ignore", invalid="ignore"):
            divided = np.where(near, slope(0.5 * (a + b)), (f(a) - f(b)) / (a - b))
        value = np.einsum("...ia,...a,...ja->...ij", Q, f(c), Q)
        # The map from the components of C to those of f(C), in the axes of the tangent vectors.
        L = np.einsum("...ia,...jb,...ab,...ka,...lb->...ijkl", Q, Q, divided, Q, Q, optimize=True)
        pair = np.array([[0, 2], [2, 1]])
        V = self.covariance[..., pair[:, :, None, None], pair[None, None]]
        W = np.einsum("...ijkl,...klmn,...ijmn->...ij", L, V, L, optimize=True)
        pick = lambda T: np.stack([T[..., 0, 0], T[..., 1, 1], T[..., 0, 1]], axis=-1)  # noqa: E731
        return Strain(pick(value), np.sqrt(pick(W)))


FEWEST = {1: 4, 2: 8}
"""Smallest number of points of a window by the order of its polynomial."""


class StrainOutcome(Outcome):
    """Outcome of the strain at one point in one frame."""

    VALID = 0, "a strain was fitted", "nothing to do"
    POINT_LOST = 1, "the point itself was not found", "see the point's own outcome"
    TOO_FEW_NEIGHBOURS = (
        2,
        "too few valid neighbours of the same region, or all of them nearly on a line",
        "enlarge the window, or choose a smaller step",
    )


@dataclass(frozen=True)
class StrainGauge:
    """A virtual strain gauge: the square of the material picture over which a strain is fitted."""

    window: int
    """Points along one side, odd."""
    step: float
    """Distance of adjacent points [px]."""
    subset: float
    """Side of the subsets [px]."""
    order: int = 1
    """Order of the polynomial: 1 or 2."""

    def __post_init__(self) -> None:
        if not (self.window >= 3 and self.window % 2 == 1):
            raise ValueError(f"window must be odd and at least 3 points, got {self.window}")
        if not (self.step > 0.0 and self.subset > 0.0):
            raise ValueError(f"step and subset must be positive [px], got {self.step} and {self.subset}")
        if self.order not in FEWEST:
            raise ValueError(f"order must be 1 or 2, got {self.order}")

    @property
    def size(self) -> float:
        """Side of the gauge [px]: (window - 1) step + subset."""
        return (self.window - 1) * self.step + self.subset


MOST_SENT = 400_000
"""Largest number of points times frames for strains in forked processes, which send back about 80 MB."""
THINNEST = 0.3
"""Smallest spread of a window's points in any direction [steps, root mean square]."""


def strains(
    surface: SurfaceHistory,
    points: ArrayLike,
    gauge: StrainGauge,
    *,
    regions: ArrayLike | None = None,
    reference_sigma: ArrayLike | None = None,
) -> StrainHistory:
    """Strains at all points in all frames.

    Parameters
    ----------
    surface
        The surface in the test frame; strains refer to its reference positions.
    points
        Positions of its points in the material picture [px], shape [n_points, 2].
    gauge
        The virtual strain gauge. Near an edge or lost points the window is not shifted and becomes one-sided.
    regions
        Label of the body of each point, shape [n_points]; a window contains points of one body only. None:
        one body.
    reference_sigma
        Standard uncertainties of the reference positions, independent of those of the frames [m], shape
        [n_points, 3]. None: the reference positions are exact, because they define the points.

    Returns
    -------
    StrainHistory
        The strains, with an outcome per point and frame.

    Raises
    ------
    ValueError
        If shapes do not match.
    """
    grid = np.asarray(points, dtype=np.float64)
    label = np.zeros(surface.n_points) if regions is None else np.asarray(regions)
    start_sigma = np.zeros((surface.n_points, 3)) if reference_sigma is None else np.asarray(reference_sigma)
    n = surface.n_points
    for name, array, shape in (
        ("points", grid, (n, 2)),
        ("regions", label, (n,)),
        ("reference_sigma", start_sigma, (n, 3)),
    ):
        if array.shape != shape:
            raise ValueError(f"{name} has shape {array.shape}, must be {shape}")
    frames, valid = surface.n_frames, surface.valid
    places, noise = (np.where(valid[..., None], of, 0.0) for of in (surface.position, surface.sigma))
    positions = _Positions(surface.X, places, noise, valid)
    F, basis = np.full((frames, n, 3, 2), np.nan), np.full((frames, n, 3, 2), np.nan)
    V = np.full((frames, n, 3, 3), np.nan)
    share, centre = np.zeros((frames, n)), np.full((frames, n, 2), np.nan)
    outcome = np.where(positions.valid, StrainOutcome.TOO_FEW_NEIGHBOURS, StrainOutcome.POINT_LOST)
    reach = (0.5 * (gauge.window - 1) + 1e-6) * gauge.step
    windows = cKDTree(grid).query_ball_point(grid, reach, p=np.inf, return_sorted=True)

    def fitted(rows: range) -> list[_Window]:
        fits = []
        for i in rows:
            near = np.array(windows[i], dtype=np.int64)
            near = near[label[near] == label[i]]
            window = _fit_window(positions, grid, gauge, start_sigma, i, near)
            if window is not None:
                fits.append(window)
        return fits

    # forks send back about 200 bytes per point and frame
    processes = parts() if frames * n <= MOST_SENT else 1
    works = [partial(fitted, range(part, n, processes)) for part in range(processes)]
    for each in run_parallel(works, processes=processes):
        for i, k, F_i, B, V_i, share_i, centre_i in each:
            F[k, i], basis[k, i], V[k, i] = F_i, B, V_i
            share[k, i], centre[k, i], outcome[k, i] = share_i, centre_i, StrainOutcome.VALID
    return StrainHistory(
        surface.t, F, basis, V, np.asarray(outcome, dtype=np.int64), share, centre, gauge.size
    )


@dataclass(frozen=True)
class _Positions:
    """Reference and current positions, their sigmas, and whether they are known; 0 where not."""

    X: FloatArray
    position: FloatArray
    sigma: FloatArray
    valid: BoolArray


_Window = tuple[int, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""First a point and the frames in which its window has enough points. Then, for these frames, the gradient,
its basis, the covariance, the share of the window's points and their centre."""


def _fit_window(
    positions: _Positions,
    grid: FloatArray,
    gauge: StrainGauge,
    start_sigma: FloatArray,
    i: int,
    near: IntArray,
) -> _Window | None:
    """Strains at point `i` from the points `near` it; None if there are too few points in all frames."""
    q = (grid[near] - grid[i]) / gauge.step
    used = positions.valid[:, near] & positions.valid[:, i, None]
    k, weights = _slopes(q, used, gauge.order)
    if not k.size:
        return None
    used, at = used[k], np.ix_(k, near)
    A0 = weights @ positions.X[near]
    A = weights @ positions.position[at]
    B = _tangents(np.swapaxes(A0, 1, 2))
    inverse = np.linalg.inv(A0 @ B)  # (BᵀA0)⁻¹, transposed
    F = np.ascontiguousarray(np.swapaxes(inverse @ A, 1, 2))
    rho = overlap_correlation(grid[near], grid[near], gauge.subset)
    V = _covariance(F, B, inverse @ weights, rho, positions.sigma[at], start_sigma[near])
    count = used.sum(axis=1)
    return i, k, F, B, V, count / gauge.window**2, used @ q / count[:, None]


def _slopes(q: FloatArray, used: BoolArray, order: int) -> tuple[IntArray, FloatArray]:
    """Frames with enough points (`used`: [n_frames, m]), and the weights [n_enough, 2, m] of the slopes at
    the window's centre point."""
    terms = [np.ones(len(q)), q[:, 0], q[:, 1]]
    if order == 2:
        terms += [q[:, 0] ** 2, q[:, 0] * q[:, 1], q[:, 1] ** 2]
    T = np.column_stack(terms)
    weight = used.astype(np.float64)
    count = weight.sum(axis=1)
    pairs = (T[:, :, None] * T[:, None]).reshape(len(T), -1)
    normal = (weight @ pairs).reshape(len(weight), T.shape[1], -1)
    mean = normal[:, 0, 1:3] / np.maximum(count, 1.0)[:, None]
    scatter = normal[:, 1:3, 1:3] / np.maximum(count, 1.0)[:, None, None] - mean[:, :, None] * mean[:, None]
    enough = (count >= FEWEST[order]) & (np.linalg.eigvalsh(scatter)[:, 0] >= THINNEST**2)
    enough &= np.linalg.eigvalsh(normal)[:, 0] > 1e-6
    k = np.flatnonzero(enough)
    slopes = np.eye(T.shape[1])[:, 1:3]
    return k, np.swapaxes(np.linalg.solve(normal[k], slopes), 1, 2) @ T.T * weight[k, None, :]


def _tangents(A0: FloatArray) -> FloatArray:
    """Unit tangent vectors around (with x) and along y, from two slopes; both [n_frames, 3, 2]."""
    normal = _cross(A0[..., 0], A0[..., 1])
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.array([0.0, 1.0, 0.0]) - normal[:, 1:2] * normal
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    around = _cross(along, normal)
    return np.stack([around * np.where(around[:, :1] < 0.0, -1.0, 1.0), along], axis=-1)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of rows, shape [n, 3]; for few rows five times as fast as `numpy.cross`."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _covariance(
    F: FloatArray, B: FloatArray, g: FloatArray, rho: FloatArray, noise: FloatArray, start_sigma: FloatArray
) -> FloatArray:
    """First-order covariance of (C11, C22, C12), C = FᵀF; shape [n_frames, 3, 3].

    A change δ of a position along k changes C_ab by (F_ka g_b + F_kb g_a) δ.
    """
    C = np.swapaxes(F, 1, 2) @ F
    total = np.zeros((len(F), 3, 3))
    for lever, sigma in ((F, noise), (B @ C, np.broadcast_to(start_sigma, noise.shape))):
        if not sigma.any():
            continue
        around, along = lever[:, :, 0, None], lever[:, :, 1, None]
        g1, g2 = g[:, None, 0], g[:, None, 1]
        d = np.stack([2.0 * around * g1, 2.0 * along * g2, around * g2 + along * g1], axis=1)
        d = d * np.swapaxes(sigma, 1, 2)[:, None]  # [n_frames, component of C, k, point]
        correlated = d @ rho
        total += d.reshape(len(F), 3, -1) @ np.swapaxes(correlated.reshape(len(F), 3, -1), 1, 2)
    return total


__all__ = ["StrainGauge", "StrainOutcome", "strains"]

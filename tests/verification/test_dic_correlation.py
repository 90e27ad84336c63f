"""Match of subsets on pictures with exact motion: bias, noise, and check of the covariance."""

from collections.abc import Callable
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from speckle_pictures import SpecklePattern, render, speckle_pattern

from dic.correlation import Correlation, PictureStack, Shape, correlate

FloatArray = NDArray[np.float64]

FIGURE_SIZE = (6.7, 2.5)

SIDE = 512  # of the picture pair [px]
SIGMA = 2.0  # noise of a grey value [grey]
NOISE = float(np.hypot(SIGMA, 12.0**-0.5))  # with that of the rounding to whole grey values [grey]
REPEATS = 4  # pairs that differ in their noise
SHIFTS = np.linspace(0.0, 1.0, 21)  # of the S-curve [px]
SIZES = (4.0, 5.0)  # speckles of the S-curve [px]
SUBSETS = (11, 15, 21, 31, 41)  # sides [px]
STRETCHES = (1.3, 1.0, 0.8, 0.65, 0.5, 0.4, 0.33)
"""Vertical; the horizontal one keeps the area of an incompressible body that is seen flat: 1 / sqrt."""
COARSE = 12.0  # speckles of the compressed pictures [px]: 4 px where they are shortest
BIAS, S_CURVE = 0.5e-3, 1e-3  # largest mean error, and largest S-curve from peak to peak [px]
OVER_FLOOR = 1.1  # largest standard deviation over the floor, affine
CALIBRATED, COMPRESSED = 0.06, 0.2
"""Largest distance of the standard deviation of normalised errors from 1; the same, compressed."""


Pair = Result = SimpleNamespace


def grid(margin: float, side: int, step: float) -> FloatArray:
    """Points (x, y), shape [n, 2]."""
    along = np.arange(margin, side - margin, step)
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def warps(points: FloatArray, F: FloatArray, shift: FloatArray, side: int) -> FloatArray:
    """Total warps of x = c + F (X - c) + shift."""
    total = np.zeros((len(points), 12))
    total[:, :2] = (points - (side - 1) / 2) @ (F - np.eye(2)).T + shift
    total[:, 2:6] = (F - np.eye(2)).ravel()
    return total


def inverse(F: FloatArray, shift: FloatArray, side: int) -> Callable[[FloatArray], FloatArray]:
    """The material place that a place of the moved picture shows."""
    centre, back = (side - 1) / 2, np.linalg.inv(F)
    return lambda x: (x - centre - shift) @ back.T + centre


def stack(picture: FloatArray, seed: int, prefilter: float = 0.0, declared: float = NOISE) -> PictureStack:
    """Eight-bit pictures with noise, one a repeat."""
    noise = np.random.default_rng(seed).normal(0.0, SIGMA, (REPEATS, *picture.shape))
    grey = np.clip(np.round(picture + noise), 0.0, 255.0)
    return PictureStack.prepare(grey, noise=declared, prefilter=prefilter)


def repeated(
    first: PictureStack,
    second: PictureStack,
    true: FloatArray,
    settings: Correlation,
    points: FloatArray,
    reference: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, float]:
    """Errors [n, 2] and covariances [n, 2, 2] of VALID points of all repeats, and their share."""
    guess = true.copy()
    guess[:, 0] += 0.2
    guess[:, 1] -= 0.2
    picture = np.repeat(np.arange(REPEATS), len(points))
    many = [np.tile(a, (REPEATS, 1)) for a in (points, guess, true)]
    found = correlate(
        first, second, many[0], many[1], settings, reference_picture=picture, deformed_picture=picture,
        reference_warp=None if reference is None else np.tile(reference, (REPEATS, 1)),
    )  # fmt: skip
    ok = found.outcome == 0
    return (found.warp - many[2])[ok, :2], found.covariance[ok], float(ok.mean())


def normalised(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Errors in units of their standard deviations, decorrelated, shape [n, 2]."""
    factor = np.linalg.inv(np.linalg.cholesky(covariance))
    return np.asarray(np.einsum("nij,nj->ni", factor, error))


def gradient_energy(pattern: SpecklePattern, points: FloatArray, subset: int) -> FloatArray:
    """ΣGx² of every subset, from the noise-free pattern [grey²/px²]."""
    h = 1e-3
    ahead, behind = (
        render(pattern, (SIDE, SIDE), material=lambda x, s=s: x + np.array([s, 0.0])) for s in (h, -h)
    )
    total = np.cumsum(np.cumsum(np.pad(((ahead - behind) / (2 * h)) ** 2, ((1, 0), (1, 0))), axis=0), axis=1)
    x, y = points.astype(int).T
    low, high = -(subset // 2), subset // 2 + 1
    return np.asarray(
        total[y + high, x + high]
        - total[y + low, x + high]
        - total[y + high, x + low]
        + total[y + low, x + low]
    )


def measure_s_curve(size: float) -> FloatArray:
    """Mean error of noise-free pictures at `SHIFTS` [px]."""
    side = 192
    pattern = speckle_pattern((side, side), size=size, seed=7)
    still = PictureStack.prepare(render(pattern, (side, side)), noise=SIGMA)
    points = grid(20, side, 5.0)
    errors = []
    for shift in SHIFTS:
        picture = render(pattern, (side, side), material=lambda x, s=shift: x - np.array([s, 0.0]))
        guess = warps(points, np.eye(2), np.array([shift + 0.2, 0.1]), side)
        found = correlate(still, PictureStack.prepare(picture, noise=SIGMA), points, guess, Correlation())
        errors.append(np.mean(found.warp[found.outcome == 0, 0] - shift))
    return np.array(errors)


def measure_stretches() -> FloatArray:
    """Normalised errors of noisy pictures, compressed and stretched."""
    side, shift = 260, np.array([0.3, -0.2])
    pattern = speckle_pattern((side, side), size=COARSE, seed=5, margin=300.0)
    still = stack(render(pattern, (side, side)), 11)
    points = grid(50, side, 21.0)
    rows = []
    for stretch in STRETCHES:
        F = np.diag([stretch**-0.5, stretch])
        moved = stack(render(pattern, (side, side), material=inverse(F, shift, side)), 12)
        true = warps(points, F, shift, side)
        inside = np.all(np.abs(points + true[:, :2] - (side - 1) / 2) < side / 2 - 28, axis=1)
        error, covariance, _ = repeated(still, moved, true[inside], Correlation(), points[inside])
        rows.append(normalised(error, covariance).std(axis=0))
    return np.array(rows)


def measure_update(
    first: FloatArray, second: FloatArray, reference: FloatArray, points: FloatArray, declared: float
) -> float:
    """Mean horizontal error of matches back to the material picture [px]."""
    stacks = [stack(picture, seed, 0.0, declared) for seed, picture in enumerate((first, second), 3)]
    still = np.zeros((len(points), 12))
    error, _, _ = repeated(stacks[0], stacks[1], still, Correlation(), points, reference=reference)
    return float(error[:, 0].mean())


def measure_pair(
    name: str,
    first: FloatArray,
    second: FloatArray,
    true: FloatArray,
    settings: Correlation,
    points: FloatArray,
) -> Pair:
    """Errors of one motion with some settings."""
    stacks = [stack(picture, seed, settings.prefilter) for seed, picture in enumerate((first, second))]
    error, covariance, found = repeated(stacks[0], stacks[1], true, settings, points)
    return Pair(
        motion=name,
        settings=settings,
        bias=float(error[:, 0].mean()),  # mean error [px]
        spread=float(error[:, 0].std()),  # standard deviation of the error [px]
        promised=float(np.sqrt(covariance[:, 0, 0].mean())),  # root mean square of the sigmas [px]
        normalised=float(normalised(error, covariance).std()),  # standard deviation of error over sigma [-]
        found=found,  # share of the points that are VALID [-]
    )


@cache
def case() -> Result:
    """All of it: 15 s on one core."""
    pattern, points = speckle_pattern((SIDE, SIDE)), grid(30, SIDE, 5.0)
    first, shifted = render(pattern, (SIDE, SIDE)), np.array([0.3, 0.0])
    motions = {"shift by 0.3 px": (np.eye(2), shifted), "stretch by 2 %": (np.diag([1.02, 1.0]), np.zeros(2))}
    true = {name: warps(points, F, shift, SIDE) for name, (F, shift) in motions.items()}
    second = {
        name: render(pattern, (SIDE, SIDE), material=inverse(F, shift, SIDE))
        for name, (F, shift) in motions.items()
    }
    smooth, plain = Correlation(prefilter=0.5), Correlation()
    others = [Correlation(shape=shape) for shape in (Shape.RIGID, Shape.QUADRATIC)]
    chosen = {"shift by 0.3 px": [plain, smooth, *others], "stretch by 2 %": [plain, smooth, others[1]]}
    pairs = [
        measure_pair(name, first, second[name], true[name], settings, points)
        for name, several in chosen.items()
        for settings in several
    ]
    sizes = [
        measure_pair(
            "", first, second["shift by 0.3 px"], true["shift by 0.3 px"], Correlation(subset=n), points
        )
        for n in SUBSETS
    ]
    energy = [gradient_energy(pattern, points, subset) for subset in SUBSETS]
    floors = np.array([np.sqrt(2.0) * SIGMA * np.mean(each**-0.5) for each in energy])
    between = [
        measure_update(second["shift by 0.3 px"], first, true["shift by 0.3 px"], points, declared)
        for declared in (NOISE, 0.0)
    ]
    return Result(
        floor=float(floors[SUBSETS.index(21)]),  # sqrt(2 σ² / ΣG²) of a subset of 21 px without noise [px]
        pairs=tuple(pairs),  # of the picture pair
        # mean error at `SHIFTS`, by speckle size, without noise [px]
        s_curve={size: measure_s_curve(size) for size in SIZES},
        # standard deviation of the error for `SUBSETS` [px], affine, shift by 0.3 px
        subset_spread=np.array([pair.spread for pair in sizes]),
        subset_floor=floors,  # the floor for each [px]
        # Standard deviation of normalised errors at `STRETCHES`, by axis, shape [n, 2] [-].
        stretch_normalised=measure_stretches(),
        update_bias=between[0],  # mean error of a match whose template is read between pixels [px]
        # the same where no noise is declared, so that nothing is taken out [px]
        update_bias_untold=between[1],
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    left, middle, right = figure.subplots(1, 3)
    for (size, bias), style in zip(result.s_curve.items(), ("-o", "--s"), strict=True):
        left.plot(SHIFTS, 1e3 * bias, style, markersize=2.5, label=f"speckles of {size:g} px")
    left.set(xlabel="shift [px]", ylabel="mean error [mpx]", ylim=(-0.6, 0.6))
    left.legend(loc="lower left")
    middle.loglog(SUBSETS, 1e3 * result.subset_spread, "o", label="measured")
    middle.loglog(SUBSETS, 1e3 * result.subset_floor, "k-", label="√(2σ²/ΣG²)")
    middle.set(xlabel="side of the subset [px]", ylabel="standard deviation [mpx]")
    middle.set_xticks(SUBSETS, [str(n) for n in SUBSETS])
    middle.set_xticks([], minor=True)
    middle.legend()
    for k, (name, style) in enumerate((("across", "-o"), ("along", "--s"))):
        right.plot(STRETCHES, result.stretch_normalised[:, k], style, label=name)
    right.axhline(1.0, color="k", linewidth=0.6)
    right.set(xlabel="stretch along y", ylabel="error / sigma, std", ylim=(0.0, 1.4))
    right.legend(loc="lower left")


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    rows = "\n".join(
        f"| {p.motion} | {p.settings.shape.name.lower()} | {p.settings.prefilter:g} | {1e3 * p.bias:+.2f} "
        f"| {1e3 * p.spread:.2f} | {1e3 * p.promised:.2f} | {p.normalised:.2f} |"
        for p in result.pairs
    )
    curves = " and ".join(
        f"{1e3 * np.ptp(bias):.2f} mpx (speckles of {size:g} px)" for size, bias in result.s_curve.items()
    )
    low, high = result.stretch_normalised.min(), result.stretch_normalised.max()
    plain = [pair for pair in result.pairs if pair.settings == Correlation()]
    return locals()


pytestmark = pytest.mark.slow  # 15 s


def test_bias_and_standard_deviation_of_the_pair() -> None:
    result = case()
    assert result.floor == pytest.approx(7.7e-3, rel=0.01)
    for pair in result.pairs:
        assert pair.found == 1.0
        assert abs(pair.bias) < BIAS
        if pair.settings.shape is Shape.AFFINE:
            assert pair.spread < OVER_FLOOR * result.floor
    plain = {pair.motion for pair in result.pairs if pair.settings == Correlation()}
    assert plain == {"shift by 0.3 px", "stretch by 2 %"}


def test_no_estimate_beats_its_floor() -> None:
    result = case()
    # 2000 independent subsets: 1.6 % of a standard deviation
    assert np.all(result.subset_spread > 0.97 * result.subset_floor)
    assert np.all(result.subset_spread < 1.3 * result.subset_floor)


def test_sigmas_are_calibrated() -> None:
    result = case()
    for pair in result.pairs:
        assert abs(pair.normalised - 1.0) < CALIBRATED
    assert np.all(np.abs(result.stretch_normalised - 1.0) < COMPRESSED)


def test_s_curve() -> None:
    for bias in case().s_curve.values():
        assert np.ptp(bias) < S_CURVE


def test_a_template_read_between_pixels_is_not_biased_by_its_noise() -> None:
    assert abs(case().update_bias) < BIAS
    assert abs(case().update_bias_untold) > 4 * BIAS  # there is something to take out

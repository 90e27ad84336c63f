"""Warnings from the measurements: curve, flyer, noise of force and outline."""

from collections.abc import Iterator, Mapping
from math import isfinite, sqrt

from kolsky.inverse.result import Identification

SIGMA_RATIO = 1.3
"""A declared sigma is not believable when the data say this many times more or less."""
WHITE = 3.0
"""Noise is not white when its lag-1 correlation is beyond this many times 1 / sqrt(samples)."""


def conditioned(checks: Mapping[str, float]) -> Iterator[str]:
    """Say how m against the conditioned curve would differ from m against the first pull."""
    if "conditioned_ratio" in checks:
        ratio = checks["conditioned_ratio"]
        yield (
            f"m refers to the first pull; the conditioned curve's stress is {ratio:.3g} times that, so m "
            f"would be about {1.0 / ratio:.3g} times as large against it: --pull conditioned identifies it"
        )


def symmetry(checks: Mapping[str, float]) -> Iterator[str]:
    """Say that the window ends with the flyer's first direction, or goes on beyond it."""
    end, last = checks.get("symmetry_end", float("inf")), checks.get("window_end", 0.0)
    if end <= last:
        yield (
            f"the flyer leaves its first direction at {1e3 * end:.4g} ms, before the window ends at "
            f"{1e3 * last:.4g} ms: the model is one of revolution; end the window there"
        )
    elif isfinite(end):
        yield f"the window ends at {1e3 * last:.4g} ms, where the flyer leaves its first direction"


def flyer(checks: Mapping[str, float]) -> Iterator[str]:
    """Say that the flyer's path, or the front face's velocity, scatters more or less than declared."""
    if "front_noise_scale" in checks:
        scale = checks["front_noise_scale"]
        if scale > SIGMA_RATIO:
            yield (
                f"the front face's velocity scatters {scale:.2g} times as much as the gauges' noise and was "
                "taken so uncertain; check the windows and the dispersion correction"
            )
        return
    scale, chi2 = checks["flyer_noise_scale"], checks["flyer_chi2_per_dof"]
    if scale > SIGMA_RATIO:
        yield (
            f"the flyer's noise is {scale:.2g} times its declared sigma and was taken so large; check "
            "flyer.sigma, or whether the flyer rings"
        )
    elif not SIGMA_RATIO**-2 <= chi2 <= SIGMA_RATIO**2:
        which = "small" if chi2 > 1.0 else "large"
        yield (
            f"the flyer's path has chi-square {chi2:.2g} per degree of freedom where 1 is expected: its "
            f"declared sigma is about {max(chi2, 1.0 / chi2) ** 0.5:.2g} times too {which}; check flyer.sigma"
        )


def force_noise(checks: Mapping[str, float]) -> Iterator[str]:
    """Say that the noise of the force is not white, as a bin's sigma takes it to be."""
    if "force_noise_correlation" not in checks:
        return  # a force from bar waves: its noise is the reduction's affair
    c, n = checks["force_noise_correlation"], checks["force_baseline_samples"]
    limit = WHITE / sqrt(n)
    if abs(c) > limit:
        yield (
            f"the force's baseline noise is not white: neighbouring samples correlate by {c:.2g} (white "
            f"noise: within {limit:.2g}), so the sigma of a bin's mean is wrong by a factor of about "
            f"{sqrt((1.0 + c) / (1.0 - c)):.2g}"
        )


def outline_noise(result: Identification) -> Iterator[str]:
    """Residuals above the noise are the model's and are weighted so; below it only sigma can be wrong."""
    t = result.terms
    if t.n_shape and isfinite(t.chi2_shape) and t.chi2_shape / t.n_shape < SIGMA_RATIO**-2:
        ratio = sqrt(t.n_shape / t.chi2_shape)
        yield (
            f"the outline's residuals are {ratio:.2g} times smaller than its declared sigma, which cannot "
            "be right; check centre_line.sigma"
        )

"""Noise of interpolated grey values, seen through a warped subset.

A spline passes white noise of the pixels on with the spectrum |c(ν)|² of the cardinal quintic spline,
``c = sinc⁶ / (66 + 52 cos 2πν + 2 cos 4πν) · 120``, ν in cycles per pixel: all of it well below 1/2, none
around whole numbers, where the copies of the pixels' spectrum lie. A subset that takes samples at ``x = F ξ``
sees it at ``ν = F⁻ᵀ κ``, with a density of 1/|det F|, folded at whole κ. Steepest descents are smooth, so
what a match takes up is the spectrum near κ = 0: Eq. (C.6) of docs/theory/correlation.md.
"""

from functools import cache

import numpy as np

from dic.arrays import FloatArray

REACH = 4.0
"""Standard deviations at which the Gaussian prefilter ends."""

GRAIN = """
    struct grain {
        static inline double passed(double v) {  // |c(v)|^2
            const double angle = 3.14159265358979324 * v;
            const double s = fabs(angle) < 1e-6 ? 1.0 : wp::sin(angle) / angle;
            const double c = wp::cos(2.0 * angle);
            const double r = s * s * s * s * s * s * 120.0 / (64.0 + 52.0 * c + 4.0 * c * c);
            return r * r;
        }
        // Variance of interpolated noise over that of a pixel, and the mean of that noise times its gradient,
        // half the slope of the variance; even and odd about the middle of two pixels.
        static INLINE pack drift(
            const float* spread, const float* slope, pack x, pack y, pack* dx, pack* dy) {
            const pack u = x - op::down(x) - 0.5f, v = y - op::down(y) - 0.5f, uu = u * u, vv = v * v;
            const pack across = spread[0] + uu * (spread[1] + uu * (spread[2] + uu * spread[3]));
            const pack along = spread[0] + vv * (spread[1] + vv * (spread[2] + vv * spread[3]));
            *dx = along * u * (slope[0] + uu * (slope[1] + uu * (slope[2] + uu * slope[3])));
            *dy = across * v * (slope[0] + vv * (slope[1] + vv * (slope[2] + vv * slope[3])));
            return across * along;
        }
        // Variance in a match over that of a pixel; smooth: variance of the Gaussian [px^2], Q: tensor of the
        // template's gradients over its energy, by the offset in the subset.
        static inline double gain(const double* F, double smooth, const double* Q) {
            double A[4], total = 1.0;
            if (!jet::inverse(F, A)) return 0.0;
            #pragma unroll 1
            for (int m = 0; m < 49; ++m) {
                const int i = m / 7 - 3, j = m % 7 - 3;
                const double x = A[0] * i + A[2] * j, y = A[1] * i + A[3] * j;
                if (m != 24 && fabs(x) < 0.8 && fabs(y) < 0.8) total += passed(x) * passed(y);
            }
            const double less = 1.0 + smooth * (Q[0] * (A[0] * A[0] + A[1] * A[1])
                + 2.0 * Q[1] * (A[0] * A[2] + A[1] * A[3]) + Q[2] * (A[2] * A[2] + A[3] * A[3]));
            return total * (A[0] * A[3] - A[1] * A[2]) / (less * less);
        }
    };
"""


def _spectra(prefilter: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frequencies [1/px] from -2.5 to 2.5, spectrum of the cardinal spline, power of the filtered noise."""
    v = np.linspace(-2.5, 2.5, 10001)
    spline = np.sinc(v) ** 6 * 120.0 / (66.0 + 52.0 * np.cos(2.0 * np.pi * v) + 2.0 * np.cos(4.0 * np.pi * v))
    reach = np.arange(1, REACH * prefilter + 1.0)
    if not prefilter or len(reach) == 0:
        return v, spline, np.ones_like(v)
    weights = np.exp(-(reach**2) / (2.0 * prefilter**2))
    transfer = 1.0 + 2.0 * np.cos(2.0 * np.pi * v[:, None] * reach) @ weights
    return v, spline, (transfer / (1.0 + 2.0 * weights.sum())) ** 2


@cache
def gradient_noise(prefilter: float) -> float:
    """Mean square of a component of the interpolated noise's gradient, over a pixel's variance [1/px²]."""
    v, spline, power = _spectra(prefilter)
    passed = spline**2 * power * (v[1] - v[0])
    return float(np.sum((2.0 * np.pi * v) ** 2 * passed) * np.sum(passed))


@cache
def between_pixels(prefilter: float) -> tuple[float, FloatArray, FloatArray]:
    """Variance of interpolated noise along an axis between two pixels, over a pixel's.

    Returns
    -------
    mean : float
        Mean of the variance over both axes.
    spread, slope
        Coefficients of the variance, even in the distance u from the middle of two pixels, and of half its
        derivative, odd in u: ``Σ spread u^2k`` and ``Σ slope u^(2k+1)``, shape [4].
    """
    v, spline, power = _spectra(prefilter)
    per_pixel = round(1.0 / (v[1] - v[0]))
    u = np.linspace(-0.5, 0.5, 101)
    variance, half = np.zeros_like(u), np.zeros_like(u)
    mean = 0.0
    for h in (-2, -1, 0, 1, 2):  # copies of the spectrum h apart beat with period 1/h
        first, last = max(0, -h * per_pixel), min(len(v), len(v) - h * per_pixel)
        beat = (spline[first:last] * power[first:last]) @ spline[first + h * per_pixel : last + h * per_pixel]
        beat *= v[1] - v[0]
        turn = 2.0 * np.pi * h
        variance += beat * np.cos(turn * (u + 0.5))
        half -= 0.5 * beat * turn * np.sin(turn * (u + 0.5))
        mean = float(beat) if h == 0 else mean
    even = np.stack([u ** (2 * k) for k in range(4)], axis=1)
    spread = np.linalg.lstsq(even, variance, rcond=None)[0]
    slope = np.linalg.lstsq(even * u[:, None], half, rcond=None)[0]
    return mean**2, np.asarray(spread, dtype=np.float64), np.asarray(slope, dtype=np.float64)

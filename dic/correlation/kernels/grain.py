"""What the noise of the pixels becomes between them, seen through a warped subset.

A spline passes white noise of the pixels on with the spectrum |c(ν)|² of the cardinal quintic spline,
``c = sinc⁶ / (66 + 52 cos 2πν + 2 cos 4πν) · 120``, ν in cycles per pixel: all of it well below 1/2, none
around whole numbers, where the copies of the pixels' spectrum lie. A subset that takes samples at ``x = F ξ``
sees it at ``ν = F⁻ᵀ κ``, with a density of 1/|det F|, folded at whole κ. Steepest descents are smooth, so
what a match takes up is the spectrum near κ = 0: Eq. (C.9) of docs/theory/correlation.md.
"""

from functools import cache

import numpy as np

GRAIN = """
    struct grain {
        static inline double passed(double v) {  // |c(v)|^2
            const double angle = 3.14159265358979324 * v;
            const double s = fabs(angle) < 1e-6 ? 1.0 : wp::sin(angle) / angle;
            const double c = wp::cos(2.0 * angle);
            const double r = s * s * s * s * s * s * 120.0 / (64.0 + 52.0 * c + 4.0 * c * c);
            return r * r;
        }
        // Variance in a match over that of a pixel; smooth: variance of the Gaussian [px^2], Q: tensor of the
        // template's gradients over its energy, by the offset in the subset.
        static inline double gain(const double* F, double smooth, const double* Q) {
            double A[4], total = 1.0;
            if (!jet::inverse(F, A)) return 0.0;
            for (int i = -3; i <= 3; ++i)
                for (int j = -3; j <= 3; ++j) {
                    const double x = A[0] * i + A[2] * j, y = A[1] * i + A[3] * j;
                    if ((i || j) && fabs(x) < 0.8 && fabs(y) < 0.8) total += passed(x) * passed(y);
                }
            const double less = 1.0 + smooth * (Q[0] * (A[0] * A[0] + A[1] * A[1])
                + 2.0 * Q[1] * (A[0] * A[2] + A[1] * A[3]) + Q[2] * (A[2] * A[2] + A[3] * A[3]));
            return total * (A[0] * A[3] - A[1] * A[2]) / (less * less);
        }
    };
"""


@cache
def gradient_noise(prefilter: float) -> float:
    """Mean square of a component of the interpolated noise's gradient, over the noise's variance [1/px²].

    ``∫ (2πν)² |c|² g² dν · ∫ |c|² g² dν``, g the spectrum of the Gaussian prefilter.
    """
    v = np.linspace(0.0, 1.5, 3001)
    spline = np.sinc(v) ** 6 * 120.0 / (66.0 + 52.0 * np.cos(2.0 * np.pi * v) + 2.0 * np.cos(4.0 * np.pi * v))
    power = (spline * np.exp(-2.0 * (np.pi * prefilter * v) ** 2)) ** 2
    step = v[1]
    return float(4.0 * step**2 * np.sum((2.0 * np.pi * v) ** 2 * power) * (np.sum(power) - 0.5 * power[0]))

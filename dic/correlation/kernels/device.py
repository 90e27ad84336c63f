"""Warp's devices, and pictures on them: quintic B-spline coefficients, interpolation, interpolated noise.

The recursive filter of the quintic B-spline (Unser 1999) is truncated where its response is below `LEAST` of
its central value. Pictures and coefficients are mirrored at the edges. A Gaussian prefilter is part of the
same filter. The variance of an interpolated value is Eq. (C.6) of docs/theory/pictures.md.
"""

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy import ndimage

from dic.basics import FloatArray, cv2

PAD = 8
"""Width of the mirrored coefficients around a picture [px]: a stencil reaches three pixels beyond it, a row
of a pack five."""

SPLINE = """
    struct spline {
        // Weights of six coefficients at a fraction 1/2 + t, from their even and odd parts in t.
        static INLINE void weights(pack t, pack* w) {
            const pack s = t * t;
            const pack e0 = 1.0f / 3840.0f + s * (1.0f / 96.0f + s * (1.0f / 48.0f));
            const pack o0 = t * (1.0f / 384.0f + s * (1.0f / 48.0f + s * (1.0f / 120.0f)));
            const pack e1 = 79.0f / 1280.0f + s * (7.0f / 32.0f - s * (1.0f / 16.0f));
            const pack o1 = t * (25.0f / 128.0f + s * (1.0f / 16.0f - s * (1.0f / 24.0f)));
            const pack e2 = 841.0f / 1920.0f - s * (11.0f / 48.0f - s * (1.0f / 24.0f));
            const pack o2 = t * (77.0f / 192.0f - s * (7.0f / 24.0f - s * (1.0f / 12.0f)));
            w[0] = e0 - o0; w[5] = e0 + o0;
            w[1] = e1 - o1; w[4] = e1 + o1;
            w[2] = e2 - o2; w[3] = e2 + o2;
        }
        // Their derivatives by t.
        static INLINE void slopes(pack t, pack* w) {
            const pack s = t * t;
            const pack e0 = t * (1.0f / 48.0f + s * (1.0f / 12.0f));
            const pack o0 = 1.0f / 384.0f + s * (1.0f / 16.0f + s * (1.0f / 24.0f));
            const pack e1 = t * (7.0f / 16.0f - s * (1.0f / 4.0f));
            const pack o1 = 25.0f / 128.0f + s * (3.0f / 16.0f - s * (5.0f / 24.0f));
            const pack e2 = t * (-11.0f / 24.0f + s * (1.0f / 6.0f));
            const pack o2 = 77.0f / 192.0f - s * (7.0f / 8.0f - s * (5.0f / 12.0f));
            w[0] = e0 - o0; w[5] = e0 + o0;
            w[1] = e1 - o1; w[4] = e1 + o1;
            w[2] = e2 - o2; w[3] = e2 + o2;
        }
#if defined(__CUDA_ARCH__)
        static INLINE pack value(const float* origin, int stride, pack x, pack y) {
            const float left = floorf(x), top = floorf(y);
            const float* first = origin + ((int)top - 2) * stride + ((int)left - 2);
            pack wx[6], wy[6], total = 0.0f;
            weights(x - left - 0.5f, wx);
            weights(y - top - 0.5f, wy);
            #pragma unroll
            for (int r = 0; r < 6; ++r) {
                pack row = 0.0f;
                #pragma unroll
                for (int k = 0; k < 6; ++k) row += wx[k] * __ldg(first + r * stride + k);
                total += wy[r] * row;
            }
            return total;
        }
        static INLINE pack slope(const float* origin, int stride, pack x, pack y, pack* gx, pack* gy) {
            const float left = floorf(x), top = floorf(y);
            const float* first = origin + ((int)top - 2) * stride + ((int)left - 2);
            pack wx[6], wy[6], dx[6], dy[6], total = 0.0f;
            weights(x - left - 0.5f, wx);
            weights(y - top - 0.5f, wy);
            slopes(x - left - 0.5f, dx);
            slopes(y - top - 0.5f, dy);
            *gx = 0.0f;
            *gy = 0.0f;
            #pragma unroll
            for (int r = 0; r < 6; ++r) {
                pack row = 0.0f, across = 0.0f;
                #pragma unroll
                for (int k = 0; k < 6; ++k) {
                    const float here = __ldg(first + r * stride + k);
                    row += wx[k] * here;
                    across += dx[k] * here;
                }
                total += wy[r] * row;
                *gx += wy[r] * across;
                *gy += dy[r] * row;
            }
            return total;
        }
#else
        static INLINE pack value(const float* origin, int stride, pack x, pack y) {
            const pack left = __builtin_elementwise_floor(x), top = __builtin_elementwise_floor(y);
            pack wx[6], wy[6], column[6];
            weights(x - left - 0.5f, wx);
            weights(y - top - 0.5f, wy);
            const ipack first = begin(left, top, stride);
            row8 rows[STEP];
            #pragma unroll
            for (int l = 0; l < STEP; ++l) {
                const float* c = origin + first[l];
                row8 sum = wy[0][l] * *(const row8u*)c;
                #pragma unroll
                for (int r = 1; r < 6; ++r) sum += wy[r][l] * *(const row8u*)(c + r * (long)stride);
                rows[l] = sum;
            }
            turn(rows, column);
            return dot(wx, column);
        }
        static INLINE pack slope(const float* origin, int stride, pack x, pack y, pack* gx, pack* gy) {
            const pack left = __builtin_elementwise_floor(x), top = __builtin_elementwise_floor(y);
            pack wx[6], wy[6], dx[6], dy[6], column[6];
            weights(x - left - 0.5f, wx);
            weights(y - top - 0.5f, wy);
            slopes(x - left - 0.5f, dx);
            slopes(y - top - 0.5f, dy);
            const ipack first = begin(left, top, stride);
            row8 rows[STEP], down[STEP];
            #pragma unroll
            for (int l = 0; l < STEP; ++l) {
                const float* c = origin + first[l];
                row8 row = *(const row8u*)c, sum = wy[0][l] * row, change = dy[0][l] * row;
                #pragma unroll
                for (int r = 1; r < 6; ++r) {
                    row = *(const row8u*)(c + r * (long)stride);
                    sum += wy[r][l] * row;
                    change += dy[r][l] * row;
                }
                rows[l] = sum;
                down[l] = change;
            }
            turn(down, column);
            *gy = dot(wx, column);
            turn(rows, column);
            *gx = dot(dx, column);
            return dot(wx, column);
        }
        static INLINE ipack begin(pack left, pack top, int stride) {
            return __builtin_convertvector(top, ipack) * stride + __builtin_convertvector(left, ipack)
                - (2 * stride + 2);
        }
        static INLINE pack dot(const pack* a, const pack* b) {
            return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5]);
        }
        // Sixteen rows of six columns (and two not used) to six columns of sixteen rows.
        static INLINE void turn(const row8* r, pack* column) {
            pack a[4], b[4], c[4], d[4];
            for (int k = 0; k < 4; ++k) {
                a[k] = JOIN(r[k], r[4 + k]);
                b[k] = JOIN(r[8 + k], r[12 + k]);
            }
            quarter(a, c);
            quarter(b, d);
            for (int k = 0; k < 4; ++k) column[k] = EVEN(c[k], d[k]);
            for (int k = 0; k < 2; ++k) column[4 + k] = ODD(c[k], d[k]);
        }
        static INLINE void quarter(const pack* a, pack* b) {  // 4 x 4 blocks turned in place
            const pack low = LOW(a[0], a[1]), high = HIGH(a[0], a[1]);
            const pack low2 = LOW(a[2], a[3]), high2 = HIGH(a[2], a[3]);
            b[0] = LOWER(low, low2); b[1] = UPPER(low, low2);
            b[2] = LOWER(high, high2); b[3] = UPPER(high, high2);
        }
#endif
    };
"""


REACH = 4.0
"""Distance at which the Gaussian prefilter is truncated, in standard deviations."""

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
    """Variance of a gradient component of the interpolated noise, over a pixel's variance [1/px²]."""
    v, spline, power = _spectra(prefilter)
    passed = spline**2 * power * (v[1] - v[0])
    return float(np.sum((2.0 * np.pi * v) ** 2 * passed) * np.sum(passed))


@cache
def between_pixels(prefilter: float) -> tuple[float, FloatArray, FloatArray]:
    """Variance of interpolated noise between two pixels along an axis, over a pixel's variance.

    Returns: mean of the variance over both axes. Returns: coefficients of the variance, ``Σ spread u^2k``,
    and of half its derivative, ``Σ slope u^(2k+1)``, shape [4] each; u is the distance from the middle of two
    pixels.
    """
    v, spline, power = _spectra(prefilter)
    per_pixel = round(1.0 / (v[1] - v[0]))
    u = np.linspace(-0.5, 0.5, 101)
    variance, half = np.zeros_like(u), np.zeros_like(u)
    mean = 0.0
    for h in (-2, -1, 0, 1, 2):  # copies of the spectrum at distance h interfere with period 1/h
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


LEAST = 1e-8
"""Relative response below which the filter is truncated; it is below the rounding of fp32."""
LONGEST = 256
"""A response is computed over twice this length [px]."""
LINE = 16
"""Numbers in a cache line; rows of coefficients are padded to whole cache lines."""


@cache
def response(prefilter: float) -> FloatArray:
    """Symmetric filter from grey values to coefficients. It includes a Gaussian prefilter (standard deviation
    [px]).

    Returns: its central value and one side, shape [n]; the sum over both sides and the centre is 1.
    """
    impulse = np.zeros(2 * LONGEST + 1)
    impulse[LONGEST] = 1.0
    if prefilter:
        impulse = ndimage.gaussian_filter1d(impulse, prefilter, mode="mirror", truncate=REACH)
    coefficients = ndimage.spline_filter1d(impulse, order=5, mode="mirror")[LONGEST:]
    last = int(np.flatnonzero(np.abs(coefficients) > LEAST * np.abs(coefficients).max())[-1])
    side = coefficients[: last + 1]
    return np.asarray(side / (2.0 * side.sum() - side[0]))


def room(columns: int) -> int:
    """Length of a row of coefficients with its margins; every row begins on a cache line."""
    return columns + 2 * PAD + -(columns + 2 * PAD) % LINE


def on_host(grey: NDArray[np.float32], prefilter: float) -> NDArray[np.float32]:
    """Coefficients with mirrored margins of `PAD`, shape [rows + 2 PAD, columns + 2 PAD and more]."""
    side = response(prefilter)
    taps = np.concatenate([side[:0:-1], side]).astype(np.float32)
    level = np.float32(grey.mean(dtype=np.float64))  # rounding then scales with the contrast only
    filtered = cv2.sepFilter2D(
        np.ascontiguousarray(grey - level), cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REFLECT_101
    )
    right = room(grey.shape[1]) - grey.shape[1] - PAD
    return np.asarray(cv2.copyMakeBorder(filtered + level, PAD, PAD, PAD, right, cv2.BORDER_REFLECT_101))


@wp.func
def _mirrored(k: wp.int32, n: wp.int32):
    """Index of the pixel at place k of n, if the picture is mirrored at its edges."""
    period = 2 * (n - 1)
    inside = k % period
    if inside < 0:
        inside = inside + period
    return wp.min(inside, period - inside)


@wp.kernel(enable_backward=False)
def _along_rows(
    grey: wp.array3d(dtype=wp.float32), side: wp.array(dtype=wp.float32), result: wp.array3d(dtype=wp.float32)
):
    picture, row, column = wp.tid()
    columns = grey.shape[2]
    total = side[0] * grey[picture, row, column]
    for k in range(1, side.shape[0]):
        total = total + side[k] * (
            grey[picture, row, _mirrored(column - k, columns)]
            + grey[picture, row, _mirrored(column + k, columns)]
        )
    result[picture, row, column] = total


@wp.kernel(enable_backward=False)
def _along_columns(
    half: wp.array3d(dtype=wp.float32),
    side: wp.array(dtype=wp.float32),
    level: wp.array(dtype=wp.float32),
    pad: wp.int32,
    result: wp.array3d(dtype=wp.float32),
):
    picture, row, column = wp.tid()
    rows = half.shape[1]
    r, c = _mirrored(row - pad, rows), _mirrored(column - pad, half.shape[2])
    total = side[0] * half[picture, r, c]
    for k in range(1, side.shape[0]):
        total = total + side[k] * (
            half[picture, _mirrored(r - k, rows), c] + half[picture, _mirrored(r + k, rows), c]
        )
    result[picture, row, column] = total + level[picture]


@cache
def _side(prefilter: float, device: str) -> Any:
    return wp.array(response(prefilter), dtype=wp.float32, device=device)


def on_device(greys: Sequence[NDArray[np.float32]], prefilter: float, device: Any) -> Any:
    """As `on_host` for several pictures, by two launches on a device, shape [n, rows + 2 PAD, columns + 2 PAD
    and more].
    """
    levels = np.array([grey.mean(dtype=np.float64) for grey in greys], dtype=np.float32)
    side = _side(prefilter, device.alias)
    contrast = np.stack([grey - level for grey, level in zip(greys, levels, strict=True)])
    contrast_on_device: Any = wp.array(contrast, dtype=wp.float32, device=device)
    level: Any = wp.array(levels, dtype=wp.float32, device=device)
    half = wp.empty_like(contrast_on_device)
    n, rows, columns = contrast.shape
    wide = (n, rows + 2 * PAD, room(columns))
    filtered = wp.empty(wide, dtype=wp.float32, device=device)
    wp.launch(
        _along_rows, dim=contrast.shape, inputs=[contrast_on_device, side], outputs=[half], device=device
    )
    wp.launch(_along_columns, dim=wide, inputs=[half, side, level, PAD], outputs=[filtered], device=device)
    return filtered


WORKER = "WORKER_NUMBER"
"""Environment variable with the number of a process that shares the machine's GPUs, counted from 0."""
NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"


def select_device(name: str) -> Any:
    """Start Warp quietly and return a device: "cpu", "cuda:1", or for "cuda" the one of `own_gpu`.

    Raises ValueError if the machine has no such device; the message lists those it has.
    """
    _start()
    aliases = {"cpu"} | {device.alias for device in wp.get_cuda_devices()}
    alias = f"cuda:{own_gpu(len(wp.get_cuda_devices()))}" if name == "cuda" else name
    if alias not in aliases:
        raise ValueError(f"device must be one of {sorted(aliases)}, got {name!r}")
    return wp.get_device(alias)


def own_gpu(count: int) -> int:
    """Number of the GPU for this process, if processes share `count` GPUs. `WORKER` assigns them in turn. The
    first GPU is used if it is not set."""
    return int(os.environ.get(WORKER, "0")) % max(count, 1)


@cache
def _start() -> None:
    wp.config.log_level = wp.LOG_ERROR
    with _without(NO_DRIVER):
        wp.init()


@contextmanager
def _without(expected: str) -> Iterator[None]:
    """Remove one expected line of native code from stderr; all other output is kept."""
    try:
        saved = os.dup(2)
    except OSError:  # some services have no stderr: filtering is unnecessary
        yield
        return
    with tempfile.TemporaryFile(mode="w+", encoding="utf-8", errors="replace") as caught:
        sys.stderr.flush()
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            caught.seek(0)
            for line in caught:
                if expected not in line:
                    os.write(2, line.encode())


def coefficients(greys: Sequence[NDArray[np.float32]], prefilter: float, device: str) -> Any:
    """Coefficients of the quintic B-splines through pictures of one shape, on a device. They have mirrored
    margins; shape [n, rows + 2 PAD, columns + 2 PAD and more]."""
    where = select_device(device)
    if where.is_cuda:
        return on_device(greys, prefilter, where)
    planes = [on_host(grey, prefilter) for grey in greys]
    stacked = planes[0][None] if len(planes) == 1 else np.stack(planes)
    return wp.array(stacked, dtype=wp.float32, device=where, copy=False)


def addresses(parts: Sequence[Any]) -> Any:
    """Start of each picture's coefficients in the memory of their device, shape [n]."""
    begin = [part.ptr + k * part.strides[0] for part in parts for k in range(part.shape[0])]
    # a CPU reads the array in place
    return wp.array(np.array(begin, dtype=np.uint64), dtype=wp.uint64, device=parts[0].device, copy=False)


def upload(values: NDArray[np.float64], device: str) -> Any:
    """Numbers on a device, shape [n]."""
    return wp.array(values, dtype=wp.float64, device=select_device(device))

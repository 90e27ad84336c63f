"""Search along epipolar curves: C++, kernel and launches.

Lanes are defined as in the correlation (`dic.correlation.kernels.search`). On a CPU one pack of samples is
processed at a time. On a GPU one warp processes a point: its lanes share the samples, and each lane computes
the geometry.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.correlation.kernels.device import select_device
from dic.correlation.kernels.launch import FLAGS, WARPS_PER_PROCESSOR, load_kernel
from dic.correlation.kernels.search import BLOCK, PACKS
from dic.processes import cores

KNOTS = 65
"""Number of points of a curve that are computed before it is divided into equal steps."""
NARROWINGS = 3
"""Number of refinements of the part of a curve inside the picture. Each refinement is a few dozen times
finer."""
INPUTS = 19
"""Input numbers of a point: ray, derivative of the ray with respect to the pixel, gradient at the reference,
given gradient, and the smallest and largest inverse distance."""
OUTPUTS = 10
"""Output numbers of a point: position, gradient, correlation, second peak, distance, steps of its curve."""

_GEOMETRY = """
    // Camera 1: where it sees a point, and whether its picture shows it.
    struct camera {
        const double* c;
        double right, bottom;
        inline bool see(const double* X, double* in, double* at) const {
            for (int r = 0; r < 3; ++r)
                in[r] = c[3 * r] * X[0] + c[3 * r + 1] * X[1] + c[3 * r + 2] * X[2] + c[9 + r];
            if (!(in[2] > 0.0)) return false;
            const double x = in[0] / in[2], y = in[1] / in[2], r2 = x * x + y * y;
            const double radial = 1.0 + r2 * (c[17] + r2 * (c[18] + r2 * c[21]));
            const double u = x * radial + 2.0 * c[19] * x * y + c[20] * (r2 + 2.0 * x * x);
            const double v = y * radial + c[19] * (r2 + 2.0 * y * y) + 2.0 * c[20] * x * y;
            at[0] = c[12] * u + c[16] * v + c[14];
            at[1] = c[13] * v + c[15];
            return true;
        }
        inline bool shows(const double* in, const double* at) const {
            const double x = in[0] / in[2], y = in[1] / in[2];
            return at[0] >= 0.0 && at[1] >= 0.0 && at[0] <= right && at[1] <= bottom
                && x * x + y * y < c[22];
        }
        // Derivative of the pixel by the point.
        inline void slope(const double* in, double* P) const {
            const double z = 1.0 / in[2], x = in[0] * z, y = in[1] * z, r2 = x * x + y * y;
            const double k1 = c[17], k2 = c[18], p1 = c[19], p2 = c[20], k3 = c[21];
            const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
            const double growth = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3));
            const double across = growth * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
            const double xx = radial + growth * x * x + 2.0 * p1 * y + 6.0 * p2 * x;
            const double yy = radial + growth * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
            const double D[4] = {c[12] * xx + c[16] * across, c[12] * across + c[16] * yy,
                                 c[13] * across, c[13] * yy};
            for (int r = 0; r < 2; ++r) {
                const double a = D[2 * r] * z, b = D[2 * r + 1] * z, d = -(a * x + b * y);
                for (int k = 0; k < 3; ++k) P[3 * r + k] = a * c[k] + b * c[3 + k] + d * c[6 + k];
            }
        }
    };
    struct vec {
        static inline double dot(const double* a, const double* b) {
            return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        }
        static inline void unit(double* a) {
            const double s = 1.0 / sqrt(dot(a, a));
            for (int k = 0; k < 3; ++k) a[k] *= s;
        }
        static inline void cross(const double* a, const double* b, double* c) {
            c[0] = a[1] * b[2] - a[2] * b[1];
            c[1] = a[2] * b[0] - a[0] * b[2];
            c[2] = a[0] * b[1] - a[1] * b[0];
        }
    };
    // A point's ray from camera 0, and what camera 1 sees of a facet on it (`dic.stereo.epipolar_search`).
    struct ray {
        const double* origin;
        const double* d;  // unit vector, then its derivative by camera 0's pixel, [3, 2]
        inline void at(double s, double* X) const {
            for (int k = 0; k < 3; ++k) X[k] = origin[k] + s * d[k];
        }
        // Gradient of camera 1's pixel by camera 0's for a facet turned from the one that faces both alike.
        inline void gradient(const camera& other, const double* X, const double* in, double s,
                             const double* turn, double* A) const {
            double one[3], two[3], middle[3], axis[3], side[3], n[3], P[6];
            for (int k = 0; k < 3; ++k) { one[k] = -d[k]; two[k] = other.c[23 + k] - X[k]; }
            vec::unit(two);
            for (int k = 0; k < 3; ++k) middle[k] = one[k] + two[k];
            vec::unit(middle);
            vec::cross(one, two, axis);
            vec::unit(axis);
            vec::cross(axis, middle, side);
            for (int k = 0; k < 3; ++k)
                n[k] = (middle[k] * turn[0] + side[k] * turn[1]) * turn[2] + axis[k] * turn[3];
            other.slope(in, P);
            const double nd = vec::dot(n, d);
            const double* B = d + 3;
            for (int c = 0; c < 2; ++c) {
                const double q = (n[0] * B[c] + n[1] * B[2 + c] + n[2] * B[4 + c]) / nd;
                for (int r = 0; r < 2; ++r) {
                    double sum = 0.0;
                    for (int k = 0; k < 3; ++k) sum += P[3 * r + k] * (B[2 * k + c] - d[k] * q);
                    A[2 * r + c] = s * sum;
                }
            }
        }
    };
"""

_SAMPLES = """
    // A subset's samples: offsets, weights, and the template, its mean taken off and its norm 1.
    struct samples {
        const float* X; const float* Y; const float* W; const float* T;
        int room, start;
        float extent;   // of the offsets
        double count;   // sum of the weights

        // Correlation with the picture about `at`, deformed by A; -1 where less than half of it is seen.
        inline double correlate(const float* picture, int rows, int columns, const double* at,
                                const double* A) const {
            const double ix = floor(at[0]), iy = floor(at[1]);
            const float* origin = picture + (long long)iy * columns + (long long)ix;
            const float x0 = (float)(at[0] - ix), y0 = (float)(at[1] - iy);
            const float xx = (float)A[0], xy = (float)A[1], yx = (float)A[2], yy = (float)A[3];
            const float left = (float)-ix, right = (float)(columns - 1 - ix);
            const float top = (float)-iy, bottom = (float)(rows - 1 - iy);
            const float wide = (fabsf(xx) + fabsf(xy)) * extent, high = (fabsf(yx) + fabsf(yy)) * extent;
            const bool within = x0 - wide >= left && x0 + wide < right && y0 - high >= top
                && y0 + high < bottom;
            pack n = op::all(0.0f), g1 = n, g2 = n, gt = n, t1 = n, t2 = n;
            #pragma unroll 1
            for (int k = start; k < room; k += STEP) {
                const pack X_ = op::load(X + k), Y_ = op::load(Y + k), t = op::load(T + k);
                pack w = op::load(W + k);
                pack x = x0 + xx * X_ + xy * Y_, y = y0 + yx * X_ + yy * Y_;
                if (!within) {
                    const pack a = op::least(op::most(x, op::all(left)), op::all(right));
                    const pack b = op::least(op::most(y, op::all(top)), op::all(bottom));
                    w = w * op::choose((a == x) & (b == y), op::all(1.0f), op::all(0.0f));
                    x = a; y = b;
                    n += w; t1 += w * t; t2 += w * t * t;
                }
                // the last column and row are read from the pixel before them
                const pack u = op::least(op::down(x), op::all(right - 1.0f));
                const pack v = op::least(op::down(y), op::all(bottom - 1.0f));
                const pack g = bilinear(origin, columns, u, v, x - u, y - v);
                const pack wg = w * g;
                g1 += wg; g2 += wg * g; gt += wg * t;
            }
            double N = count, st = 0.0, tt = 1.0;
            if (!within) {
                N = op::sum(n); st = op::sum(t1); tt = op::sum(t2);
                if (2.0 * N < count || !(N > 0.0)) return -1.0;
            }
            const double sg = op::sum(g1), gg = op::sum(g2);
            const double vg = gg - sg * sg / N, vt = tt - st * st / N;
            if (!(vg > 1e-6 * gg) || !(vt > 1e-6 * tt)) return -1.0;
            return (op::sum(gt) - sg * st / N) / sqrt(vg * vt);
        }
#if defined(__CUDA_ARCH__)
        static INLINE pack bilinear(const float* origin, int columns, pack u, pack v, pack x, pack y) {
            const float* c = origin + (long long)(int)v * columns + (int)u;
            const float a = __ldg(c), b = __ldg(c + columns);
            const float over = a + x * (__ldg(c + 1) - a);
            return over + y * (b + x * (__ldg(c + columns + 1) - b) - over);
        }
#else
        static INLINE pack bilinear(const float* origin, int columns, pack u, pack v, pack x, pack y) {
            const ipack at = __builtin_convertvector(v, ipack) * columns + __builtin_convertvector(u, ipack);
            pack a, b, c, d;
            #pragma unroll
            for (int l = 0; l < STEP; ++l) {
                const float* p = origin + at[l];
                a[l] = p[0]; b[l] = p[1]; c[l] = p[columns]; d[l] = p[columns + 1];
            }
            const pack over = a + x * (b - a);
            return over + y * (c + x * (d - c) - over);
        }
#endif
    };
"""

_SEARCH = """
    const camera other = {job.camera.data, job.columns - 1.0, job.rows - 1.0};
    double* profile = job.profile.data + (long long)slot * job.longest;
    const int start = STEP == 32 ? lane : 0;
    for (int i = first + slot; i < first + count; i += slots) {
        const double* given = job.given.data + (long long)i * GIVEN;
        const ray from = {job.camera.data + 26, given};
        const double* F = given + 9;  // of camera 0's pixel by the material picture's
        const long long at_sample = (long long)i * job.room;
        const samples wanted = {job.offsets.data, job.offsets.data + job.room, job.weight.data + at_sample,
                                job.sample.data + at_sample, job.room, start, job.extent, job.seen.data[i]};
        double X[3], in[3], at[2], low = given[17], high = given[18];

        // The piece of the curve that the picture shows, cut out of knots of equal steps of 1/s.
        for (int round = 0; round < NARROWINGS; ++round) {
            int begin = -1, end = -1;
            for (int k = 0; k < KNOTS; ++k) {
                from.at(1.0 / (low + (high - low) * (k / (KNOTS - 1.0))), X);
                if (!(other.see(X, in, at) && other.shows(in, at))) continue;
                if (begin < 0) begin = k;
                end = k;
            }
            const double width = (high - low) / (KNOTS - 1.0), from_low = low;
            low = from_low + width * (begin > 0 ? begin - 1 : 0);
            high = begin < 0 ? low : from_low + width * (end + 1 < KNOTS ? end + 1 : KNOTS - 1);
        }
        double length[KNOTS], before[2] = {0.0, 0.0};
        bool there = false;
        for (int k = 0; k < KNOTS; ++k) {
            from.at(1.0 / (low + (high - low) * (k / (KNOTS - 1.0))), X);
            const bool now = other.see(X, in, at);
            const double dx = at[0] - before[0], dy = at[1] - before[1];
            length[k] = k ? length[k - 1] + (there && now ? sqrt(dx * dx + dy * dy) : 0.0) : 0.0;
            if (now) { before[0] = at[0]; before[1] = at[1]; }
            there = now;
        }
        const long long steps = (long long)ceil((length[KNOTS - 1] + 1e-9) / job.step);

        // The subset at every step, the farthest place of the curve last.
        double best = -1.0, found[FOUND];
        for (int k = 0; k < FOUND; ++k) found[k] = 0.0;
        found[6] = found[7] = -1.0;
        found[9] = (double)steps;
        int peak = -1, knot = KNOTS - 1;
        for (int k = 0; k < steps && steps <= job.longest; ++k) {
            const double along = (steps - 1 - k) * job.step;
            while (knot > 0 && length[knot] > along) --knot;
            double place = low + (high - low) * (knot / (KNOTS - 1.0));
            if (knot < KNOTS - 1 && length[knot + 1] > length[knot])
                place += (high - low) / (KNOTS - 1.0) * (along - length[knot])
                    / (length[knot + 1] - length[knot]);
            const double s = 1.0 / place;
            from.at(s, X);
            double highest = -1.0;
            if (other.see(X, in, at) && other.shows(in, at)) {
                for (int h = 0; h < job.n_turns; ++h) {
                    double G[4], A[4];
                    if (job.has_gradient) for (int c = 0; c < 4; ++c) G[c] = given[13 + c];
                    else from.gradient(other, X, in, s, job.turns.data + 4 * h, G);
                    for (int r = 0; r < 2; ++r)
                        for (int c = 0; c < 2; ++c)
                            A[2 * r + c] = G[2 * r] * F[c] + G[2 * r + 1] * F[2 + c];
                    const double zncc = wanted.correlate(job.picture.data, job.rows, job.columns, at, A);
                    if (zncc > highest) highest = zncc;
                    if (zncc > best) {
                        best = zncc; peak = k;
                        found[0] = at[0]; found[1] = at[1]; found[8] = s;
                        for (int c = 0; c < 4; ++c) found[2 + c] = A[c];
                    }
                }
            }
            profile[k] = highest;
        }
        op::meet();
        if (peak >= 0) {  // crests of the other places, outside the slopes of the best one
            int left = peak, right = peak + 1;
            while (left > 0 && profile[left - 1] < profile[left]) --left;
            while (right < steps && profile[right] < profile[right - 1]) ++right;
            for (int k = 0; k < steps; ++k) {
                if (k != peak && k >= left && k < right) continue;
                double crest = profile[k];
                if (k > 0 && k + 1 < steps) {
                    const double a = profile[k - 1], b = profile[k + 1], bend = 2.0 * crest - a - b;
                    if (crest >= a && crest >= b && bend > 0.0 && a > -1.0 && b > -1.0) {
                        crest += (b - a) * (b - a) / (8.0 * bend);
                        if (crest > 1.0) crest = 1.0;
                    }
                }
                double* kept = found + (k == peak ? 6 : 7);
                if (crest > *kept) *kept = crest;
            }
        }
        if (start == 0)
            for (int k = 0; k < FOUND; ++k) job.found.data[(long long)i * FOUND + k] = found[k];
        op::meet();
    }
"""


def curve_source() -> str:
    """Body of the native function that searches the curves of a batch of points."""
    text = f"    constexpr int KNOTS = {KNOTS}, NARROWINGS = {NARROWINGS};\n"
    text += f"    constexpr int GIVEN = {INPUTS}, FOUND = {OUTPUTS};\n"
    return text + PACKS + _GEOMETRY + _SAMPLES + _SEARCH


SHARE = 64
"""Number of points that a CPU thread takes at a time."""
LONGEST = 1024
"""Initial capacity for the steps of a curve."""


@wp.struct
class CurveJob:
    """Inputs and outputs of a search along curves."""

    camera: wp.array(dtype=wp.float64)
    picture: wp.array(dtype=wp.float32)
    rows: int
    columns: int
    given: wp.array(dtype=wp.float64)
    has_gradient: int
    turns: wp.array(dtype=wp.float64)
    n_turns: int
    step: wp.float64
    offsets: wp.array(dtype=wp.float32)
    extent: wp.float32
    room: int
    sample: wp.array(dtype=wp.float32)
    weight: wp.array(dtype=wp.float32)
    seen: wp.array(dtype=wp.float64)
    profile: wp.array(dtype=wp.float64)
    longest: int
    found: wp.array(dtype=wp.float64)


@dataclass(frozen=True)
class Curves:
    """Subsets and the curves along which they are searched; arrays in C order."""

    camera: NDArray[np.float64]
    """Parameters of camera 1 for the kernel, and camera 0's centre, shape [29]."""
    picture: NDArray[np.float32]
    """Camera 1's picture, smoothed, shape [rows, columns]."""
    given: NDArray[np.float64]
    """Input numbers of each point, shape [n, `dic.correlation.kernels.curve.INPUTS`]."""
    has_gradient: bool
    """True if `given` contains a gradient that is used along the whole curve."""
    turns: NDArray[np.float64]
    """Cosine and sine of each rotation within and out of the epipolar plane, shape [h, 4]."""
    step: float
    """Step along the curve [px]."""
    xi: NDArray[np.float64]
    """Offsets of the samples [px], shape [m, 2]."""
    template: NDArray[np.float32]
    """Templates, shape [n, m]."""
    weight: NDArray[np.float32]
    """1 for a sample that is used, else 0, shape [n, m]."""


@cache
def curve_kernel() -> Any:
    """Generate the kernel."""

    @wp.func_native(snippet=curve_source())
    def search(job: CurveJob, slot: int, slots: int, first: int, count: int): ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": FLAGS})
    def search_curves(job: CurveJob, slots: int, first: int, count: int, lanes: int):
        search(job, wp.tid() // lanes, slots, first, count)

    return search_curves


def search(curves: Curves, device: str, threads: int | None = None) -> NDArray[np.float64]:
    """Search the curves of all points.

    ``curves``: subsets and curves. ``threads``: CPU threads; None: all cores that the process may use. The
    result does not depend on it. Returns: for each point position (2), gradient (4), correlation, second
    peak, distance and number of steps, shape [n, `dic.correlation.kernels.curve.OUTPUTS`].
    """
    n, where = len(curves.given), select_device(device)
    result = np.zeros((n, OUTPUTS))
    rows, longest = np.arange(n), LONGEST
    while rows.size:  # a curve longer than the capacity is searched again
        result[rows] = _search(curves, rows, longest, where, threads or cores())
        rows = rows[result[rows, 9] > longest]
        longest = int(result[rows, 9].max(initial=0.0))
    return result


def _search(
    curves: Curves, rows: NDArray[np.int64], longest: int, device: Any, threads: int
) -> NDArray[np.float64]:
    n, m = len(rows), len(curves.xi)
    room = -(-m // 32) * 32
    wide = np.zeros((2, n, room), dtype=np.float32)
    wide[0, :, :m], wide[1, :, :m] = curves.template[rows], curves.weight[rows]
    offsets = np.zeros((2, room), dtype=np.float32)
    offsets[:, :m] = curves.xi.T
    job = CurveJob()
    for name, array, dtype in (
        ("camera", curves.camera, wp.float64),
        ("picture", curves.picture.reshape(-1), wp.float32),
        ("given", curves.given[rows].reshape(-1), wp.float64),
        ("turns", curves.turns.reshape(-1), wp.float64),
        ("offsets", offsets.reshape(-1), wp.float32),
        ("sample", wide[0].reshape(-1), wp.float32),
        ("weight", wide[1].reshape(-1), wp.float32),
        ("seen", np.maximum(curves.weight[rows].sum(axis=1, dtype=np.float64), 1.0), wp.float64),
    ):
        # a CPU reads the array in place; the job keeps a reference to it
        setattr(job, name, wp.array(np.ascontiguousarray(array), dtype=dtype, device=device, copy=False))
    job.rows, job.columns = curves.picture.shape
    job.has_gradient, job.n_turns = int(curves.has_gradient), len(curves.turns)
    job.step = curves.step
    job.extent, job.room, job.longest = float(np.abs(curves.xi).max(initial=0.0)), room, longest
    job.found = wp.empty(n * OUTPUTS, dtype=wp.float64, device=device)
    kernel = curve_kernel()
    if device.is_cuda:
        slots = min(n, device.sm_count * WARPS_PER_PROCESSOR)
        job.profile = wp.empty(slots * longest, dtype=wp.float64, device=device)
        wp.launch(kernel, dim=slots * 32, inputs=[job, slots, 0, n, 32], device=device, block_dim=BLOCK)
        return np.asarray(job.found.numpy().reshape(n, OUTPUTS))
    load_kernel(kernel, device.alias, 1)
    workers = max(1, min(threads, -(-n // SHARE)))
    job.profile = wp.empty(workers * longest, dtype=wp.float64, device=device)

    def share(worker: int) -> None:
        for first in range(worker * SHARE, n, workers * SHARE):
            # one slot: each worker has a view of its profile, at its first index
            inputs = [_part_of(job, worker, longest), 1, first, min(SHARE, n - first), 1]
            wp.launch(kernel, dim=1, inputs=inputs, device=device, block_dim=1)

    if workers == 1:
        share(0)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(share, range(workers)))
    return np.asarray(job.found.numpy().reshape(n, OUTPUTS))


def _part_of(job: Any, worker: int, longest: int) -> Any:
    """The job with the profile of one worker."""
    copy = CurveJob()
    for name in CurveJob.vars:
        setattr(copy, name, getattr(job, name))
    copy.profile = job.profile[worker * longest : (worker + 1) * longest]
    return copy

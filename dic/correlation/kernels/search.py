"""The C++ of the search: lanes, shape functions, one subset, Gauss-Newton from a guess to an outcome.

The same source is used for both kinds of device. On a CPU a `pack` is a SIMD register of pixels and one
thread processes a subset. On a GPU a `pack` is one number, and the 32 lanes of a GPU warp process a subset
together.

The twelve parameters of a subset's warp are those of `dic.correlation.subsets.NAMES`. Warps are composed by
value, first and second derivatives at the centre of the subset. This is exact for affine warps. For quadratic
warps it omits the third and fourth order, as the shape function does.
"""

from dic.correlation.kernels.device import GRAIN, SPLINE
from dic.outcome import PointOutcome

BLOCK = 128
"""Threads of a GPU's block: four warps. Each warp processes one point."""

PACKS = """
    #define INLINE inline __attribute__((always_inline))
#if defined(__CUDA_ARCH__)
    typedef float pack;
    constexpr int STEP = 32;  // pixels of a pack, over all lanes
    // One for the lanes of a warp.
    #define SHARED(type, name) \\
        __shared__ type name##_of_warps[WARPS]; type& name = name##_of_warps[threadIdx.x >> 5]
    const int lane = threadIdx.x & 31;
    struct op {
        static inline double positive(double x) { return x > 0.0 ? x : 0.0; }
        static inline pack all(float x) { return x; }
        static inline pack load(const float* p) { return *p; }
        static inline void store(float* p, pack x) { *p = x; }
        static inline pack down(pack x) { return floorf(x); }
        static inline pack choose(bool c, pack a, pack b) { return c ? a : b; }
        static inline pack least(pack a, pack b) { return fminf(a, b); }
        static inline pack most(pack a, pack b) { return fmaxf(a, b); }
        static inline double sum(pack x) {
            #pragma unroll
            for (int o = 16; o > 0; o >>= 1) x += __shfl_xor_sync(0xffffffffu, x, o);
            return x;
        }
        static inline void meet() { __syncwarp(); }
    };
#else
    constexpr int STEP = 16;  // pixels of a pack
    #define SHARED(type, name) type name
    const int lane = 0;
    typedef float pack __attribute__((ext_vector_type(16)));
    typedef float packu __attribute__((ext_vector_type(16), aligned(4)));
    typedef int ipack __attribute__((ext_vector_type(16)));
    typedef double pair2 __attribute__((ext_vector_type(2)));
    typedef double pair4 __attribute__((ext_vector_type(4)));
    typedef double pair8 __attribute__((ext_vector_type(8)));
    typedef float row8 __attribute__((ext_vector_type(8)));
    typedef float row8u __attribute__((ext_vector_type(8), aligned(4)));
    #define JOIN(a, b) \
        __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
    // Within every four lanes: the lower two of each in turn, the upper two; then in pairs.
    #define LOW(a, b) \
        __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29)
    #define HIGH(a, b) \
        __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31)
    #define LOWER(a, b) \
        __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29)
    #define UPPER(a, b) \
        __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31)
    // Every second four lanes.
    #define EVEN(a, b) \
        __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27)
    #define ODD(a, b) \
        __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15, 20, 21, 22, 23, 28, 29, 30, 31)
    struct op {
        static inline double positive(double x) { return x > 0.0 ? x : 0.0; }
        static inline pack all(float x) { return (pack)(x); }
        static inline pack load(const float* p) { return *(const packu*)p; }
        static inline void store(float* p, pack x) { *(packu*)p = x; }
        static inline pack down(pack x) { return __builtin_elementwise_floor(x); }
        static inline pack choose(ipack c, pack a, pack b) { return c ? a : b; }
        static inline pack least(pack a, pack b) { return a < b ? a : b; }
        static inline pack most(pack a, pack b) { return a > b ? a : b; }
        static inline double sum(pack x) {
            const pair8 wide = __builtin_convertvector(x.lo, pair8) + __builtin_convertvector(x.hi, pair8);
            const pair4 half = wide.lo + wide.hi;
            const pair2 two = half.lo + half.hi;
            return two.lo + two.hi;
        }
        static inline void meet() {}
    };
#endif
"""


JETS = """
    struct jet {
        // Place relative to the material point, and the gradient F (I included), at an offset.
        static inline void at(const double* w, double x, double y, double* place, double* F) {
            F[0] = 1.0 + w[2] + w[6] * x + w[7] * y;
            F[1] = w[3] + w[7] * x + w[8] * y;
            F[2] = w[4] + w[9] * x + w[10] * y;
            F[3] = 1.0 + w[5] + w[10] * x + w[11] * y;
            place[0] = x + w[0] + w[2] * x + w[3] * y + 0.5 * w[6] * x * x + w[7] * x * y
                + 0.5 * w[8] * y * y;
            place[1] = y + w[1] + w[4] * x + w[5] * y + 0.5 * w[9] * x * x + w[10] * x * y
                + 0.5 * w[11] * y * y;
        }
        static inline bool inverse(const double* F, double* A) {
            const double det = F[0] * F[3] - F[1] * F[2];
            if (!(det > 0.0)) return false;
            const double one = 1.0 / det;
            A[0] = F[3] * one; A[1] = -F[1] * one; A[2] = -F[2] * one; A[3] = F[0] * one;
            return true;
        }
        // w <- w o d^-1, to second order at the centre; false if one of them folds.
        static inline bool update(double* w, const double* d) {
            double x = 0.0, y = 0.0, e[2], F[4], A[4];
            for (int k = 0; k < 4; ++k) {  // Newton: the offset that d carries to the centre
                at(d, x, y, e, F);
                if (!inverse(F, A)) return false;
                x -= A[0] * e[0] + A[1] * e[1];
                y -= A[2] * e[0] + A[3] * e[1];
            }
            at(d, x, y, e, F);
            if (!inverse(F, A)) return false;
            double place[2], P[4], bent[2][3], back[2][3];
            at(w, x, y, place, P);
            for (int c = 0; c < 2; ++c) {
                pull(d + 6 + 3 * c, A, bent[c]);
                pull(w + 6 + 3 * c, A, back[c]);
            }
            for (int k = 0; k < 3; ++k) {  // second derivatives of d^-1 are -A times those of d, pulled back
                const double first = A[0] * bent[0][k] + A[1] * bent[1][k];
                const double second = A[2] * bent[0][k] + A[3] * bent[1][k];
                w[6 + k] = back[0][k] - P[0] * first - P[1] * second;
                w[9 + k] = back[1][k] - P[2] * first - P[3] * second;
            }
            w[0] = place[0];
            w[1] = place[1];
            w[2] = P[0] * A[0] + P[1] * A[2] - 1.0;
            w[3] = P[0] * A[1] + P[1] * A[3];
            w[4] = P[2] * A[0] + P[3] * A[2];
            w[5] = P[2] * A[1] + P[3] * A[3] - 1.0;
            return true;
        }
        // A' Q A of a symmetric form (xx, xy, yy)
        static inline void pull(const double* Q, const double* A, double* out) {
            const double a = Q[0] * A[0] + Q[1] * A[2], b = Q[0] * A[1] + Q[1] * A[3];
            const double c = Q[1] * A[0] + Q[2] * A[2], d = Q[1] * A[1] + Q[2] * A[3];
            out[0] = A[0] * a + A[2] * c;
            out[1] = A[0] * b + A[2] * d;
            out[2] = A[1] * b + A[3] * d;
        }
        // Half the width and height of the box about the centre that holds the subset's image.
        static inline void box(const double* w, double h, double* half) {
            for (int c = 0; c < 2; ++c) {
                const double* g = w + 2 + 2 * c;
                const double* q = w + 6 + 3 * c;
                half[c] = h * (fabs(g[0] + (c == 0)) + fabs(g[1] + (c == 1)))
                    + h * h * (0.5 * fabs(q[0]) + fabs(q[1]) + 0.5 * fabs(q[2]));
            }
        }
        // How far d moves the corner of the subset that it moves most.
        static inline double farthest(const double* d, double h) {
            double most = 0.0;
            for (int k = 0; k < 4; ++k) {
                const double x = (k & 1) ? h : -h, y = (k & 2) ? h : -h;
                double place[2], F[4];
                at(d, x, y, place, F);
                const double far = sqrt((place[0] - x) * (place[0] - x) + (place[1] - y) * (place[1] - y));
                if (!(far <= most)) most = far;
            }
            return most;
        }
    };
"""


SUBSET = """
    // One picture of a stack.
    struct view {
        const float* origin;  // the coefficient of pixel (0, 0)
        int rows, cols, stride;
    };
    // Next to the edge of a picture the mirrored spline is not that of the scene.
    constexpr double EDGE = 2.0;
    // Where a warp puts the subset's pixels: fp32 offsets from a whole pixel, exact to 1e-6 px.
    struct places {
        const float* origin;
        int stride;
        float x0, y0, xx, xy, yx, yy, xxx, xxy, xyy, yxx, yxy, yyy;
        float low_x, high_x, low_y, high_y, per_pixel;
        bool within;  // the whole square is
        bool sane;

        inline void set(const view& v, double cx, double cy, const double* w, double h) {
            const double px = cx + w[0], py = cy + w[1];
            sane = fabs(px) < 1e7 && fabs(py) < 1e7;  // not so for a NaN
            if (!sane) return;
            double half[2];
            jet::box(w, h, half);
            within = px - half[0] >= EDGE && px + half[0] <= v.cols - 1.0 - EDGE
                && py - half[1] >= EDGE && py + half[1] <= v.rows - 1.0 - EDGE;
            const double ix = floor(px), iy = floor(py);
            stride = v.stride;
            origin = v.origin + (long long)iy * v.stride + (long long)ix;
            x0 = (float)(px - ix); y0 = (float)(py - iy);
            // offsets are in units of half a subset
            xx = (float)((1.0 + w[2]) * h); xy = (float)(w[3] * h);
            yx = (float)(w[4] * h); yy = (float)((1.0 + w[5]) * h);
            const double b = h * h;
            xxx = (float)(0.5 * w[6] * b); xxy = (float)(w[7] * b); xyy = (float)(0.5 * w[8] * b);
            yxx = (float)(0.5 * w[9] * b); yxy = (float)(w[10] * b); yyy = (float)(0.5 * w[11] * b);
            per_pixel = (float)(1.0 / h);
            low_x = (float)(EDGE - ix); high_x = (float)(v.cols - 1 - EDGE - ix);
            low_y = (float)(EDGE - iy); high_y = (float)(v.rows - 1 - EDGE - iy);
        }
        inline void of(pack X, pack Y, pack* x, pack* y) const {
            *x = x0 + xx * X + xy * Y;
            *y = y0 + yx * X + yy * Y;
            if (ORDER == 6) {
                const pack a = X * X, b = X * Y, c = Y * Y;
                *x += xxx * a + xxy * b + xyy * c;
                *y += yxx * a + yxy * b + yyy * c;
            }
        }
        // Gradient of the template by the offset in the subset [1/px] from that in its picture.
        inline void turn(pack X, pack Y, pack* gx, pack* gy) const {
            pack a = op::all(xx), b = op::all(xy), c = op::all(yx), d = op::all(yy);
            if (ORDER == 6) {
                a += 2.0f * xxx * X + xxy * Y; b += xxy * X + 2.0f * xyy * Y;
                c += 2.0f * yxx * X + yxy * Y; d += yxy * X + 2.0f * yyy * Y;
            }
            const pack x = *gx * per_pixel, y = *gy * per_pixel;
            *gx = x * a + y * c;
            *gy = x * b + y * d;
        }
        // The same, held inside the picture; `inside` is 1 where nothing had to be held.
        inline pack held(pack* x, pack* y) const {
            const pack a = op::least(op::most(*x, op::all(low_x)), op::all(high_x));
            const pack b = op::least(op::most(*y, op::all(low_y)), op::all(high_y));
            const pack inside = op::choose((a == *x) & (b == *y), op::all(1.0f), op::all(0.0f));
            *x = a; *y = b;
            return inside;
        }
        // Pixels of the subset, U, that lie in the picture.
        inline double seen(const float* X, const float* Y, const float* U, int room, int start) const {
            pack count = op::all(0.0f);
            #pragma unroll 1
            for (int k = start; k < room; k += STEP) {
                pack px, py;
                of(op::load(X + k), op::load(Y + k), &px, &py);
                count += op::load(U + k) * held(&px, &py);
            }
            return op::sum(count);
        }
    };
    // 1 where the material picture's mask holds, 0 elsewhere and outside that picture.
    struct material {
        const unsigned char* mask;
        int rows, cols;
        double cx, cy, h;
        inline float one(float X, float Y) const {
            const double x = floor(cx + h * X + 0.5), y = floor(cy + h * Y + 0.5);
            if (!(x >= 0.0 && x < cols && y >= 0.0 && y < rows)) return 0.0f;
            return mask[(long long)y * cols + (long long)x] ? 1.0f : 0.0f;
        }
        inline pack at(pack X, pack Y) const {
#if defined(__CUDA_ARCH__)
            return one(X, Y);
#else
            pack found;
            for (int l = 0; l < STEP; ++l) found[l] = one(X[l], Y[l]);
            return found;
#endif
        }
    };
    // 1, x, y, x^2/2, xy, y^2/2 in units of half a subset
    struct monomials {
        pack m[ORDER];
        inline void set(pack X, pack Y) {
            m[0] = op::all(1.0f);
            if (ORDER > 1) { m[1 % ORDER] = X; m[2 % ORDER] = Y; }
            if (ORDER > 3) {
                m[3 % ORDER] = 0.5f * X * X; m[4 % ORDER] = X * Y; m[5 % ORDER] = 0.5f * Y * Y;
            }
        }
    };
    constexpr int K = 2 * ORDER;  // numbers searched for
    // What the template contributes to the match; sums over the pixels that count. On a GPU the lanes of a
    // warp share one, and all write the same numbers, each once.
    constexpr int NUMBERS = 6 + 2 * K + 2 * K * K;  // of a normal matrix and its sums
    constexpr int SUMS = NUMBERS + 3 + K;           // and what else is kept of a template
    struct normal {
        double n, mean, energy, gradient[3];  // pixels, mean of T, sum of (T - mean)^2, tensor of gradients
        double S[K], q[K];                    // sums of steepest descents, and of them times T - mean
        double H[K * K];                      // of their products, offset and contrast projected out
        double L[K * K];                      // its Cholesky factor, the diagonal inverted
        bool definite;

        inline void sum(const float* W, const float* T, const float* GX, const float* GY,
                        const float* X, const float* Y, int room, int start) {
            constexpr int PAIRS = ORDER * (ORDER + 1) / 2;
            pack count = op::all(0.0f), first = count, second = count;
            pack s[K], t[K], h[3 * PAIRS];
            for (int i = 0; i < K; ++i) { s[i] = op::all(0.0f); t[i] = s[i]; }
            for (int i = 0; i < 3 * PAIRS; ++i) h[i] = op::all(0.0f);
            monomials at;
            #pragma unroll 1
            for (int k = start; k < room; k += STEP) {
                const pack w = op::load(W + k), T0 = op::load(T + k);
                const pack gx = op::load(GX + k), gy = op::load(GY + k);
                at.set(op::load(X + k), op::load(Y + k));
                const pack wT = w * T0, wx = w * gx, wy = w * gy;
                count += w; first += wT; second += wT * T0;
                int pair = 0;
                for (int i = 0; i < ORDER; ++i) {
                    const pack ax = wx * at.m[i], ay = wy * at.m[i];
                    s[i] += ax; s[ORDER + i] += ay;
                    t[i] += ax * T0; t[ORDER + i] += ay * T0;
                    for (int j = i; j < ORDER; ++j, ++pair) {
                        const pack bx = gx * at.m[j], by = gy * at.m[j];
                        h[3 * pair] += ax * bx; h[3 * pair + 1] += ax * by; h[3 * pair + 2] += ay * by;
                    }
                }
            }
            op::meet();
            n = op::sum(count);
            const double total = op::sum(first);
            mean = total / n;
            energy = op::sum(second) - mean * total;
            for (int i = 0; i < K; ++i) { S[i] = op::sum(s[i]); q[i] = op::sum(t[i]) - mean * S[i]; }
            int pair = 0;
            for (int i = 0; i < ORDER; ++i)
                for (int j = i; j < ORDER; ++j, ++pair) {
                    const double a = op::sum(h[3 * pair]), b = op::sum(h[3 * pair + 1]);
                    const double c = op::sum(h[3 * pair + 2]);
                    if (pair == 0) { gradient[0] = a; gradient[1] = b; gradient[2] = c; }
                    put(j, i, a); put(ORDER + j, ORDER + i, c);
                    put(ORDER + j, i, b);
                    if (i != j) put(ORDER + i, j, b);
                }
            op::meet();
            factor();
            op::meet();
        }
        inline void save(double* to) const {
            for (int k = 0; k < NUMBERS; ++k) to[k] = (&n)[k];
            to[NUMBERS] = definite;
        }
        inline void load(const double* from) {
            for (int k = 0; k < NUMBERS; ++k) (&n)[k] = from[k];
            definite = from[NUMBERS] != 0.0;
        }
        // Below the diagonal: a sum of products without what offset and contrast take up.
        inline void put(int i, int j, double x) {
            H[i * K + j] = x - S[i] * S[j] * (1.0 / n) - q[i] * q[j] * (1.0 / energy);
        }
        inline void factor() {
            bool fine = energy > 0.0;
            for (int i = 0; i < K && fine; ++i)
                for (int j = 0; j <= i; ++j) {
                    double x = H[i * K + j];
                    for (int k = 0; k < j; ++k) x -= L[i * K + k] * L[j * K + k];
                    if (i == j) {
                        // fp32 sums leave 1e-7 of the diagonal: less than 1e-5 of it is no information
                        if (!(x > 1e-5 * H[i * K + i])) { fine = false; break; }
                        L[i * K + i] = 1.0 / sqrt(x);
                    } else {
                        L[i * K + j] = x * L[j * K + j];
                    }
                }
            definite = fine;
        }
        inline void solve(double* b) const {
            for (int i = 0; i < K; ++i) {
                for (int k = 0; k < i; ++k) b[i] -= L[i * K + k] * b[k];
                b[i] *= L[i * K + i];
            }
            for (int i = K - 1; i >= 0; --i) {
                for (int k = i + 1; k < K; ++k) b[i] -= L[k * K + i] * b[k];
                b[i] *= L[i * K + i];
            }
        }
    };
"""


ARRAYS = 5
"""Arrays of a subset's pixels that a search keeps in its scratch."""
OUTPUTS = 19
"""Output numbers of a point: warp, covariance, correlation, updates, outcome. Inputs and outputs are stored
number by number for all points. The caller gets views of this memory without a copy."""
INPUTS = 29
"""Largest number of inputs of a point: pictures and row (3), position in the picture (2), two warps."""
PACE = 6
"""The convergence rate is checked over this number of updates. A search that cannot end in time is
stopped."""
SLOW, SLOWEST, ASIDE, NEAR = 0.2, 0.9, 0.4, 0.1
"""Two steps in a row are the start of a geometric series if the second one is the first one times a factor
between the first two numbers, up to a rest of at most this share of its length. The second step is then
lengthened to the sum of the series. Such searches would converge slowly or be stopped. A search for a
translation alone converges fast. A step that moves a corner of the subset by this far or farther [px] is not
lengthened: the search has not found its speckles yet, and a longer step can lose them."""
SHRUNK, SAFE = 0.3, 2.0
"""If a step is at most the first number times the one before, the search converges fast. The way left is then
the sum of a geometric series, times the second number, because later steps shrink by less."""

_SEARCH = """
    const double h = 0.5 * (job.subset - 1);
    const long long all = job.points;
    const int square = job.subset * job.subset, room = job.room;
    float* W = (float*)job.scratch + (long long)slot * ARRAYS * room;
    const float* X = (const float*)job.offsets;
    const float* Y = X + room;
    const float* U = Y + room;  // 1 for a pixel of the subset, 0 for what fills the last pack
    const int start = STEP == 32 ? lane : 0;
    SHARED(normal, N);

    for (int i = first + slot; i < first + count; i += slots) {
        const double* given = (const double*)job.given;  // a column after the other
        const double cx = given[3 * all + 2LL * i], cy = given[3 * all + 2LL * i + 1];
        double w[12], reference[12];
        for (int k = 0; k < 12; ++k) {
            w[k] = given[5 * all + 12LL * i + k];
            reference[k] = job.has_reference ? given[17 * all + 12LL * i + k] : 0.0;
        }
        const long long a = (long long)given[i], b = (long long)given[all + i];  // which pictures
        // The template, in memory that lasts if its point has some: B is W where the whole subset is in view.
        const long long place = job.has_kept ? (long long)given[2 * all + i] : -1;
        const bool ready = place >= 0 && ((int*)job.known)[place];
        float* T = place >= 0 ? (float*)job.kept_pixels + place * 4 * room : W + room;
        float* GX = T + room; float* GY = GX + room; float* B = GY + room;
        const float* origin_f = ((const float* const*)job.f)[a] + job.f_first;
        const float* origin_g = ((const float* const*)job.g)[b] + job.g_first;
        const view f = {origin_f, job.f_rows, job.f_cols, job.f_stride};
        const view g = {origin_g, job.g_rows, job.g_cols, job.g_stride};
        const double* grey_f = (const double*)job.f_noise + 2 * a;  // variance in the dark, gain
        const double* grey_g = (const double*)job.g_noise + 2 * b;
        const material body = {(const unsigned char*)job.mask, job.mask_rows, job.mask_cols, cx, cy, h};
        int outcome = NOT_CONVERGED, iterations = 0;
        double zncc = 0.0, covariance[3] = {0.0, 0.0, 0.0}, odd = 0.0;
        for (int k = 0; k < 12; ++k) odd += w[k] * 0.0 + reference[k] * 0.0;  // NaN if one is not finite
        double here[2], F0[4], F1[4], A[4], step[12];
        places from, to;

        from.set(f, cx, cy, reference, h);
        jet::at(reference, 0.0, 0.0, here, F0);
        if (odd != 0.0) {
            outcome = NO_FIRST_GUESS;
        } else if (!from.sane || !jet::inverse(F0, A)) {
            outcome = OUT_OF_VIEW;
        } else if (to.set(g, cx, cy, w, h), to.sane && !to.within
                   && to.seen(X, Y, U, room, start) < job.least_pixels * square) {
            outcome = OUT_OF_VIEW;  // as it would be found after the template's work
        } else {
            double level = 0.0, between_f = 0.0, drift[K];
            bool enough = true;
            monomials at;
            if (ready) {
                const double* kept = (double*)job.kept_sums + place * SUMS;
                N.load(kept);
                level = kept[SUMS - K - 2]; between_f = kept[SUMS - K - 1];
                for (int j = 0; j < K; ++j) drift[j] = kept[SUMS - K + j];
                for (int k = start; k < room; k += STEP) op::store(W + k, op::load(B + k));
            } else {
                // The template and its gradient by the offset in the subset.
                pack counted = op::all(0.0f), total = counted, grit = counted, tilt[K];
                for (int j = 0; j < K; ++j) tilt[j] = op::all(0.0f);
                #pragma unroll 1
                for (int k = start; k < room; k += STEP) {
                    const pack x = op::load(X + k), y = op::load(Y + k);
                    pack u = op::load(U + k), px, py, gx, gy;
                    if (job.has_mask) u = u * body.at(x, y);
                    from.of(x, y, &px, &py);
                    if (!from.within) u = u * from.held(&px, &py);
                    const pack t = spline::slope(from.origin, from.stride, px, py, &gx, &gy);
                    from.turn(x, y, &gx, &gy);
                    op::store(W + k, u); op::store(B + k, u); op::store(T + k, t);
                    op::store(GX + k, gx); op::store(GY + k, gy);
                    counted += u; total += u * t;
                    pack dx, dy;
                    grit += u * grain::drift(&job.spread[0], &job.slope[0], px, py, &dx, &dy);
                    from.turn(x, y, &dx, &dy);
                    at.set(x, y);
                    for (int j = 0; j < ORDER; ++j) {
                        tilt[j] += u * dx * at.m[j];
                        tilt[ORDER + j] += u * dy * at.m[j];
                    }
                }
                const double n = op::sum(counted);
                enough = n >= job.least_pixels * square;
                if (enough) {
                    const float mean = (float)(op::sum(total) / n);  // sums of small numbers
                    #pragma unroll 1
                    for (int k = start; k < room; k += STEP) op::store(T + k, op::load(T + k) - mean);
                    N.sum(W, T, GX, GY, X, Y, room, start);
                    level = mean;
                    for (int j = 0; j < K; ++j) drift[j] = op::sum(tilt[j]);
                    between_f = op::sum(grit) / n;
                    if (place >= 0) {
                        double* kept = (double*)job.kept_sums + place * SUMS;
                        N.save(kept);
                        kept[SUMS - K - 2] = level; kept[SUMS - K - 1] = between_f;
                        for (int j = 0; j < K; ++j) kept[SUMS - K + j] = drift[j];
                        ((int*)job.known)[place] = 1;
                    }
                }
            }
            if (!enough) {
                outcome = OUT_OF_VIEW;
            } else {
                bool whole = true;  // N holds the whole template
                double offset = level, contrast = 1.0, brightness = level;
                double noise_f = 0.0, noise_g = 0.0, share = 0.0;
                double least = 1e30, earlier[PACE];  // smallest update so far, now and up to PACE ago
                for (int k = 0; k < PACE; ++k) earlier[k] = 1e30;
                double before[K];  // the last step; 0 if it was lengthened
                for (int j = 0; j < K; ++j) before[j] = 0.0;
                while (true) {
                    // Gradients must hold more of the pattern than of the reference's noise.
                    noise_f = grey_f[0] + grey_f[1] * op::positive(N.mean + level);
                    const double added = job.grit * noise_f * N.n;
                    const double xx = N.gradient[0] - 2.0 * added * (F0[0] * F0[0] + F0[2] * F0[2]);
                    const double xy = N.gradient[1] - 2.0 * added * (F0[0] * F0[1] + F0[2] * F0[3]);
                    const double yy = N.gradient[2] - 2.0 * added * (F0[1] * F0[1] + F0[3] * F0[3]);
                    if (!N.definite || !(xx > 0.0 && xx * yy > xy * xy)) { outcome = LOW_CONTRAST; break; }
                    share = added * (F0[0] * F0[0] + F0[1] * F0[1] + F0[2] * F0[2] + F0[3] * F0[3])
                        / (N.gradient[0] + N.gradient[2]);
                    to.set(g, cx, cy, w, h);
                    jet::at(w, 0.0, 0.0, here, F1);
                    if (!to.sane) { outcome = OUT_OF_VIEW; break; }
                    if (!jet::inverse(F1, A)) { outcome = NOT_CONVERGED; break; }
                    if (!to.within || !whole) {
                        // Pixels that left the picture do not count, those that came back do.
                        pack left = op::all(0.0f), changed = left;
                        #pragma unroll 1
                        for (int k = start; k < room; k += STEP) {
                            const pack before = op::load(W + k);
                            pack px, py;
                            to.of(op::load(X + k), op::load(Y + k), &px, &py);
                            const pack u = op::load(B + k) * to.held(&px, &py);
                            op::store(W + k, u);
                            left += u;
                            changed += (u - before) * (u - before);
                        }
                        if (op::sum(left) < job.least_pixels * square) { outcome = OUT_OF_VIEW; break; }
                        if (op::sum(changed) > 0.0) N.sum(W, T, GX, GY, X, Y, room, start);
                        whole = to.within;
                        if (!N.definite) { outcome = LOW_CONTRAST; break; }
                    }
                    pack g1 = op::all(0.0f), g2 = g1, tg = g1, s[K];
                    for (int j = 0; j < K; ++j) s[j] = op::all(0.0f);
                    const float zero = (float)offset;
                    #pragma unroll 1
                    for (int k = start; k < room; k += STEP) {
                        const pack x = op::load(X + k), y = op::load(Y + k);
                        pack px, py;
                        to.of(x, y, &px, &py);
                        if (!to.within) to.held(&px, &py);
                        const pack v = spline::value(to.origin, to.stride, px, py) - zero;
                        const pack wv = v * op::load(W + k);
                        g1 += wv; g2 += wv * v; tg += wv * op::load(T + k);
                        const pack ax = wv * op::load(GX + k), ay = wv * op::load(GY + k);
                        at.set(x, y);
                        for (int j = 0; j < ORDER; ++j) {
                            s[j] += ax * at.m[j];
                            s[ORDER + j] += ay * at.m[j];
                        }
                    }
                    const double sum = op::sum(g1), mean = sum / N.n;
                    const double energy = op::sum(g2) - mean * sum, cross = op::sum(tg) - N.mean * sum;
                    brightness = mean + zero;
                    noise_g = grey_g[0] + grey_g[1] * op::positive(brightness);
                    // Little more than noise, or than what fp32 leaves of a grey value.
                    if (!(energy > N.n * (1.5 * job.between * noise_g + 1e-10 * brightness * brightness))) {
                        outcome = LOW_CONTRAST;
                        break;
                    }
                    zncc = cross / sqrt(energy * N.energy);
                    contrast = sqrt(energy / N.energy);
                    offset = brightness;
                    if (iterations == job.max_iterations) { outcome = NOT_CONVERGED; break; }
                    double d[K];
                    const double slope = cross / N.energy;
                    for (int j = 0; j < K; ++j)
                        d[j] = (op::sum(s[j]) - mean * N.S[j] - slope * N.q[j]) / contrast
                            + noise_f * drift[j];
                    N.solve(d);
                    for (int k = 0; k < 12; ++k) step[k] = 0.0;
                    step[0] = d[0]; step[1] = d[ORDER];
                    if (ORDER > 1) {
                        step[2] = d[1 % K] / h; step[3] = d[2 % K] / h;
                        step[4] = d[(ORDER + 1) % K] / h; step[5] = d[(ORDER + 2) % K] / h;
                    }
                    if (ORDER > 3)
                        for (int k = 0; k < 3; ++k) {
                            step[6 + k] = d[(3 + k) % K] / (h * h);
                            step[9 + k] = d[(ORDER + 3 + k) % K] / (h * h);
                        }
                    // Steps that shrink by one factor are a geometric series. Its sum is the way left.
                    double both = 0.0, last = 0.0, length = 0.0;  // scalar products
                    for (int j = 0; j < K; ++j) {
                        both += d[j] * before[j]; last += before[j] * before[j]; length += d[j] * d[j];
                    }
                    const double factor = both / last;
                    const bool series = ORDER > 1 && factor > SLOW && factor < SLOWEST
                        && length - both * factor < ASIDE * ASIDE * length
                        && jet::farthest(step, h) < NEAR;
                    for (int j = 0; j < K; ++j) before[j] = series ? 0.0 : d[j];
                    if (series)
                        for (int k = 0; k < 12; ++k) step[k] /= 1.0 - factor;
                    ++iterations;
                    const double far = jet::farthest(step, h);
                    // Steps that shrink by one factor q leave q / (1 - q) times the last one.
                    const double shrunk = sqrt(length / last);
                    const double way = !series && shrunk <= SHRUNK ? SAFE * shrunk / (1.0 - shrunk) : 1.0;
                    const double left = way * far;
                    if (!(far < 1e3) || !jet::update(w, step)) { outcome = NOT_CONVERGED; break; }
                    const double ago = earlier[iterations % PACE];
                    if (far < least) least = far;
                    earlier[iterations % PACE] = least;
                    // At the pace of the last updates twice as many as are left would not do.
                    if (!(left < job.tolerance) && iterations > PACE
                        && wp::log(least / job.tolerance) * PACE
                            > 2.0 * (job.max_iterations - iterations) * wp::log(ago / least)) {
                        outcome = NOT_CONVERGED;
                        break;
                    }
                    if (left < job.tolerance) {
                        outcome = zncc < job.least_zncc ? LOW_CORRELATION : VALID;
                        double column[2][K];
                        for (int c = 0; c < 2; ++c) {
                            for (int j = 0; j < K; ++j) column[c][j] = j == c * ORDER ? 1.0 : 0.0;
                            N.solve(column[c]);
                        }
                        jet::at(w, 0.0, 0.0, here, F1);
                        const double spectrum[3] = {N.gradient[0] / N.energy, N.gradient[1] / N.energy,
                                                    N.gradient[2] / N.energy};
                        const double smooth = job.prefilter * job.prefilter;
                        const double kept = 1.0 - share;
                        const double likely = (1.0 + 2.0 * sqrt(2.0 / N.n))
                            * (noise_f * between_f + noise_g * job.between / (contrast * contrast));
                        // Where the residual is larger than noise and chance explain, so is the variance.
                        const double excess = (2.0 - 2.0 * zncc) * N.energy / N.n;
                        const double gain_f = grain::gain(F0, smooth, spectrum);
                        const double gain_g = grain::gain(F1, smooth, spectrum);
                        double variance = (noise_f * gain_f * kept + noise_g * gain_g / (contrast * contrast))
                            / (kept * kept);
                        if (!(likely > 0.0))  // none declared: the residual is all there is
                            variance = excess * (gain_f + gain_g) / (between_f + job.between);
                        else if (excess > likely) variance *= excess / likely;
                        const double xx = column[0][0] * variance, xy = column[0][ORDER] * variance;
                        const double yy = column[1][ORDER] * variance;
                        covariance[0] = F1[0] * (F1[0] * xx + F1[1] * xy) + F1[1] * (F1[0] * xy + F1[1] * yy);
                        covariance[1] = F1[2] * (F1[0] * xx + F1[1] * xy) + F1[3] * (F1[0] * xy + F1[1] * yy);
                        covariance[2] = F1[2] * (F1[2] * xx + F1[3] * xy) + F1[3] * (F1[2] * xy + F1[3] * yy);
                        break;
                    }
                }
            }
        }
        if (start == 0) {
            double* found = (double*)job.found;
            for (int k = 0; k < 12; ++k) found[12LL * i + k] = w[k];
            for (int k = 0; k < 4; ++k) found[12 * all + 4LL * i + k] = covariance[(k + 1) / 2];
            found[16 * all + i] = zncc;
            found[17 * all + i] = iterations;
            found[18 * all + i] = outcome;
        }
    }
"""


def search_source(parameters: int) -> str:
    """Body of the native function for a shape function with this many parameters."""
    text = f"    constexpr int WARPS = {BLOCK // 32}, ARRAYS = {ARRAYS}, PACE = {PACE};\n"
    for name in ("SLOW", "SLOWEST", "ASIDE", "NEAR", "SHRUNK", "SAFE"):
        text += f"    constexpr double {name} = {globals()[name]};\n"
    text += f"    constexpr int ORDER = {parameters // 2};  // monomials of a displacement component\n"
    for outcome in PointOutcome:
        text += f"    constexpr int {outcome.name} = {outcome.value};\n"
    return text + PACKS + JETS + SPLINE + GRAIN + SUBSET + _SEARCH

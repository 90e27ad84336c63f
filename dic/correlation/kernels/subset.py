"""The C++ of one subset: where its pixels are looked up, its template, and the normal matrix of the match."""

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

"""The C++ that reads a picture between its pixels: quintic B-splines from prefiltered coefficients."""

PAD = 8
"""Mirrored coefficients around a picture [px]: a stencil reaches three beyond it, a pack's row five."""

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

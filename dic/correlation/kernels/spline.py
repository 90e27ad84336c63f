"""The C++ that reads a picture between its pixels: quintic B-splines from prefiltered coefficients."""

PAD = 8
"""Mirrored coefficients around a picture [px]: a stencil reaches three beyond it, a pack's row five."""

SPLINE = """
    struct spline {
        // Weights of six coefficients at a fraction 1/2 + t, from their even and odd parts in t.
        static inline void weights(pack t, pack* w) {
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
        static inline void slopes(pack t, pack* w) {
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
        static inline pack value(const float* origin, int stride, pack x, pack y) {
            const float left = floorf(x), top = floorf(y);
            const float* c = origin + ((int)top - 2) * stride + ((int)left - 2);
            pack wx[6], wy[6];
            weights(x - left - 0.5f, wx);
            weights(y - top - 0.5f, wy);
            pack total = 0.0f;
            #pragma unroll
            for (int r = 0; r < 6; ++r) {
                pack row = 0.0f;
                #pragma unroll
                for (int k = 0; k < 6; ++k) row += wx[k] * __ldg(c + r * stride + k);
                total += wy[r] * row;
            }
            return total;
        }
        static inline pack slope(const float* origin, int stride, pack x, pack y, pack* gx, pack* gy) {
            const float left = floorf(x), top = floorf(y);
            const float* c = origin + ((int)top - 2) * stride + ((int)left - 2);
            pack wx[6], wy[6], dx[6], dy[6];
            weights(x - left - 0.5f, wx); slopes(x - left - 0.5f, dx);
            weights(y - top - 0.5f, wy); slopes(y - top - 0.5f, dy);
            pack total = 0.0f; *gx = 0.0f; *gy = 0.0f;
            #pragma unroll
            for (int r = 0; r < 6; ++r) {
                pack row = 0.0f, across = 0.0f;
                #pragma unroll
                for (int k = 0; k < 6; ++k) {
                    const float here = __ldg(c + r * stride + k);
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
        static inline pack value(const float* origin, int stride, pack x, pack y) {
            const pack left = __builtin_elementwise_floor(x), top = __builtin_elementwise_floor(y);
            pack wx[6], wy[6], total;
            weights(x - left - 0.5f, wx);
            weights(y - top - 0.5f, wy);
            for (int l = 0; l < STEP; ++l) {
                const float* c = origin + ((int)top[l] - 2) * (long)stride + ((int)left[l] - 2);
                float sum = 0.0f;
                for (int r = 0; r < 6; ++r) {
                    float row = 0.0f;
                    for (int k = 0; k < 6; ++k) row += wx[k][l] * c[r * (long)stride + k];
                    sum += wy[r][l] * row;
                }
                total[l] = sum;
            }
            return total;
        }
        static inline pack slope(const float* origin, int stride, pack x, pack y, pack* gx, pack* gy) {
            const pack left = __builtin_elementwise_floor(x), top = __builtin_elementwise_floor(y);
            pack wx[6], wy[6], dx[6], dy[6], total;
            weights(x - left - 0.5f, wx); slopes(x - left - 0.5f, dx);
            weights(y - top - 0.5f, wy); slopes(y - top - 0.5f, dy);
            for (int l = 0; l < STEP; ++l) {
                const float* c = origin + ((int)top[l] - 2) * (long)stride + ((int)left[l] - 2);
                float sum = 0.0f, sumx = 0.0f, sumy = 0.0f;
                for (int r = 0; r < 6; ++r) {
                    float row = 0.0f, across = 0.0f;
                    for (int k = 0; k < 6; ++k) {
                        row += wx[k][l] * c[r * (long)stride + k];
                        across += dx[k][l] * c[r * (long)stride + k];
                    }
                    sum += wy[r][l] * row;
                    sumx += wy[r][l] * across;
                    sumy += dy[r][l] * row;
                }
                total[l] = sum; (*gx)[l] = sumx; (*gy)[l] = sumy;
            }
            return total;
        }
#endif
    };
"""

"""The C++ that the search starts with: what a lane is, and sums over lanes.

One source serves both kinds of device. On a CPU a `pack` is a SIMD register of pixels and one thread walks
through a subset; on a GPU it is one number, and the 32 lanes of a warp walk through a subset side by side.
"""

PACKS = """
#if defined(__CUDA_ARCH__)
    typedef float pack;
    constexpr int STEP = 32;
    const int lane = threadIdx.x & 31;
    struct op {
        static inline double positive(double x) { return x > 0.0 ? x : 0.0; }
        static inline pack all(float x) { return x; }
        static inline pack load(const float* p) { return *p; }
        static inline void store(float* p, pack x) { *p = x; }
        static inline pack choose(bool c, pack a, pack b) { return c ? a : b; }
        static inline pack least(pack a, pack b) { return fminf(a, b); }
        static inline pack most(pack a, pack b) { return fmaxf(a, b); }
        static inline double sum(pack x) {
            double total = x;
            #pragma unroll
            for (int o = 16; o > 0; o >>= 1) total += __shfl_xor_sync(0xffffffffu, total, o);
            return total;
        }
    };
#else
    constexpr int STEP = 16;
    const int lane = 0;
    typedef float pack __attribute__((ext_vector_type(16)));
    typedef float packu __attribute__((ext_vector_type(16), aligned(4)));
    typedef int ipack __attribute__((ext_vector_type(16)));
    struct op {
        static inline double positive(double x) { return x > 0.0 ? x : 0.0; }
        static inline pack all(float x) { return (pack)(x); }
        static inline pack load(const float* p) { return *(const packu*)p; }
        static inline void store(float* p, pack x) { *(packu*)p = x; }
        static inline pack choose(ipack c, pack a, pack b) { return c ? a : b; }
        static inline pack least(pack a, pack b) { return a < b ? a : b; }
        static inline pack most(pack a, pack b) { return a > b ? a : b; }
        static inline double sum(pack x) {
            double total = 0.0;
            for (int l = 0; l < 16; ++l) total += x[l];
            return total;
        }
    };
#endif
"""

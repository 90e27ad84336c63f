"""The C++ that the search starts with: what a lane is, and sums over lanes.

One source serves both kinds of device. On a CPU a `pack` is a SIMD register of pixels and one thread walks
through a subset; on a GPU it is one number, and the 32 lanes of a warp walk through a subset side by side.
"""

BLOCK = 128
"""Threads of a GPU's block: four warps, a point each."""

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

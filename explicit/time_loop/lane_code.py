"""What lanes do together on a GPU, in native code: `explicit.time_loop.lanes` makes functions of it."""

BARRIER = """
#if defined(__CUDA_ARCH__)
    MEET
#endif
"""
"""Lanes of one simulation meet here; a single lane (CPU) has nobody to wait for."""
MEET_IN_BLOCK = "__syncthreads();"
MEET_IN_CLUSTER = (
    'asm volatile("barrier.cluster.arrive.release.aligned;" ::: "memory");\n'
    '    asm volatile("barrier.cluster.wait.acquire.aligned;" ::: "memory");'
)


# The last warp of a GPU's block, the control warp, does the bookkeeping of each step while the others sweep
# the elements. Totals are handed to it warp by warp and added in one order.
HAND_OVER = """
#if defined(__CUDA_ARCH__)
    ACROSS
    if ((threadIdx.x & 31) == 0) parts.data[k * WARPS + (THREAD >> 5)] = x;
#else
    parts.data[k] = x;
#endif
"""
TAKE = """
#if defined(__CUDA_ARCH__)
    const int warp = threadIdx.x & (ALONE ? 15 : 31);
    double x = warp < (THREADS >> 5) ? parts.data[k * WARPS + warp] : NOTHING;
    FURTHER
    ACROSS
    return x;
#else
    return parts.data[k];
#endif
"""
ADDED = """
    #pragma unroll
    for (int step = ALONE ? 8 : 16; step > 0; step >>= 1) x += __shfl_xor_sync(0xffffffffu, x, step);
"""
# Numbers in the order of integers, compared upper half first: two instructions instead of five rounds.
LARGEST = """
    #if __CUDA_ARCH__ >= 800
    const long long bits = __double_as_longlong(x), order = bits ^ ((bits >> 63) & 0x7fffffffffffffffll);
    const int upper = (int)(order >> 32), top = __reduce_max_sync(0xffffffffu, upper);
    const unsigned lower = __reduce_max_sync(0xffffffffu, upper == top ? (unsigned)order : 0u);
    const long long most = ((long long)top << 32) | lower;
    x = __longlong_as_double(most ^ ((most >> 63) & 0x7fffffffffffffffll));
    #else
    #pragma unroll
    for (int step = 16; step > 0; step >>= 1) {
        const double other = __shfl_xor_sync(0xffffffffu, x, step);
        x = x > other ? x : other;
    }
    #endif
"""
FURTHER = """for (int next = warp + 32; next < (THREADS >> 5); next += 32) {
        const double other = parts.data[k * WARPS + next];
        x = COMBINE;
    }"""
DOWN = """
    #pragma unroll
    for (int offset = 16; offset > 0; offset >>= 1) x += __shfl_down_sync(0xffffffffu, x, offset);
"""
SUM, LARGER = "x + other", "x > other ? x : other"
BOUNDARY_TOTALS = """
    wp::vec_t<2, wp::float64> sums(0.0, 0.0);
#if defined(__CUDA_ARCH__)
    #pragma unroll 1
    for (int k = threadIdx.x & 31; k < n; k += 32) { sums[0] += first.data[k]; sums[1] += second.data[k]; }
    #pragma unroll
    for (int other = 16; other > 0; other >>= 1) {
        const double a = __shfl_xor_sync(0xffffffffu, sums[0], other);
        const double b = __shfl_xor_sync(0xffffffffu, sums[1], other);
        sums[0] += a;
        sums[1] += b;
    }
#else
    for (int k = 0; k < n; ++k) { sums[0] += first.data[k]; sums[1] += second.data[k]; }
#endif
    return sums;
"""

"""The C++ that every function of lanes starts with: pack types and their few operations."""

from explicit.simd.values import PACK, SCALAR

_PRELUDE = """
    constexpr int W = {lanes};
    typedef double f64v __attribute__((ext_vector_type(W)));
    typedef float f32v __attribute__((ext_vector_type(W)));
    typedef int i32v __attribute__((ext_vector_type(W)));
    typedef long long i64v __attribute__((ext_vector_type(W)));
    typedef double f64q __attribute__((ext_vector_type(4), aligned(8)));
    typedef float f32q __attribute__((ext_vector_type(4), aligned(4)));
    typedef {mask} mask;
    typedef bool truths __attribute__((ext_vector_type(W)));
    typedef f64v __attribute__((aligned(4))) f64vu; // where a pack may begin anywhere
    typedef f32v __attribute__((aligned(4))) f32vu;
    typedef i32v __attribute__((aligned(4))) i32vu;
    struct op {{
        static inline bool any(mask m) {{ return __builtin_reduce_or(m) != 0; }}
        static inline bool all(mask m) {{ return __builtin_reduce_and(m) != 0; }}
        static inline unsigned bits(mask m) {{
            return __builtin_bit_cast({bits}, __builtin_convertvector(m, truths));
        }}
        static inline mask to_mask(i32v m) {{ return __builtin_convertvector(m, mask); }}
        static inline mask to_mask(i64v m) {{ return __builtin_convertvector(m, mask); }}
        static inline mask to_mask(bool b) {{ return (mask)(b ? -1 : 0); }}
        static inline f64v sel(mask m, f64v a, f64v b) {{ return __builtin_convertvector(m, i64v) ? a : b; }}
        static inline f32v sel(mask m, f32v a, f32v b) {{ return __builtin_convertvector(m, i32v) ? a : b; }}
        static inline i32v sel(mask m, i32v a, i32v b) {{ return __builtin_convertvector(m, i32v) ? a : b; }}
        static inline i64v sel(mask m, i64v a, i64v b) {{ return __builtin_convertvector(m, i64v) ? a : b; }}
        static inline f64v root(f64v x) {{ // cube root: a third of the exponent, then Halley's steps
            f64v size = __builtin_elementwise_abs(x), third = (f64v)(1.0 / 3.0);
            i64v guess = __builtin_convertvector(__builtin_convertvector((i64v)size, f64v) * third, i64v);
            f64v y = (f64v)(guess + (i64v)(3071306043645493248ll));
            for (int k = 0; k < 4; ++k) {{ f64v c = y * y * y; y = y * (c + size + size) / (c + c + size); }}
            y = x < (f64v)(0.0) ? -y : y;
            return ((x != (f64v)(0.0)) & (size < (f64v)(__builtin_inf()))) ? y : x;
        }}
        static inline f32v root(f32v x) {{
            return __builtin_convertvector(root(__builtin_convertvector(x, f64v)), f32v);
        }}
        static inline double sum(f64v x) {{
            for (int n = W / 2; n > 0; n /= 2) for (int l = 0; l < n; ++l) x[l] += x[l + n];
            return x[0];
        }}
        static inline double most(f64v x) {{
            for (int n = W / 2; n > 0; n /= 2)
                for (int l = 0; l < n; ++l)
                    if (!(x[l] > x[l + n]) && x[l + n] == x[l + n]) x[l] = x[l + n];
            return x[0];
        }}
{gathers}
    }};
    const i32v lane_numbers = {{{numbers}}};
    const mask everywhere = (mask)(-1);
"""
# Neighbours in a mesh have neighbouring numbers: lanes whose places follow each other are one load.
_GATHER = """
        static inline {pack} gather(const {real}* p, i32v at, mask wanted) {{
            const i32v numbers = {{{numbers}}}, from = at - numbers;
            {pack} x = *(const {pack}u*)(p + at[0]);
            unsigned rest = bits(wanted & ~to_mask((i32v)(from == (i32v)(at[0]))));
            while (__builtin_expect(rest, 0)) {{
                const int l = __builtin_ctz(rest), begin = at[l] - l;
                const mask here = to_mask((i32v)(from == (i32v)(begin)));
                if (begin < 0) x[l] = p[at[l]];
                else x = sel(here, *(const {pack}u*)(p + begin), x);
                rest &= begin < 0 ? rest - 1 : ~bits(here);
            }}
            return x;
        }}"""


def prelude(lanes: int, kind: str) -> str:
    """Types and operations for a number of lanes; masks are as wide as `kind`."""
    numbers = ", ".join(str(lane) for lane in range(lanes))
    gathers = [_GATHER.format(pack=PACK[k], real=SCALAR[k], numbers=numbers) for k in ("f64", "f32", "i32")]
    mask = "i64v" if kind == "f64" else "i32v"
    return _PRELUDE.format(
        lanes=lanes,
        mask=mask,
        numbers=numbers,
        gathers="".join(gathers),
        bits="unsigned short" if lanes == 16 else "unsigned char",
    )

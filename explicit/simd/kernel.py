"""Generates a CPU kernel that runs a kernel of the scalar source in SIMD lanes.

The translated source is cached together with Warp's compiled kernels. The file's name contains the hash of
all inputs of the translation. These are Warp's hash of the scalar kernel (with all its functions, constants
and structs), this package's source, and the choice of lanes.
"""

import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from math import factorial
from pathlib import Path
from typing import Any, Literal

import warp as wp

from explicit.device import kernel_cache
from explicit.layout.structs import Structs
from explicit.precision import Precision
from explicit.simd.expressions import PACK, SCALAR, Scalar, Struct
from explicit.simd.mappings import LaneIsSimulation, LaneIsWorker
from explicit.simd.team import TEAM_CODE, Team

EXPONENTIAL = 13
"""Degree of the series of e^r: the neglected terms are below 1e-17 for |r| <= ln 2 / 2."""

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
            const f64v one = (f64v)(1.0), whole = __builtin_elementwise_abs(x), third = (f64v)(1.0 / 3.0);
            const i64v little = (i64v)(whole < (f64v)(0x1p-600)), much = (i64v)(whole > (f64v)(0x1p600));
            const f64v size = whole * (little ? (f64v)(0x1p600) : much ? (f64v)(0x1p-600) : one);
            const f64v back = little ? (f64v)(0x1p-200) : much ? (f64v)(0x1p200) : one;
            i64v guess = __builtin_convertvector(__builtin_convertvector((i64v)size, f64v) * third, i64v);
            f64v y = (f64v)(guess + (i64v)(3071306043645493248ll));
            for (int k = 0; k < 4; ++k) {{ f64v c = y * y * y; y = y * (c + size + size) / (c + c + size); }}
            y = x < (f64v)(0.0) ? -y * back : y * back;
            return ((x != (f64v)(0.0)) & (whole < (f64v)(__builtin_inf()))) ? y : x;
        }}
        static inline f32v root(f32v x) {{
            return __builtin_convertvector(root(__builtin_convertvector(x, f64v)), f32v);
        }}
        static inline f64v times(f64v a, f64v b, f64v c) {{ return __builtin_elementwise_fma(a, b, c); }}
        static inline f64v power(f64v x) {{ // e^x: 2^k times the series of e^r, |r| <= ln 2 / 2
            x = x > (f64v)(710.0) ? (f64v)(710.0) : x;
            x = x < (f64v)(-746.0) ? (f64v)(-746.0) : x;
            const f64v shift = (f64v)(6755399441055744.0); // its last bits count whole numbers
            const f64v whole = times(x, (f64v)(1.4426950408889634), shift), k = whole - shift;
            f64v r = times(-k, (f64v)(6.93147180369123816490e-01), x);
            r = times(-k, (f64v)(1.90821492927058770002e-10), r);
            const double factors[] = {{{factors}}};
            f64v y = (f64v)(factors[0]);
            for (int n = 1; n < {n_factors}; ++n) y = times(y, r, (f64v)(factors[n]));
            const i64v steps = (i64v)whole - (i64v)shift, half = steps >> 1;
            const f64v first = (f64v)((half + 1023) << 52), second = (f64v)((steps - half + 1023) << 52);
            return y * first * second;
        }}
        static inline f64v logarithm(f64v x) {{ // of 2^k m by the series of ln((1 + s) / (1 - s))
            const f64v none = (f64v)(0.0), limit = (f64v)(__builtin_inf());
            const i64v small = (i64v)(x < (f64v)(2.2250738585072014e-308));
            const f64v large = small ? x * (f64v)(18014398509481984.0) : x;
            const i64v bits = (i64v)large, step = (bits - 0x3fe6a09e667f3bcdll) >> 52;
            const f64v m = (f64v)(bits - (step << 52)), f = m - (f64v)(1.0);
            const f64v k = __builtin_convertvector(small ? step - 54 : step, f64v);
            const f64v s = f / (f + (f64v)(2.0)), z = s * s;
            f64v y = (f64v)(2.0 / 21.0);
            for (int n = 19; n > 1; n -= 2) y = times(y, z, (f64v)(2.0 / n));
            y = times(k, (f64v)(1.90821492927058770002e-10), y * z * s);
            y = times(k, (f64v)(6.93147180369123816490e-01), y + s + s);
            y = x < limit ? y : x; // infinity, or no number
            y = x == none ? -limit : y;
            return x < none ? (f64v)(__builtin_nan("")) : y;
        }}
        static inline f32v power(f32v x) {{
            return __builtin_convertvector(power(__builtin_convertvector(x, f64v)), f32v);
        }}
        static inline f32v logarithm(f32v x) {{
            return __builtin_convertvector(logarithm(__builtin_convertvector(x, f64v)), f32v);
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
# Neighbours in a mesh have consecutive numbers. Lanes with consecutive indices need only one load.
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
    """C++ types and operations for a number of lanes; masks are as wide as `kind`."""
    numbers = ", ".join(str(lane) for lane in range(lanes))
    gathers = [_GATHER.format(pack=PACK[k], real=SCALAR[k], numbers=numbers) for k in ("f64", "f32", "i32")]
    mask = "i64v" if kind == "f64" else "i32v"
    return _PRELUDE.format(
        lanes=lanes,
        mask=mask,
        numbers=numbers,
        gathers="".join(gathers),
        factors=", ".join((1.0 / factorial(n)).hex() for n in range(EXPONENTIAL, -1, -1)),
        n_factors=EXPONENTIAL + 1,
        bits="unsigned short" if lanes == 16 else "unsigned char",
    )


TRANSLATION_FOLDER = "lanes"
"""Folder in Warp's kernel cache."""


def cached_translation(time_loop: Any, choice: str, translate: Callable[[], str]) -> str:
    """The source of a time loop over lanes. It is read from its file, or translated and written to it.

    ``time_loop``: the scalar Warp kernel, the only one of its module. ``choice``: mapping, lanes and
    precision in words.
    """
    file = _translation_file(time_loop, choice)
    try:
        return file.read_text(encoding="utf-8")
    except OSError:
        code = translate()
    _write_translation(file, code)
    return code


def _translation_file(time_loop: Any, choice: str) -> Path:
    """File of the translated source of a time loop. It may not exist yet."""
    name = sha256(_module(time_loop) + _package() + choice.encode()).hexdigest()
    return kernel_cache() / TRANSLATION_FOLDER / f"{name}.inc"


@cache
def _module(time_loop: Any) -> bytes:
    """Warp's hash of a time loop with its functions, constants and structs, computed once."""
    return bytes(time_loop.module.hash_module())


def _write_translation(file: Path, code: str) -> None:
    """Write a file completely or not at all. If the cache is not writable, nothing is stored."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        number, name = tempfile.mkstemp(dir=file.parent)
        try:
            with os.fdopen(number, "w", encoding="utf-8") as part:
                part.write(code)
            Path(name).replace(file)
        except OSError:
            Path(name).unlink(missing_ok=True)
    except OSError:
        return


@cache
def _package() -> bytes:
    """Bytes for the hash: the source of the translator and of the time loop, and Warp's version."""
    digest = sha256(wp.__version__.encode())
    root = Path(__file__).parents[1]
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.digest()


Mapping = Literal["simulation", "worker"]
PACK_BYTES = 64
"""Bytes of a pack: one register of AVX-512, two of AVX2."""
FLAGS = "-march=native -ffp-contract=off -mprefer-vector-width=512 -mstackrealign"
"""Only the translator fuses operations, so a simulation has the same bits in every pack."""


@dataclass(frozen=True)
class LaneKernel:
    """A kernel over lanes."""

    kernel: Any
    """Launch with dim 1 and inputs (body, batch, state, output, first, count, team). Each thread of a shared
    simulation launches it (`explicit.simd.team`)."""
    lanes: int
    """Lanes of a pack."""


@cache
def lane_kernel(
    time_loop: Any, structs: Structs, precision: Precision, mapping: Mapping, lanes: int
) -> LaneKernel:
    """Generate the lanes of a time loop.

    ``mapping``: "simulation" or "worker". With "simulation" each lane runs one simulation. With "worker" the
    lanes share one simulation, and several threads may share it. ``lanes``: lanes of a pack, a power of two.
    """
    arguments: dict[str, Any] = {
        name: Struct(kind, name)
        for name, kind in (
            ("body", structs.Body),
            ("batch", structs.Batch),
            ("state", structs.State),
            ("output", structs.Output),
        )
    }
    arguments["first"] = Scalar("i32", "first")

    def translate() -> str:
        translator = {"simulation": LaneIsSimulation, "worker": LaneIsWorker}[mapping](lanes)
        before = prelude(lanes, "f64" if precision.name == "fp64" else "f32")
        if mapping == "worker":
            before += TEAM_CODE
        return before + translator.translate(time_loop.func, arguments)

    code = cached_translation(time_loop, _choice(precision, mapping, lanes), translate)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output

    @wp.func_native(snippet=code)
    def time_loop_lanes(
        body: Body,  # type: ignore[valid-type]
        batch: Batch,  # type: ignore[valid-type]
        state: State,  # type: ignore[valid-type]
        output: Output,  # type: ignore[valid-type]
        first: int,
        count: int,
        team: Team,
    ): ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": FLAGS})
    def time_loop_packs(
        body: Body,  # type: ignore[valid-type]
        batch: Batch,  # type: ignore[valid-type]
        state: State,  # type: ignore[valid-type]
        output: Output,  # type: ignore[valid-type]
        first: int,
        count: int,
        team: Team,
    ):
        time_loop_lanes(body, batch, state, output, first, count, team)

    return LaneKernel(time_loop_packs, lanes)


def is_translated(time_loop: Any, precision: Precision, mapping: Mapping, lanes: int) -> bool:
    """Whether the translation of a time loop is cached. It is then also compiled, unless the compilation was
    interrupted."""
    return _translation_file(time_loop, _choice(precision, mapping, lanes)).exists()


def _choice(precision: Precision, mapping: Mapping, lanes: int) -> str:
    return f"{mapping} {lanes} {precision.name}"

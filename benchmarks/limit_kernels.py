"""Kernels that measure one limit of a device: independent fused multiply-adds, or reads of shared memory.

They are native snippets in Warp kernels, compiled with Warp's compiler as the solver is.
"""

from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision
from explicit.simd.kernel import FLAGS, PACK_BYTES

THREADS = 256
"""Threads of a block on a GPU."""
POOL_BYTES = 32_768
"""Shared memory of a block [bytes]. Its threads read all of it once in one iteration."""
READS = 16
"""Reads of a thread from shared memory in one iteration of the loop."""

_CPU = """
    typedef SCALAR pack __attribute__((ext_vector_type(LANES)));
    const pack a = (pack)((SCALAR)(0.999)), b = (pack)((SCALAR)(0.001));
    DECLARE
    for (int k = 0; k < turns; ++k) { STEP }
    const pack all = SUM;
    for (int l = 0; l < LANES; ++l) out.data[place * LANES + l] = all[l];
"""
_GPU = """
#if defined(__CUDA_ARCH__)
    typedef SCALAR pack;
    const pack a = (pack)(0.999), b = (pack)(0.001);
    DECLARE
    for (int k = 0; k < turns; ++k) { STEP }
    out.data[place] = SUM;
#endif
"""
_SHARED = """
#if defined(__CUDA_ARCH__)
    const int room = POOL_BYTES / sizeof(SCALAR);
    __shared__ SCALAR pool[room];
    for (int k = threadIdx.x; k < room; k += blockDim.x) pool[k] = (SCALAR)(k + place);
    __syncthreads();
    SCALAR x0 = 0, x1 = 0, x2 = 0, x3 = 0;
    int at = threadIdx.x;
    for (int k = 0; k < turns; ++k) {
        #pragma unroll
        for (int j = 0; j < READS; j += 4) {
            x0 += pool[(at + j * THREADS) & (room - 1)];
            x1 += pool[(at + (j + 1) * THREADS) & (room - 1)];
            x2 += pool[(at + (j + 2) * THREADS) & (room - 1)];
            x3 += pool[(at + (j + 3) * THREADS) & (room - 1)];
        }
        at += 32;
    }
    out.data[place] = x0 + x1 + x2 + x3;
#endif
"""


def lanes(precision: Precision) -> int:
    """Number of lanes of a pack on a CPU, as in the solver."""
    return PACK_BYTES // int(precision.dtype().itemsize)


@cache
def fma_kernel(precision: Precision, chains: int, cuda: bool) -> Any:
    """Kernel ``(turns, first, out)``: `turns` times `chains` multiply-adds in independent chains.

    A launch index is one thread of a GPU, or one pack of a CPU.
    """
    scalar = "double" if precision.name == "fp64" else "float"
    fused = "fma" if precision.name == "fp64" else "fmaf"
    fused = fused if cuda else "__builtin_elementwise_fma"
    names = [f"x{k}" for k in range(chains)]
    snippet = (
        (_GPU if cuda else _CPU)
        .replace(
            "DECLARE", " ".join(f"pack {x} = (pack)((SCALAR)({k + 1}) + place);" for k, x in enumerate(names))
        )
        .replace("STEP", " ".join(f"{x} = {fused}({x}, a, b);" for x in names))
        .replace("SUM", " + ".join(names))
        .replace("SCALAR", scalar)
        .replace("LANES", str(lanes(precision)))
    )
    options = {} if cuda else {"cpu_compiler_flags": FLAGS}
    return _kernel(precision, snippet, options)


@cache
def shared_kernel(precision: Precision) -> Any:
    """Kernel ``(turns, first, out)``: a thread reads `READS` numbers per iteration without bank conflicts."""
    snippet = _SHARED.replace("SCALAR", "double" if precision.name == "fp64" else "float")
    for name, value in (("POOL_BYTES", POOL_BYTES), ("THREADS", THREADS), ("READS", READS)):
        snippet = snippet.replace(name, str(value))
    return _kernel(precision, snippet, {})


def _kernel(precision: Precision, snippet: str, options: dict[str, Any]) -> Any:
    real = precision.real

    @wp.func_native(snippet=snippet)
    def body(turns: int, place: int, out: wp.array(dtype=real)): ...  # type: ignore[valid-type]

    @wp.kernel(module="unique", enable_backward=False, module_options=options)
    def limit(turns: int, first: int, out: wp.array(dtype=real)):  # type: ignore[valid-type]
        body(turns, first + wp.tid(), out)  # type: ignore[operator]

    return limit

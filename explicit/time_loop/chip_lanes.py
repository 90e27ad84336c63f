"""What the lanes of several blocks do together where a simulation lies in their shared memories.

`explicit.time_loop.chip_layout` says what lies where.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import warp as wp

from explicit.time_loop.lane_code import ADDED, DOWN, LARGER, LARGEST, SUM
from explicit.time_loop.lanes import WARPS, LaneFunctions, lane_functions
from explicit.time_loop.slots import CONTROL_SIZE, Control, Plan

_WAIT = """
    unsigned come;
    do {
        asm volatile(
            "{ .reg .pred all; "
            "mbarrier.try_wait.parity.relaxed.cluster.shared::cta.b64 all, [%1], %2; "
            "selp.u32 %0, 1, 0, all; }"
            : "=r"(come) : "r"(place), "r"(parity) : "memory");
    } while (!come);
    asm volatile("fence.acquire.sync_restrict::shared::cluster.cluster;" ::: "memory");
"""
_INIT = """asm volatile("mbarrier.init.shared::cta.b64 [%0], %1;" :: "r"(place), "r"(COUNT) : "memory");"""
_MEET = f"""
#if defined(__CUDA_ARCH__)
    __shared__ unsigned long long barrier;
    __shared__ volatile unsigned phase;
    const unsigned place = (unsigned)__cvta_generic_to_shared(&barrier);
    if (whole) {{
        if (begins && threadIdx.x == 0) {{ {_INIT.replace("COUNT", "BLOCKS")} phase = 0; }}
        asm volatile("barrier.cluster.arrive.release.aligned;" ::: "memory");
        asm volatile("barrier.cluster.wait.acquire.aligned;" ::: "memory");
        return;
    }}
    const unsigned parity = phase;
    __syncthreads();
    if (threadIdx.x < BLOCKS) {{
        if (threadIdx.x == 0) phase = parity ^ 1;
        __syncwarp((1u << BLOCKS) - 1u);
        asm volatile(
            "{{ .reg .b32 there; "
            "fence.release.sync_restrict::shared::cta.cluster; "
            "mapa.shared::cluster.u32 there, %0, %1; "
            "mbarrier.arrive.relaxed.cluster.shared::cluster.b64 _, [there]; }}"
            :: "r"(place), "r"(threadIdx.x) : "memory");
    }}
    {_WAIT}
#endif
"""
"""What blocks tell each other lies in their shared memories alone, so that nothing need be written back to
the memory of all, nor what was read of it forgotten. A block's threads have written when they have met; then
one for every other block tells it so. `whole` is the barrier of the hardware, which does more and takes
longer."""
_RECORD = f"""
#if defined(__CUDA_ARCH__)
    __shared__ unsigned long long barrier;
    const unsigned place = (unsigned)__cvta_generic_to_shared(&barrier);
    if (what == BEGIN) {{
        if (threadIdx.x == 0) {_INIT.replace("COUNT", "1")}
    }} else if (what == TELL) {{
        __syncwarp();
        for (int k = threadIdx.x & 31; k < (BLOCKS - 1) * TOLD; k += 32) {{
            const int slot = k % TOLD, number = slot < SIZE ? PLANS + SIZE * (step & 1) + slot
                : slot == SIZE ? GOING : slot == SIZE + 1 ? LOWER_NEXT : LOWER_SPEED;
            asm volatile(
                "{{ .reg .b32 there, done; "
                "mapa.shared::cluster.u32 there, %0, %2; mapa.shared::cluster.u32 done, %1, %2; "
                "st.async.shared::cluster.mbarrier::complete_tx::bytes.f64 [there], %3, [done]; }}"
                :: "r"((unsigned)__cvta_generic_to_shared(control.data + number)), "r"(place), "r"(k / TOLD),
                "d"(control.data[number]) : "memory");
        }}
    }} else if (blockIdx.x % BLOCKS != BLOCKS - 1) {{
        const unsigned parity = (step + 1) & 1; // they listen once in every step, from -1 on
        if (threadIdx.x == 0) {{
            asm volatile("mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;"
                :: "r"(place), "r"(8 * TOLD) : "memory");
        }}
        {_WAIT}
    }}
#endif
"""
"""The last block sends the others what they need of its record, before they meet; then they listen."""
_BEGIN, _TELL, _LISTEN = range(3)


def _read(number: str, place: str, block: str) -> str:
    return f"""double {number};
        asm volatile(
            "{{ .reg .b32 there; mapa.shared::cluster.u32 there, %1, %2; "
            "ld.shared::cluster.f64 %0, [there]; }}"
            : "=d"({number}) : "r"({place}), "r"({block}) : "memory");"""


_INFORM = f"""
#if defined(__CUDA_ARCH__)
    if (blockIdx.x % BLOCKS != BLOCKS - 1 && (int)threadIdx.x >= first && threadIdx.x < {CONTROL_SIZE}) {{
        const unsigned place = (unsigned)__cvta_generic_to_shared(control.data + threadIdx.x);
        {_read("x", "place", "BLOCKS - 1")}
        control.data[threadIdx.x] = x;
    }}
    __syncthreads();
#endif
"""
_HAND_OVER = """
#if defined(__CUDA_ARCH__)
    ACROSS
    if ((threadIdx.x & 31) == 0) parts.data[k * WARPS + (threadIdx.x >> 5)] = x;
#endif
"""
_TAKE = f"""
#if defined(__CUDA_ARCH__)
    const unsigned place = (unsigned)__cvta_generic_to_shared(parts.data + k * WARPS);
    double x = NOTHING;
    #pragma unroll
    for (int next = threadIdx.x & 31; next < BLOCKS * WARPS; next += 32) {{
        {_read("other", "place + next % WARPS * 8", "next / WARPS")}
        x = COMBINE;
    }}
    ACROSS
    return x;
#else
    return 0.0;
#endif
"""


@cache
def lanes_of_chips(blocks: int) -> LaneFunctions:
    """The lane functions of so many blocks that have a simulation in their shared memories."""
    parts_of: Any = wp.array(dtype=wp.float64)

    def native(snippet: str, **names: str) -> str:
        for name, text in {**names, "BLOCKS": str(blocks), "WARPS": str(WARPS)}.items():
            snippet = snippet.replace(name, text)
        return snippet

    told = {
        "BEGIN": _BEGIN, "TELL": _TELL, "TOLD": Plan.SIZE + 3, "PLANS": Control.PLANS, "SIZE": Plan.SIZE,
        "GOING": Control.GOING, "LOWER_NEXT": Control.LOWER_NEXT, "LOWER_SPEED": Control.LOWER_SPEED,
    }  # fmt: skip

    @wp.func_native(snippet=native(_MEET))
    def meet(whole: int, begins: int): ...

    @wp.func_native(snippet=native(_RECORD, **{name: str(int(number)) for name, number in told.items()}))
    def record(what: int, control: parts_of, step: int): ...

    @wp.func
    def sync():
        meet(0, 0)

    @wp.func
    def enter(control: parts_of):
        record(_BEGIN, control, 0)
        meet(1, 1)

    @wp.func
    def leave():
        meet(1, 0)

    @wp.func
    def tell(control: parts_of, step: int):
        record(_TELL, control, step)

    @wp.func
    def listen(control: parts_of, step: int):
        record(_LISTEN, control, step)

    @wp.func_native(snippet=native(_INFORM))
    def inform(control: parts_of, first: int): ...

    @wp.func_native(snippet=native(_HAND_OVER, ACROSS=DOWN))
    def put_total(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=native(_HAND_OVER, ACROSS=LARGEST))
    def put_largest(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=native(_TAKE, ACROSS=ADDED, COMBINE=SUM, NOTHING="0.0", ALONE="0"))
    def get_total(parts: parts_of, k: int) -> wp.float64: ...

    @wp.func_native(snippet=native(_TAKE, ACROSS=LARGEST, COMBINE=LARGER, NOTHING="-1e300"))
    def get_largest(parts: parts_of, k: int) -> wp.float64: ...

    return replace(
        lane_functions(blocks), sync=sync, enter=enter, leave=leave, tell=tell, listen=listen, inform=inform,
        put_total=put_total, put_largest=put_largest, get_total=get_total, get_largest=get_largest,
    )  # fmt: skip

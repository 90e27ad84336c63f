"""Lanes of one simulation: their common operations in native code.

On a GPU the lanes are the threads of one block or of a cluster of a few blocks. The shared memories of these
blocks may store the simulation. On the CPU `explicit.simd` translates the lanes to those of SIMD registers.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import warp as wp

from explicit.layout.structs import CONTROL_SIZE, Control, Plan

BARRIER = """
#if defined(__CUDA_ARCH__)
    MEET
#endif
"""
"""Synchronisation point of the lanes of one simulation; a single lane (CPU) does not wait."""
MEET_IN_BLOCK = "__syncthreads();"
MEET_IN_CLUSTER = (
    'asm volatile("barrier.cluster.arrive.release.aligned;" ::: "memory");\n'
    '    asm volatile("barrier.cluster.wait.acquire.aligned;" ::: "memory");'
)


# The last warp of a GPU's block is the control warp. It does the bookkeeping of each step while the others
# sweep the elements. Each warp passes its totals to the control warp, which adds them in a fixed order.
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
# Numbers are mapped to integers of the same order. The upper halves are compared first: two instructions
# instead of five rounds.
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


BLOCK = 384
"""Number of threads that share one simulation on a GPU. They share its registers."""
SMALL_BLOCK = 96
"""The same number if there are more simulations than multiprocessors. Four simulations then share one
multiprocessor. While the threads of one simulation wait, those of the others continue."""
SHARING = 4
"""Number of simulations that share one multiprocessor."""
WARPS = BLOCK // 32
"""Largest number of warps of a block; the last one is the control warp."""

_INSIDE = f"((signed)blockDim.x - (blockDim.x < {BLOCK} ? 32 : 96))"
_INSIDE_CLUSTER = "((signed)THREADS - 256)"


def _either(cuda: str, cpu: str) -> str:
    return f"\n#if defined(__CUDA_ARCH__)\n    {cuda}\n#else\n    {cpu}\n#endif\n"


@dataclass(frozen=True)
class LaneFunctions:
    """Common work of the lanes: workers, which sweep elements and nodes, and the control warp.

    On a GPU the lanes are the threads of a block. On a CPU every lane is worker and control at once.
    """

    sync: Any
    """``sync()``: every lane waits for the others; their writes are visible after it."""
    enter: Any
    """``enter(control)``: every lane has started; the first function that a lane calls."""
    leave: Any
    """``leave()``: no lane reads data of another one after this; the last function that a lane calls."""
    announce: Any
    """``announce(control, step)``: the control warp calls it before it synchronises with the workers. It
    announces whether there is a next step, the plan of this step, and the position of the support."""
    listen: Any
    """``listen(control, step)``: called after synchronisation, once in every step, to read the announced
    data."""
    inform: Any
    """``inform(control, first)``: called after synchronisation, to read the control record from slot
    `first`."""
    empty_sum: Any
    """``empty_sum()``: initial value of a sum over elements or nodes."""
    add_to: Any
    """``add_to(sum, x, k)``: the sum with the share of the k-th element or node."""
    add_share: Any
    """``add_share(sum, which, x, k)``: the same for a sum over elements that is made in every step; `which`
    is a `Share`."""
    put_share: Any
    """``put_share(sum, which)``: called after the sweep over elements and before synchronisation."""
    joined: Any
    """``joined(sum, which, n)``: the sum over n elements after synchronisation, added in the order of a
    single thread."""
    is_worker: Any
    """``is_worker(lane)``: 1 for a lane that sweeps elements."""
    n_workers: Any
    """``n_workers()``: number of workers."""
    is_control: Any
    """``is_control(lane)``: 1 for a lane of the control warp."""
    is_writer: Any
    """``is_writer(lane)``: 1 for the lane of the control warp that writes the values that one lane must
    write."""
    put_total: Any
    """``put_total(parts, k, x)``: pass this lane's x to the k-th total."""
    put_largest: Any
    """``put_largest(parts, k, x)``: the same for the largest x."""
    get_total: Any
    """``get_total(parts, k)``: the k-th total."""
    get_largest: Any
    """``get_largest(parts, k)``: the k-th largest value."""
    boundary_totals: Any
    """``boundary_totals(first, second, n)``: sums of two arrays of n numbers over the boundary nodes, on
    every lane of the control warp."""
    control_sync: Any
    """``control_sync()``: all lanes of the control warp have read the data that they will now overwrite."""
    settle: Any
    """``settle(latched)``: choose the CPU threads of the next step and store the largest value that each has
    latched. Call it before the synchronisation at the end of a step."""
    regroup: Any
    """``regroup(step, until_measured, latched)``: the same three values at the beginning of a step. CPU
    threads join and leave here (`explicit.simd.team`)."""
    disband: Any
    """``disband(latched)``: end of the loop; one CPU thread continues. Returns the largest value that any
    thread has latched."""
    first_element: Any
    """``first_element(lane, n)``: the element of n at which a worker begins."""
    end_element: Any
    """``end_element(n)``: the element before which it ends."""
    sum_first: Any
    """``sum_first(lane)``: first index of a worker in an infrequent sweep that computes sums. On a CPU one
    thread does the whole sweep."""
    boundary_first: Any
    """``boundary_first(lane)``: the boundary node at which a worker begins."""
    first_inner: Any
    """``first_inner(lane, n, adds)``: the interior node, of n, at which a worker begins. In a full-size block
    the last workers are reserved for the boundary, where a node takes several times as long. `adds` is 1 if
    the sweep computes sums."""
    end_inner: Any
    """``end_inner(n, adds)``: the node before which it ends."""
    inner_stride: Any
    """``inner_stride()``: distance to a worker's next interior node."""
    control_first: Any
    """``control_first(lane)``: index at which a lane begins a sweep of the control warp."""
    control_stride: Any
    """``control_stride()``: distance to its next index."""


@cache
def lane_functions(cluster: int = 1) -> LaneFunctions:
    """Generate the lane functions; on a GPU for a `cluster` of this many blocks.

    On the CPU `explicit.simd` defines them for packs. Packs compute short sums sequentially, in an order that
    does not depend on the lanes. Forces are therefore bitwise repeatable.
    """
    single_block = cluster == 1
    thread = "threadIdx.x" if single_block else f"(threadIdx.x + blockIdx.x % {cluster} * blockDim.x)"
    threads = "blockDim.x" if single_block else f"({cluster} * blockDim.x)"

    def native(snippet: str, **names: str) -> str:
        names |= {"WARPS": str(WARPS * cluster), "THREADS": threads, "THREAD": thread}
        for name, text in names.items():
            snippet = snippet.replace(name, text)
        return snippet

    def either(cuda: str, cpu: str) -> str:
        return native(_either(cuda, cpu))

    total, largest = native(HAND_OVER, ACROSS=DOWN), native(HAND_OVER, ACROSS=LARGEST)
    take = TAKE.replace(
        "FURTHER", "" if single_block else FURTHER
    )  # a block has at most as many warps as a warp has lanes
    one = "1" if single_block else "0"
    take_total = native(take, ACROSS=ADDED, COMBINE=SUM, NOTHING="0.0", ALONE=one)
    take_largest = native(take, ACROSS=LARGEST, COMBINE=LARGER, NOTHING="-1e300", ALONE=one)
    meet = native(BARRIER, MEET=MEET_IN_BLOCK if single_block else MEET_IN_CLUSTER)
    inside = _INSIDE if single_block else _INSIDE_CLUSTER
    parts_of: Any = wp.array(dtype=wp.float64)

    @wp.func_native(snippet=meet)
    def sync(): ...

    @wp.func
    def enter(control: parts_of):
        return

    @wp.func
    def announce(control: parts_of, step: int):
        return

    @wp.func
    def listen(control: parts_of, step: int):
        return

    @wp.func
    def leave():
        return

    @wp.func
    def inform(control: parts_of, first: int):
        return

    @wp.func
    def empty_sum():
        return wp.float64(0.0)

    @wp.func
    def add_to(sofar: wp.float64, share: wp.float64, place: int):
        return sofar + share

    @wp.func
    def add_share(sofar: wp.float64, which: int, share: wp.float64, place: int):
        return sofar + share

    @wp.func
    def put_share(sofar: wp.float64, which: int):
        return

    @wp.func
    def joined(sofar: wp.float64, which: int, n: int):
        return sofar

    @wp.func_native(snippet=either("return lane < THREADS - 32;", "return 1;"))
    def is_worker(lane: int) -> int: ...

    @wp.func_native(snippet=either("return THREADS - 32;", "return 1;"))
    def n_workers() -> int: ...

    @wp.func_native(snippet=either("return lane >= THREADS - 32;", "return 1;"))
    def is_control(lane: int) -> int: ...

    @wp.func_native(snippet=either("return lane == THREADS - 32;", "return 1;"))
    def is_writer(lane: int) -> int: ...

    @wp.func_native(snippet=total)
    def put_total(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=largest)
    def put_largest(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=take_total)
    def get_total(parts: parts_of, k: int) -> wp.float64: ...

    @wp.func_native(snippet=take_largest)
    def get_largest(parts: parts_of, k: int) -> wp.float64: ...

    @wp.func_native(snippet=BOUNDARY_TOTALS)
    def boundary_totals(first: parts_of, second: parts_of, n: int) -> wp.vec2d: ...

    @wp.func_native(snippet=either("__syncwarp();", ""))
    def control_sync(): ...

    @wp.func
    def settle(latched: wp.float64):
        return

    @wp.func
    def regroup(step: int, until_measured: int, latched: wp.float64):
        return step, until_measured, latched

    @wp.func
    def disband(latched: wp.float64):
        return latched

    nobody = "lane < THREADS - 32 ? {} : 0x40000000"

    @wp.func_native(snippet=either(f"return {nobody.format('lane')};", "return lane;"))
    def first_element(lane: int, n: int) -> int: ...

    @wp.func_native(snippet="return n;")
    def end_element(n: int) -> int: ...

    @wp.func_native(snippet="return lane;")
    def sum_first(lane: int) -> int: ...

    @wp.func_native(snippet=either(f"return {nobody.format('THREADS - 33 - lane')};", "return lane;"))
    def boundary_first(lane: int) -> int: ...

    @wp.func_native(snippet=either(f"return lane < {inside} ? lane : 0x40000000;", "return lane;"))
    def first_inner(lane: int, n: int, adds: int) -> int: ...

    @wp.func_native(snippet="return n;")
    def end_inner(n: int, adds: int) -> int: ...

    @wp.func_native(snippet=either(f"return {inside};", "return 1;"))
    def inner_stride() -> int: ...

    @wp.func_native(snippet=either("return lane & 31;", "return lane;"))
    def control_first(lane: int) -> int: ...

    @wp.func_native(snippet=either("return 32;", "return 1;"))
    def control_stride() -> int: ...

    return LaneFunctions(
        sync=sync, enter=enter, leave=leave, announce=announce, listen=listen, inform=inform,
        empty_sum=empty_sum, add_to=add_to, add_share=add_share, put_share=put_share,
        joined=joined, is_worker=is_worker, n_workers=n_workers, is_control=is_control, is_writer=is_writer,
        put_total=put_total, put_largest=put_largest, get_total=get_total, get_largest=get_largest,
        boundary_totals=boundary_totals, control_sync=control_sync, settle=settle, regroup=regroup,
        disband=disband, first_element=first_element, end_element=end_element, sum_first=sum_first,
        boundary_first=boundary_first, first_inner=first_inner, end_inner=end_inner,
        inner_stride=inner_stride, control_first=control_first, control_stride=control_stride,
    )  # fmt: skip


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
"""Blocks exchange data only through their shared memories. Global memory therefore needs no write-back, and
its cache no invalidation. When a block's threads have synchronised, their writes are complete. One thread for
each other block signals this. `whole` is the barrier of the hardware. It orders more accesses and takes
longer."""
_RECORD = f"""
#if defined(__CUDA_ARCH__)
    __shared__ unsigned long long barrier;
    const unsigned place = (unsigned)__cvta_generic_to_shared(&barrier);
    if (event == BEGIN) {{
        if (threadIdx.x == 0) {_INIT.replace("COUNT", "1")}
    }} else if (event == ANNOUNCE) {{
        __syncwarp();
        for (int k = threadIdx.x & 31; k < (BLOCKS - 1) * SENT; k += 32) {{
            const int slot = k % SENT, number = slot < SIZE ? PLANS + SIZE * (step & 1) + slot
                : slot == SIZE ? GOING : slot == SIZE + 1 ? LOWER_NEXT : LOWER_SPEED;
            asm volatile(
                "{{ .reg .b32 there, done; "
                "mapa.shared::cluster.u32 there, %0, %2; mapa.shared::cluster.u32 done, %1, %2; "
                "st.async.shared::cluster.mbarrier::complete_tx::bytes.f64 [there], %3, [done]; }}"
                :: "r"((unsigned)__cvta_generic_to_shared(control.data + number)), "r"(place), "r"(k / SENT),
                "d"(control.data[number]) : "memory");
        }}
    }} else if (blockIdx.x % BLOCKS != BLOCKS - 1) {{
        const unsigned parity = (step + 1) & 1; // they listen once in every step, from -1 on
        if (threadIdx.x == 0) {{
            asm volatile("mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;"
                :: "r"(place), "r"(8 * SENT) : "memory");
        }}
        {_WAIT}
    }}
#endif
"""
"""Before synchronisation the last block sends the necessary data of its record to the other blocks. After
synchronisation they read these data."""
_BEGIN, _ANNOUNCE, _LISTEN = range(3)


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
    """The lane functions for this number of blocks, which store a simulation in their shared memories."""
    parts_of: Any = wp.array(dtype=wp.float64)

    def native(snippet: str, **names: str) -> str:
        for name, text in {**names, "BLOCKS": str(blocks), "WARPS": str(WARPS)}.items():
            snippet = snippet.replace(name, text)
        return snippet

    constants = {
        "BEGIN": _BEGIN, "ANNOUNCE": _ANNOUNCE, "SENT": Plan.SIZE + 3, "PLANS": Control.PLANS,
        "SIZE": Plan.SIZE, "GOING": Control.GOING, "LOWER_NEXT": Control.LOWER_NEXT,
        "LOWER_SPEED": Control.LOWER_SPEED,
    }  # fmt: skip

    @wp.func_native(snippet=native(_MEET))
    def meet(whole: int, begins: int): ...

    @wp.func_native(snippet=native(_RECORD, **{name: str(int(number)) for name, number in constants.items()}))
    def record(event: int, control: parts_of, step: int): ...

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
    def announce(control: parts_of, step: int):
        record(_ANNOUNCE, control, step)

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
        lane_functions(blocks), sync=sync, enter=enter, leave=leave, announce=announce, listen=listen,
        inform=inform, put_total=put_total, put_largest=put_largest, get_total=get_total,
        get_largest=get_largest,
    )  # fmt: skip


CLUSTERS = (16, 4)
"""Numbers of blocks, largest first, that may share a simulation. It is too large for the shared memory of one
block."""
CLUSTER_ARCH = 90
"""Lowest GPU architecture on which blocks can share one."""
CHIP_ARCHES = (90,)
"""On these architectures the shared memories of a cluster's blocks have the addresses that
`explicit.layout.state` assumes. On others blocks share a simulation in global memory."""
SPREAD = 0.8
"""Share of the multiprocessors that clusters may use. A cluster lies within one group of multiprocessors, so
a part of each group remains free."""


def block_for(n_samples: int, device: Any, on_chip: bool) -> int:
    """Threads of a block for a batch on a Warp device."""
    return SMALL_BLOCK if device.is_cuda and on_chip and n_samples > device.sm_count else BLOCK


def supports_chip_memory(device: Any) -> bool:
    """True if blocks of a Warp device can store a simulation in their shared memories."""
    return bool(device.is_cuda) and device.arch in CHIP_ARCHES


def cluster_for(
    n_samples: int,
    n_elements: int,
    device: Any,
    on_chip: bool,
    fits: Callable[[int], bool] = lambda blocks: False,
) -> int:
    """Number of blocks that share a simulation of a batch on a Warp device.

    The free blocks and the work limit it. If shared memories can store the simulation (`fits`), it is the
    smallest number of blocks that can.
    """
    if on_chip or not device.is_cuda or device.arch < CLUSTER_ARCH or n_elements <= BLOCK - 32:
        return 1
    free = [cluster for cluster in CLUSTERS if n_samples * cluster <= SPREAD * device.sm_count]
    fitting = [cluster for cluster in free if fits(cluster)] if supports_chip_memory(device) else []
    # the next smaller choice must have fewer workers than there are elements
    busy = [cluster for cluster in free if n_elements > cluster // 4 * (BLOCK - 32)]
    return fitting[-1] if fitting else busy[0] if busy else 1

"""Lanes of one simulation: what they do together, natively.

On a GPU the lanes are the threads of one block, or of the few blocks of a cluster
(`explicit.time_loop.blocks`). On the CPU `explicit.simd` translates the lanes to those of SIMD registers.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.time_loop.lane_code import (
    ADDED,
    BARRIER,
    BOUNDARY_TOTALS,
    DOWN,
    FURTHER,
    HAND_OVER,
    LARGER,
    LARGEST,
    MEET_IN_BLOCK,
    MEET_IN_CLUSTER,
    SUM,
    TAKE,
)

BLOCK = 384
"""Threads that share one simulation on a GPU; among them its registers are shared out."""
SMALL_BLOCK = 96
"""The same where there are more simulations than multiprocessors: four share one, and while the threads of
one wait for each other those of the others go on."""
SHARING = 4
"""How many those are."""
WARPS = BLOCK // 32
"""Most warps of a block; its last one is the control warp."""

_INSIDE = f"((signed)blockDim.x - (blockDim.x < {BLOCK} ? 32 : 96))"
_INSIDE_CLUSTER = "((signed)THREADS - 256)"


def _either(cuda: str, cpu: str) -> str:
    return f"\n#if defined(__CUDA_ARCH__)\n    {cuda}\n#else\n    {cpu}\n#endif\n"


@dataclass(frozen=True)
class LaneFunctions:
    """Common work of the lanes: workers, which sweep elements and nodes, and the control warp.

    On a GPU the lanes are the threads of a block; elsewhere every lane is worker and control at once.
    """

    sync: Any
    """``sync()``: every lane waits for the others; their writes are visible after it."""
    enter: Any
    """``enter(control)``: every lane is there; the first that it calls."""
    leave: Any
    """``leave()``: no lane needs another any more; the last that it calls."""
    tell: Any
    """``tell(control, step)``: the control warp is about to meet the workers, who will need the plan of the
    step, whether there is one, and where the support will be."""
    listen: Any
    """``listen(control, step)``: the lanes have met, and need what they were told, once in every step."""
    inform: Any
    """``inform(control, first)``: the lanes have met, and need the control record from a slot on."""
    empty_sum: Any
    """``empty_sum()``: where a sum over elements or nodes begins."""
    add_to: Any
    """``add_to(sum, x, k)``: the sum with the share of the k-th element or node."""
    add_share: Any
    """``add_share(sum, which, x, k)``: the same for a sum of every step over elements, the one of `Share`."""
    put_share: Any
    """``put_share(sum, which)``: the elements are swept; call it before the lanes meet."""
    joined: Any
    """``joined(sum, which, n)``: the sum over n elements after they have met, in the order of one thread."""
    is_worker: Any
    """``is_worker(lane)``: 1 for a lane that sweeps elements."""
    n_workers: Any
    """``n_workers()``: how many those are."""
    is_control: Any
    """``is_control(lane)``: 1 for a lane of the control warp."""
    is_writer: Any
    """``is_writer(lane)``: 1 for the lane of the control warp that writes what is written once."""
    put_total: Any
    """``put_total(parts, k, x)``: hand over the k-th total, of every lane's x."""
    put_largest: Any
    """``put_largest(parts, k, x)``: the same for the largest x."""
    get_total: Any
    """``get_total(parts, k)``: the k-th total."""
    get_largest: Any
    """``get_largest(parts, k)``: the k-th largest value."""
    boundary_totals: Any
    """``boundary_totals(first, second, n)``: sums of n numbers each, over boundary nodes, on every lane of
    the control warp."""
    control_sync: Any
    """``control_sync()``: the control warp's lanes have read what they are about to write."""
    settle: Any
    """``settle(latched)``: of a CPU's threads, who goes on with the next step; with the largest value that
    each would leave to the others. Call it before the lanes meet at the end of a step."""
    regroup: Any
    """``regroup(step, until_measured, latched)``: the same three to begin a step with. Threads of a CPU come
    and go here (`explicit.simd.team`)."""
    disband: Any
    """``disband(latched)``: the loop is at its end, and what follows is done by one thread of a CPU: the
    largest value that it and the others have latched."""
    first_element: Any
    """``first_element(lane, n)``: the element of n at which a worker begins."""
    end_element: Any
    """``end_element(n)``: the one before which it ends."""
    sum_first: Any
    """``sum_first(lane)``: where a worker begins a sweep that is rare and adds up: of a CPU's threads the
    last has all of it."""
    boundary_first: Any
    """``boundary_first(lane)``: the boundary node at which a worker begins."""
    first_inner: Any
    """``first_inner(lane, n, adds)``: the node of n in the interior at which a worker begins. A whole block
    keeps its last workers for the boundary, where a node takes several times as long. `adds` is 1 where the
    sweep adds up."""
    end_inner: Any
    """``end_inner(n, adds)``: the node before which it ends."""
    inner_stride: Any
    """``inner_stride()``: how far a worker goes on there."""
    control_first: Any
    """``control_first(lane)``: where a lane of the control warp begins a sweep of its own."""
    control_stride: Any
    """``control_stride()``: how far it goes on."""


@cache
def lane_functions(cluster: int = 1) -> LaneFunctions:
    """Generate the lane functions; on a GPU for a `cluster` of so many blocks.

    On the CPU `explicit.simd` gives them their meaning over packs; short sums are made one after the other
    there, in one order whatever the lanes are, so that forces keep their bits.
    """
    alone = cluster == 1
    thread = "threadIdx.x" if alone else f"(threadIdx.x + blockIdx.x % {cluster} * blockDim.x)"
    threads = "blockDim.x" if alone else f"({cluster} * blockDim.x)"

    def native(snippet: str, **names: str) -> str:
        names |= {"WARPS": str(WARPS * cluster), "THREADS": threads, "THREAD": thread}
        for name, text in names.items():
            snippet = snippet.replace(name, text)
        return snippet

    def either(cuda: str, cpu: str) -> str:
        return native(_either(cuda, cpu))

    total, largest = native(HAND_OVER, ACROSS=DOWN), native(HAND_OVER, ACROSS=LARGEST)
    take = TAKE.replace("FURTHER", "" if alone else FURTHER)  # a block has no more warps than a warp lanes
    one = "1" if alone else "0"
    take_total = native(take, ACROSS=ADDED, COMBINE=SUM, NOTHING="0.0", ALONE=one)
    take_largest = native(take, ACROSS=LARGEST, COMBINE=LARGER, NOTHING="-1e300", ALONE=one)
    meet = native(BARRIER, MEET=MEET_IN_BLOCK if alone else MEET_IN_CLUSTER)
    inside = _INSIDE if alone else _INSIDE_CLUSTER
    parts_of: Any = wp.array(dtype=wp.float64)

    @wp.func_native(snippet=meet)
    def sync(): ...

    @wp.func
    def enter(control: parts_of):
        return

    @wp.func
    def tell(control: parts_of, step: int):
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
        sync=sync, enter=enter, leave=leave, tell=tell, listen=listen, inform=inform,
        empty_sum=empty_sum, add_to=add_to, add_share=add_share, put_share=put_share,
        joined=joined, is_worker=is_worker, n_workers=n_workers, is_control=is_control, is_writer=is_writer,
        put_total=put_total, put_largest=put_largest, get_total=get_total, get_largest=get_largest,
        boundary_totals=boundary_totals, control_sync=control_sync, settle=settle, regroup=regroup,
        disband=disband, first_element=first_element, end_element=end_element, sum_first=sum_first,
        boundary_first=boundary_first, first_inner=first_inner, end_inner=end_inner,
        inner_stride=inner_stride, control_first=control_first, control_stride=control_stride,
    )  # fmt: skip

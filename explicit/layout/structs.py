"""Arguments of the time loop as Warp structs, the control record with its slots, and grouped tables of
constants.

While the workers sweep the elements, the control warp finishes the previous step
(`explicit.time_loop.steps`). While they move the nodes, it plans the next step. The workers read the plan
from the control record, which is in shared memory on a GPU. On a CPU every lane is worker and control at
once. Tables of the mesh's constants are grouped: neighbouring elements or nodes are adjacent in memory. The
native accessors of the tables compute one address. `explicit.simd` defines them for packs.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.precision import Precision


@dataclass(frozen=True)
class Structs:
    """The struct types of one law and precision."""

    Body: Any
    """The mesh's constants."""
    Batch: Any
    """Per-sample parameters and tables."""
    State: Any
    """Varying fields, each `[sample, node]`."""
    Output: Any
    """Recorded histories, each `[sample, time, ...]`, and final data of each simulation, `[sample,
    Ending]`."""


@cache
def batch_structs(precision: Precision, Shape: Any, Solid: Any) -> Structs:
    """Generate the structs with an element's `Shape` and a sample's `Solid`."""
    real = precision.real

    @wp.struct
    class Body:
        n_elements: int
        n_nodes: int
        n_inner: int
        first_boundary: int
        n_boundary: int
        length: wp.float64
        shapes: wp.array2d(dtype=real)
        quads: wp.array2d(dtype=int)
        corners: wp.array2d(dtype=int)
        masses: wp.array2d(dtype=real)
        reference_r: wp.array(dtype=wp.float64)
        reference_y: wp.array(dtype=wp.float64)
        surface_mass: wp.array(dtype=real)
        kind: wp.array(dtype=int)
        at_rest: wp.array(dtype=int)

    @wp.struct
    class Batch:
        start: wp.float64
        safety: wp.float64
        largest_step: wp.float64
        floor: wp.float64
        measure_every: int
        ledger_every: int
        max_steps: int
        impedance: wp.float64
        round_trip: wp.float64
        support_moves: int
        data_limit: wp.array(dtype=real)
        stop_past_data: int
        stray_energy: wp.array(dtype=wp.float64)
        solids: wp.array(dtype=Solid)
        friction: wp.array(dtype=real)
        release_stress: wp.array(dtype=real)
        contact_stiffness: wp.array(dtype=real)
        material: wp.array(dtype=int)
        branches: wp.array2d(dtype=real)
        relaxation: wp.array(dtype=int)
        rows: wp.array2d(dtype=real)
        motion: wp.array(dtype=int)
        motion_rate: wp.array(dtype=wp.float64)
        support_motion: wp.array(dtype=int)
        motion_table: wp.array3d(dtype=wp.float64)

    @wp.struct
    class State:
        u_r: wp.array2d(dtype=real)
        u_y: wp.array2d(dtype=real)
        v_r: wp.array2d(dtype=real)
        v_y: wp.array2d(dtype=real)
        corner_r: wp.array2d(dtype=real)
        corner_y: wp.array2d(dtype=real)
        touched: wp.array2d(dtype=int)
        slip: wp.array2d(dtype=real)
        memory: wp.array2d(dtype=real)
        push_lower: wp.array2d(dtype=wp.float64)
        push_upper: wp.array2d(dtype=wp.float64)
        carried: wp.array2d(dtype=wp.float64)
        control: wp.array2d(dtype=wp.float64)
        partials: wp.array2d(dtype=wp.float64)
        bar_wave: wp.array2d(dtype=wp.float64)

    @wp.struct
    class Output:
        force_times: wp.array(dtype=wp.float64)
        surface_times: wp.array(dtype=wp.float64)
        n_recorded: int
        nodes: wp.array(dtype=int)
        force: wp.array3d(dtype=wp.float64)
        impulse: wp.array3d(dtype=wp.float64)
        position: wp.array4d(dtype=wp.float64)
        energy: wp.array3d(dtype=wp.float64)
        ending: wp.array2d(dtype=wp.float64)

    return Structs(Body, Batch, State, Output)


@dataclass(frozen=True)
class SimulationStructs:
    """Struct types that the functions of the time loop pass to each other about one simulation."""

    Fields: Any
    """Its rows of the state: displacements [m] and velocities [m/s] of nodes, forces of corners [N]."""
    Surface: Any
    """Contact data of its boundary nodes: contact status, impulses [N s], mass carried [kg]."""
    Step: Any
    """The current step. Times are its size `dt` [s], the `interval` over which forces change the velocities
    [s], and the `rate` 1 / dt [1/s]. Platens have positions at its end [m] and speeds upwards [m/s]. `ledger`
    is 1 if the energies are recorded in it."""


@cache
def simulation_structs(precision: Precision) -> SimulationStructs:
    """Generate the structs."""
    real = precision.real

    @wp.struct
    class Fields:
        u_r: wp.array(dtype=real)
        u_y: wp.array(dtype=real)
        v_r: wp.array(dtype=real)
        v_y: wp.array(dtype=real)
        corner_r: wp.array(dtype=real)
        corner_y: wp.array(dtype=real)

    @wp.struct
    class Surface:
        touched: wp.array(dtype=int)
        push_lower: wp.array(dtype=wp.float64)
        push_upper: wp.array(dtype=wp.float64)
        carried: wp.array(dtype=wp.float64)

    @wp.struct
    class Step:
        dt: wp.float64
        interval: wp.float64
        rate: wp.float64
        flyer_next: wp.float64
        upper_speed: wp.float64
        ledger: int

    return SimulationStructs(Fields, Surface, Step)


class Control(IntEnum):
    """Slots of the control record.

    Units: times and steps [s], displacements [m], speeds [m/s], forces [N], impulses [N s]. Counters are
    exact in fp64.
    """

    TIME = 0
    """Time of the positions at the end of the last finished step."""
    STATUS = 1
    """`explicit.response.Outcome`; 0 while no failure has occurred."""
    GOING = 2
    """1 until the simulation ends."""
    STEPS = 3
    """Number of finished steps."""
    SMALLEST_STEP = 4
    FIRST_STEP = 5
    PAST_DATA = 6
    """Largest volume beyond the material's data [m^3]."""
    MOST_STRAINED = 7
    """Largest s = sqrt(I1_bar - 3) [-]."""
    FORCE_FLYER = 8
    FORCE_SUPPORT = 9
    IMPULSE_FLYER = 10
    IMPULSE_SUPPORT = 11
    LOWER_NEXT = 12
    """Displacement of the support at the end of the step."""
    LOWER_SPEED = 13
    """Speed of the support in the step."""
    RECORDED = 14
    """Number of stored values of the outgoing wave."""
    NEXT_FORCE = 15
    """Row of the next force record."""
    FORCE_DUE = 16
    """Its time."""
    NEXT_SURFACE = 17
    """Row of the next record of positions."""
    SURFACE_DUE = 18
    """Its time."""
    PLANNED = 19
    """Row of the next record of positions after the planned step."""
    PLANNED_DUE = 20
    """Its time."""
    FAULT = 21
    """Outcome that ends the simulation with the current step, or 0."""
    VOID = 22
    """1 if the current step began after a failure and is not counted."""
    MOST_WORK = 23
    """Largest work of the platens so far [J]."""
    PLANS = 24
    """First slots of the plans of steps, for even and for odd steps. One plan is made while the other is
    executed."""


class Plan(IntEnum):
    """Slots of the plan of a step."""

    STEP = 0
    STEP_BEFORE = 1
    INTERVAL = 2
    """Time over which the forces change the velocities: half the sum of the previous and this step."""
    PER_INTERVAL = 3
    RATE = 4
    """1 over the step [1/s]."""
    FLYER_NEXT = 5
    """Displacement of the flyer at the end of the step."""
    UPPER_SPEED = 6
    """Speed of the flyer in the step, upwards."""
    LEDGER = 7
    """1 where energies are recorded in the step."""
    SIZE = 8


class Total(IntEnum):
    """Slots of the numbers from the workers: first totals of the energies [J], then values that the control
    warp monitors."""

    ELASTIC = 0
    HOURGLASS = 1
    KINETIC = 2
    WORK = 3
    DAMPING = 4
    FRICTION = 5
    LANDING = 6
    RESTRAINT = 7
    PAST = 8
    """Volume past the material's data [m^3]."""
    MOST = 9
    """Largest s [-]."""
    MOTION = 10
    """Kinetic energy, for divergence [J]."""
    WORK_DONE = 11
    """Work of the platens, for divergence [J]."""
    TURNED = 12
    """Largest omega^2 since the last measurement; an inverted element has a very large value [1/s^2]."""
    BEYOND = 13
    """Largest s beyond the data, if that ends a simulation [-]."""
    STIFFEST = 14
    """Largest omega^2 of the law, of even and of odd steps [1/s^2]."""
    STIFFER = 16
    """Largest omega^2 of the relaxation, of even and of odd steps [1/s^2]."""
    VISCOUS = 18
    """Work done on the branches that relax [J]."""
    COUNT = 19


class Share(IntEnum):
    """Slots of the sums over elements that the threads of a CPU make together in every step."""

    POWER = 0
    """Power lost to damping [W]."""
    ARTIFICIAL = 1
    """Power of the hourglass control [W]."""
    COUNT = 2


class Ending(IntEnum):
    """Slots of the final data of a simulation."""

    STATUS = 0
    FAILED_ELEMENT = 1
    STEPS = 2
    END_TIME = 3
    SMALLEST_STEP = 4
    PAST_DATA = 5
    MOST_STRAINED = 6
    COUNT = 7


CONTROL_SIZE = int(Control.PLANS) + 2 * int(Plan.SIZE)
"""Numbers of the control record."""
NO_TIME = 1.0e300
"""Time [s] that is later than all records."""


GROUP = 32
"""Number of elements or nodes with adjacent constants: those of a warp, or of a few packs."""
LOADED_BYTES = 16
"""Bytes that a thread of a GPU loads at once."""

_GROUP_OF = "const char* group = (const char*)table.data + (long long)((e >> SHIFT) * (int)table.strides[0]);"
_ENTRY = f"""
    {_GROUP_OF}
#if defined(__CUDA_ARCH__)
    return ((const TYPE*)group + (e & (GROUP - 1)) * MANY)[k / MANY * MANY * GROUP + k % MANY];
#else
    return ((const TYPE*)group + (e & (GROUP - 1)))[k * GROUP];
#endif
"""
_FOUR_ENTRIES = f"""
    {_GROUP_OF}
#if defined(__CUDA_ARCH__)
    const TYPE* first = (const TYPE*)group + (e & (GROUP - 1)) * MANY + k * GROUP;
    LOAD
#else
    const TYPE* number = (const TYPE*)group + (e & (GROUP - 1)) + k * GROUP;
    return wp::vec_t<4, TYPE>(number[0], number[GROUP], number[2 * GROUP], number[3 * GROUP]);
#endif
"""
_LOAD = {
    wp.float32: "const float4 x = *(const float4*)first;\n    return wp::vec_t<4, TYPE>(x.x, x.y, x.z, x.w);",
    wp.int32: "const int4 x = *(const int4*)first;\n    return wp::vec_t<4, TYPE>(x.x, x.y, x.z, x.w);",
    wp.float64: "const double2 x = *(const double2*)first, y = *(const double2*)(first + 2 * GROUP);\n"
    "    return wp::vec_t<4, TYPE>(x.x, x.y, y.x, y.y);",
}


@cache
def entry_function(dtype: Any) -> Any:
    """Generate ``entry(table, k, e)``: the k-th constant of element or node e of a grouped table."""

    @wp.func_native(snippet=_for_groups(_ENTRY, dtype))
    def entry(table: wp.array2d(dtype=dtype), k: int, e: int) -> dtype: ...

    return entry


@cache
def entries_function(dtype: Any) -> Any:
    """Generate ``entries(table, k, e) -> vec4``: constants k to k + 3; k is a multiple of four."""
    Four = wp.types.vector(4, dtype)

    @wp.func_native(snippet=_for_groups(_FOUR_ENTRIES, dtype))
    def entries(table: wp.array2d(dtype=dtype), k: int, e: int) -> Four: ...  # type: ignore[valid-type]

    return entries


@cache
def entries_if_function(dtype: Any) -> Any:
    """Generate ``entries_if(condition, table, k, e) -> vec4``: the same if `condition` is 1. Otherwise the
    values are arbitrary, and a GPU does not load them."""
    Four = wp.types.vector(4, dtype)
    unwanted = f"if (condition != 1) return wp::vec_t<4, wp::{dtype.__name__}>();"

    @wp.func_native(snippet=unwanted + _for_groups(_FOUR_ENTRIES, dtype))
    def entries_if(condition: int, table: wp.array2d(dtype=dtype), k: int, e: int) -> Four: ...  # type: ignore[valid-type]

    return entries_if


def _for_groups(snippet: str, dtype: Any) -> str:
    many = LOADED_BYTES // np.dtype(wp.dtype_to_numpy(dtype)).itemsize
    snippet = snippet.replace("LOAD", _LOAD[dtype]).replace("TYPE", f"wp::{dtype.__name__}")
    snippet = snippet.replace("GROUP", str(GROUP)).replace("SHIFT", str(GROUP.bit_length() - 1))
    return snippet.replace("MANY", str(many))


_FOUR = """
#if defined(__CUDA_ARCH__)
    const TYPE* first = (const TYPE*)row.data + place;
    QUAD
#else
    const TYPE* number = (const TYPE*)row.data + place;
    return wp::vec_t<4, TYPE>(number[0], number[1], number[2], number[3]);
#endif
"""
_QUAD = {wp.float32: _LOAD[wp.float32], wp.float64: _LOAD[wp.float64].replace("2 * GROUP", "2")}
_FOUR_BACKWARD = """
    if (row.grad) for (int c = 0; c < 4; ++c) wp::atomic_add((TYPE*)row.grad + place + c, adj_ret[c]);
"""


@cache
def four_function(precision: Precision) -> Any:
    """Generate ``four(row, place)``: four consecutive numbers of a row without gaps.

    A GPU loads them at once: `place` and the distance of rows are multiples of four.
    """
    real, vec4 = precision.real, precision.vec4
    whole = _FOUR.replace("QUAD", _QUAD[real])
    forward, backward = (text.replace("TYPE", f"wp::{real.__name__}") for text in (whole, _FOUR_BACKWARD))

    @wp.func_native(snippet=forward, adj_snippet=backward)
    def four(row: wp.array(dtype=real), place: int) -> vec4: ...

    return four


def grouped(table: NDArray[Any], *, loaded: int = 0) -> NDArray[Any]:
    """A table of shape [constants, n] in the layout of `entry` and `entries`: [groups, constants * GROUP].

    In a group the values of one constant for all elements are adjacent, so a pack is one load. A thread of a
    GPU loads `LOADED_BYTES` at once. With `loaded` bytes an element's successive constants are adjacent.
    """
    constants, n = table.shape
    groups, many = -(-n // GROUP), max(loaded // table.dtype.itemsize, 1)
    padded = np.pad(table, [(0, -constants % many), (0, groups * GROUP - n)], mode="edge")
    split = padded.reshape(-1, many, groups, GROUP)
    return np.ascontiguousarray(split.transpose(2, 0, 3, 1)).reshape(groups, -1)

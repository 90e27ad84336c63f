"""The arguments of the time loop as Warp structs: constant body and batch, varying state, recorded output."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision


@dataclass(frozen=True)
class Structs:
    """The struct types of one law and precision."""

    Body: Any
    """The mesh's constants."""
    Batch: Any
    """Per-sample parameters and tables."""
    State: Any
    """Fields that vary, each `[sample, node]`."""
    Output: Any
    """Recorded histories, each `[sample, time, ...]`, and how each simulation ended, `[sample, Ending]`."""


@cache
def batch_structs(precision: Precision, Shape: Any, Solid: Any) -> Structs:
    """Generate the structs around an element's `Shape` and a sample's `Solid`."""
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
    """What its boundary nodes have of their platens: marks of contact, impulses [N s], mass carried [kg]."""
    Step: Any
    """The step under way: its size `dt` [s], the `interval` over which forces change the velocities [s], the
    `rate` 1 / dt [1/s], where the platens will be [m] and their speeds, upwards [m/s], and whether the
    `ledger` is due in it."""


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

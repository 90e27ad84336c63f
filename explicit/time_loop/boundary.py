"""The specimen's boundary: the flyer's motion, the support's wave, and a node that meets a platen."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.contact import contact_law
from explicit.contact.base import RELEASED, touch_struct
from explicit.precision import Precision
from explicit.time_loop.structs import Structs

INTERIOR, LOWER, UPPER, SIDE = 0, 1, 2, 3
"""Node kinds: which platen a node can meet. LOWER and UPPER also mark the platen that a node has touched,
with UPPER added where it has been let go again."""

BAR_HISTORY = 1024
"""Samples per round trip of the wave stored for a characteristic bar."""


@dataclass(frozen=True)
class BoundaryFunctions:
    """The boundary of one pair of contact laws and precision."""

    platen_position: Any
    """``platen_position(batch, motion, time)``: displacement of a platen whose motion is tabulated [m]."""
    returned_wave: Any
    """``returned_wave(state, sample, elapsed, round_trip)``: h(t) of `explicit.support` [m/s]."""
    contact: Any
    """``contact(body, batch, state, sample, node, kind, touched, free, to_lower, to_upper, friction,
    interval, step) -> (velocity, platen, touched)``."""


@cache
def boundary_functions(faces: str, side: str, precision: Precision, structs: Structs) -> BoundaryFunctions:
    """Generate the boundary for two contact laws."""
    real, vec2 = precision.real, precision.vec2
    Body, Batch, State = structs.Body, structs.Batch, structs.State
    face_law, side_law = contact_law(faces), contact_law(side)
    face_contact, side_contact = face_law.kernel_function(precision), side_law.kernel_function(precision)
    Touch = touch_struct(precision)
    ZERO = wp.float64(0.0)
    lower, upper, on_side, released = int(LOWER), int(UPPER), int(SIDE), int(RELEASED)
    remembers = int(face_law.remembers_slip or side_law.remembers_slip)
    history, twice = int(BAR_HISTORY), int(2 * BAR_HISTORY)

    @wp.func
    def platen_position(batch: Batch, motion: int, time: wp.float64):
        last = batch.motion_table.shape[1] - 1
        position = (time - batch.start) * batch.motion_rate[motion]
        k = wp.clamp(int(position), 0, last)
        x = position - wp.float64(k)
        f, d = batch.motion_table[motion, k, 0], batch.motion_table[motion, k, 1]
        a, c = batch.motion_table[motion, k, 2], batch.motion_table[motion, k, 3]
        return f + x * (d + x * (a + x * c))

    @wp.func
    def returned_wave(state: State, sample: int, elapsed: wp.float64, round_trip: wp.float64):
        """The wave h(t) = g(t - 2 L / c) that comes back from the bar's free end."""
        wave = wp.float64(0.0)
        late = elapsed - round_trip
        if late > ZERO:
            position = late / round_trip * wp.float64(history)
            k = int(position)
            share = position - wp.float64(k)
            early = state.bar_wave[sample, k % twice]
            later = state.bar_wave[sample, (k + 1) % twice]
            wave = early + share * (later - early)
        return wave

    @wp.func
    def of_either(touch: Touch, kind: int):
        new, held, slip = face_contact(touch)
        if kind == on_side:
            new, held, slip = side_contact(touch)
        return new, held, slip

    @wp.func
    def of_both(touch: Touch, kind: int):
        return face_contact(touch)

    contact_of = of_both if faces == side else of_either

    @wp.func
    def contact(
        body: Body,
        batch: Batch,
        state: State,
        sample: int,
        node: int,
        kind: int,
        touched: int,
        free: vec2,
        to_lower: real,
        to_upper: real,
        friction: real,
        interval: real,
        step: real,
    ):
        """Admissible velocity of a boundary node, the platen it met (or 0) and its new touch mark."""
        new, platen, mark = vec2(free), int(0), int(touched)
        before, held, slip = int(touched), int(touched > 0), real(0.0)
        if touched > upper:
            before = touched - upper
            held = released
        target, normal = real(to_lower), real(1.0)
        if before == upper or (before == 0 and free[1] > to_upper):
            platen = upper
        if before == lower or (before == 0 and free[1] < to_lower):
            platen = lower
        if kind != on_side:
            platen = kind
        if platen == upper:
            target = to_upper
            normal = real(-1.0)
        if platen != 0:
            if remembers == 1:
                slip = state.slip[sample, node]
            release, stiffness = batch.release_stress[sample], batch.contact_stiffness[sample]
            touch = Touch(
                free[0], free[1], target, normal, held, slip,
                friction, release, stiffness, body.surface_mass[node], interval, step,
            )  # fmt: skip
            new, held, slip = contact_of(touch, kind)
        if kind == on_side and (free[1] < to_lower or free[1] > to_upper):
            mark = platen
        if held == released:
            mark = before + upper
        if remembers == 1:
            state.slip[sample, node] = slip
        return new, platen, mark

    return BoundaryFunctions(platen_position, returned_wave, contact)

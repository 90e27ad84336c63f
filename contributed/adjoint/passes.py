"""The forward run in phases with checkpoints, and the reverse pass over them.

The forward run measures its steps or repeats recorded ones. The reverse pass recomputes every segment from
its checkpoint on a tape and runs the tape backward. It then differentiates the wave that returns from the far
end of the bar.
"""

from dataclasses import dataclass, field
from functools import cached_property
from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contributed.adjoint.perturbed_runs import Histories
from contributed.adjoint.plan import FIELDS, PhasePlan
from explicit.arrays import FloatArray
from explicit.elements.base import INVERTED
from explicit.model import Sampling
from explicit.platens import CharacteristicBar
from explicit.response import Outcome
from explicit.time_loop.node_sweeps import BAR_HISTORY


@dataclass(frozen=True)
class StepSequence:
    """The steps that a forward run took. A gradient does not vary them."""

    start: float
    """Time at which the specimen is at rest [s]."""
    dt: FloatArray
    """Steps [s], shape [n_steps]."""

    def __len__(self) -> int:
        return len(self.dt)

    @cached_property
    def time(self) -> FloatArray:
        """Beginning of each step [s], shape [n_steps]."""
        return np.cumsum(np.concatenate([[self.start], self.dt]))[:-1]

    @cached_property
    def before(self) -> FloatArray:
        """The step before each one, 0 before the first [s], shape [n_steps]."""
        return np.concatenate([[0.0], self.dt[:-1]])

    @cached_property
    def interval(self) -> FloatArray:
        """Time between the velocities, (dt_before + dt) / 2 [s], shape [n_steps]."""
        return 0.5 * (self.before + self.dt)


@dataclass(frozen=True)
class ForceSampling:
    """The linear map from the forces of the steps to force and impulse at the requested times. The
    interpolation is that of the time loop. A force is linear between two steps. An impulse increases with the
    force of the step that contains the time."""

    steps: StepSequence
    times: FloatArray
    """Requested times [s], shape [n_times]."""

    @cached_property
    def _step(self) -> NDArray[np.intp]:
        """Index of the first step that begins at or after each requested time."""
        return np.searchsorted(self.steps.time, self.times, side="left")

    @cached_property
    def _blend(self) -> FloatArray:
        before = self.steps.before[self._step]
        since = self.times - (self.steps.time[self._step] - before)
        return np.divide(since, before, out=np.ones_like(since), where=before > 0.0)

    @cached_property
    def _since(self) -> FloatArray:
        """Time between the last known impulse and the requested time [s]."""
        return self.times - (self.steps.time[self._step] - 0.5 * self.steps.before[self._step])

    def force(self, of_steps: FloatArray) -> FloatArray:
        """Force at the requested times [N] from the forces of the steps."""
        with_start = np.concatenate([[0.0], of_steps])  # no force before the first step
        before, now = with_start[self._step], with_start[self._step + 1]
        return before + self._blend * (now - before)

    def impulse(self, of_steps: FloatArray) -> FloatArray:
        """Impulse at the requested times [N s] from the forces of the steps."""
        with_start = np.concatenate([[0.0], of_steps])
        sums = np.concatenate([[0.0], np.cumsum(of_steps * self.steps.interval)])
        return sums[self._step] + self._since * with_start[self._step + (self._since >= 0.0)]

    def transposed(self, force: FloatArray, impulse: FloatArray) -> FloatArray:
        """Cotangent of the forces of the steps from those of `force` and `impulse`, shape [n_steps]."""
        n = len(self.steps)
        of_steps, ends = np.zeros(n + 1), np.zeros(n + 1)
        np.add.at(of_steps, self._step, (1.0 - self._blend) * force)
        np.add.at(of_steps, self._step + 1, self._blend * force)
        np.add.at(of_steps, self._step + (self._since >= 0.0), self._since * impulse)
        np.add.at(ends, self._step, impulse)
        sums = np.cumsum(ends[::-1])[::-1][1:]  # an impulse sums the steps before its step
        return of_steps[1:] + sums * self.steps.interval


class Source(NamedTuple):
    """Source of a returned value of the wave: two neighbouring stored values."""

    early: int
    """The step in which the earlier value left; -1 before the first return."""
    following: int
    """The step in which the later value left."""
    share: float
    """Weight of the later value [-]."""


@dataclass
class ReturnedWave:
    """The outgoing wave of each step and the returned wave, which is interpolated from it. The time loop
    stores `BAR_HISTORY` values of the outgoing wave per round trip. Each value comes from the first step at
    or after its time. The loop interpolates linearly, so each returned value depends on two outgoing ones."""

    support: CharacteristicBar
    returned: list[float] = field(default_factory=list)
    """Returned wave h of each step [m/s]."""
    outgoing: list[float] = field(default_factory=list)
    """Outgoing wave g of each step [m/s]."""
    sources: list[Source] = field(default_factory=list)
    """Source of the returned wave of each step."""
    _stored: list[int] = field(default_factory=list)

    def arriving(self, elapsed: float) -> float:
        """Returned wave [m/s] of the next step, which ends `elapsed` [s] after the start."""
        source, wave = Source(-1, -1, 0.0), 0.0
        late = elapsed - self.support.round_trip
        if late > 0.0:
            place = late / self.support.round_trip * BAR_HISTORY
            k = int(place)
            source = Source(self._stored[k], self._stored[k + 1], place - k)
            wave = self.outgoing[source.early]
            wave += source.share * (self.outgoing[source.following] - wave)
        self.sources.append(source)
        self.returned.append(wave)
        return wave

    def record_outgoing(self, wave: float, elapsed: float) -> None:
        """Store the outgoing wave of a step [m/s]."""
        self.outgoing.append(wave)
        while len(self._stored) * self.support.round_trip / BAR_HISTORY <= elapsed:
            self._stored.append(len(self.outgoing) - 1)

    def check_segments(self, n_steps: int) -> None:
        """Raise ValueError if a wave returns within the segment in which it left; a segment has `n_steps`
        steps."""
        last_step = np.array([source.following for source in self.sources], dtype=np.int64)
        inside = np.flatnonzero(
            (last_step >= 0) & (last_step >= np.arange(len(last_step)) // n_steps * n_steps)
        )
        if inside.size:
            raise ValueError(
                f"the wave returns from the bar within a segment of {n_steps} steps (round trip"
                f" {self.support.round_trip:.6g} s); use a smaller checkpoint_every"
            )

    def add_cotangent(self, first: int, cotangent: FloatArray, outgoing: FloatArray) -> None:
        """Add the contribution of the returned wave in the steps from `first` on to the cotangent of the
        outgoing wave."""
        for k, by_returned in enumerate(cotangent, start=first):
            early, next_one, share = self.sources[k]
            if early >= 0:
                outgoing[early] += (1.0 - share) * by_returned
                outgoing[next_one] += share * by_returned


@dataclass(frozen=True)
class ForwardRun:
    """A finished forward run."""

    steps: StepSequence
    """Steps of the run."""
    histories: Histories
    """Recorded histories, without leading axes."""
    checkpoints: list[dict[str, NDArray[Any]]]
    """The state at the beginning of every segment."""
    wave: ReturnedWave
    """Outgoing and returned wave in a moving support."""

    @property
    def memory(self) -> int:
        """Memory of the checkpoints [B]."""
        return sum(values.nbytes for state in self.checkpoints for values in state.values())


def run_forward(plan: PhasePlan, sampling: Sampling, steps: StepSequence | None = None) -> ForwardRun:
    """Run forward in segments; the plan's window determines their number of steps.

    ``steps``: the steps to take; default: measured as by `explicit.run`.
    """
    window, model = plan.window, plan.model
    earliest = min(float(sampling.force_times[0]), float(sampling.surface_times[0]))
    if earliest < model.start:
        raise ValueError(f"requested time {earliest:.9g} s is before the model's start {model.start:.9g} s")
    motion = model.motions[int(plan.samples.motion[0])]
    path = None if steps is None else motion(steps.time + steps.dt)
    at_rest = {name: np.zeros_like(window.view[name][0]) for name in (*FIELDS, "touched")}
    at_rest["touched"][model.mesh.lower_face] = 1
    at_rest["touched"][model.mesh.upper_face] = 1
    window.begin(at_rest)
    window.view["worst"][0] = 0.0
    wave = ReturnedWave(plan.support)
    outline = _Outline(plan, sampling.surface_times)
    checkpoints = [window.state(0)]
    lengths: list[float] = []
    pushes: list[FloatArray] = []
    time, dt, before, first, next_dt = model.start, 0.0, 0.0, 0.0, 0.0
    start, k = -np.inf, 0
    while start < sampling.force_times[-1] or not outline.complete:
        if k == window.n_steps:
            pushes.append(window.view["push"].copy())
            checkpoints.append(window.state(k))
            window.begin(checkpoints[-1])
            k = 0
        step = len(lengths)
        if steps is None and step == 0:
            plan.sweep_elements(k, 1)
            next_dt = first = _measured_step(plan)
            _check(plan, window.view["worst"][0], next_dt, first, step, time)
            window.view["worst"][0] = 0.0
        measured = steps is None and (step + 1) % plan.stepping.measure_every == 0  # for the step after
        plan.sweep_elements(k, int(measured))
        if steps is not None:
            if step == len(steps):
                raise ValueError(f"the {len(steps)} recorded steps end at {time:.6g} s, before the last time")
            dt = float(steps.dt[step])
        elif step % plan.stepping.measure_every == 0:
            dt = next_dt
        _check(plan, window.view["worst"][0], dt, first, step, time)
        if measured:
            next_dt = _measured_step(plan)
            window.view["worst"][0] = 0.0
        flyer_next = float(motion(np.array([time + dt]))[0]) if path is None else path[step]
        window.view["timing"][k] = dt, 0.5 * (dt + before), flyer_next
        elapsed = time + dt - model.start
        if plan.moving:
            window.view["returned"][k] = wave.arriving(elapsed)
        plan.sweep_nodes(k)
        if plan.moving:
            wave.record_outgoing(float(window.view["outgoing"][k]), elapsed)
        outline.record(k + 1, time + dt)
        lengths.append(dt)
        start, time, before, k = time, time + dt, dt, k + 1
    pushes.append(window.view["push"][:k].copy())
    sequence = StepSequence(model.start, np.array(lengths))
    push = np.concatenate(pushes) / sequence.interval[:, None]
    _check_finite(push, sequence)
    sampled = ForceSampling(sequence, sampling.force_times)
    flyer, transmission = -push[:, 0], push[:, 1]  # compression-positive
    histories = Histories(
        force_flyer=sampled.force(flyer),
        force_transmission=sampled.force(transmission),
        impulse_flyer=sampled.impulse(flyer),
        impulse_transmission=sampled.impulse(transmission),
        surface_r=outline.r,
        surface_y=outline.y,
    )
    return ForwardRun(sequence, histories, checkpoints, wave)


class _Outline:
    """The side surface at the requested times, extrapolated backward from the end of the step that contains
    each time."""

    def __init__(self, plan: PhasePlan, times: FloatArray) -> None:
        mesh = plan.model.mesh
        self._view, self._side, self._times = plan.window.view, mesh.side, times
        self._reference = mesh.nodes[mesh.side] - [0.0, mesh.nodes[:, 1].min()]
        self._done = 0
        self.r = np.empty((len(times), len(mesh.side)))
        self.y = np.empty_like(self.r)

    @property
    def complete(self) -> bool:
        """True once every requested time has passed."""
        return self._done == len(self._times)

    def record(self, k: int, end: float) -> None:
        """Record the requested times before `end`, the time of row k."""
        view, side = self._view, self._side
        while not self.complete and self._times[self._done] <= end:
            late = end - self._times[self._done]
            self.r[self._done] = self._reference[:, 0] + view["u_r"][k, side] - late * view["v_r"][k, side]
            self.y[self._done] = self._reference[:, 1] + view["u_y"][k, side] - late * view["v_y"][k, side]
            self._done += 1


def _measured_step(plan: PhasePlan) -> float:
    omega_squared = float(plan.window.view["worst"][0])
    if not omega_squared > 0.0:
        return inf  # NaN leaves the largest bound at zero
    return min(plan.stepping.safety * 2.0 / sqrt(omega_squared), plan.stepping.largest_step)


def _check(plan: PhasePlan, worst: float, dt: float, first: float, step: int, time: float) -> None:
    outcome = Outcome.COMPLETED
    if worst >= 0.5 * INVERTED:
        outcome = Outcome.INVERTED
    elif not (np.isfinite(worst) and np.isfinite(dt)):
        outcome = Outcome.DIVERGED
    elif dt < plan.stepping.floor * first:
        outcome = Outcome.STEP_COLLAPSED
    elif step >= plan.stepping.max_steps:
        outcome = Outcome.STEP_LIMIT
    if not outcome.ok:
        raise ValueError(f"the run ended at {time:.6g} s: {outcome.cause}. Cure: {outcome.cure}")


def _check_finite(push: FloatArray, steps: StepSequence) -> None:
    infinite = np.flatnonzero(~np.isfinite(push).all(axis=1))
    if infinite.size:
        outcome = Outcome.DIVERGED
        raise ValueError(
            f"the run ended at {steps.time[infinite[0]]:.6g} s: {outcome.cause}. Cure: {outcome.cure}"
        )


def reverse(
    plan: PhasePlan, sampling: Sampling, forward: ForwardRun, cotangent: Histories
) -> dict[str, FloatArray]:
    """Cotangents of the kernels' inputs from the cotangent of the histories (reverse pass).

    ``plan``: the simulation, with a window as long as a segment. ``sampling``: the sampling of the forward
    run. ``forward``: the forward run of this plan. ``cotangent``: derivative of the objective by every entry
    of the histories, without leading axes. Returns: derivatives by "solids" (a record per modulus and
    viscosity), "row" (the law's constants) and "friction". Raises ValueError if the wave in the support
    returns within a segment.
    """
    window, steps = plan.window, forward.steps
    gradient, view = window.gradient, window.view
    forward.wave.check_segments(window.n_steps)
    push = _push_cotangent(sampling, forward, cotangent)
    reached = np.searchsorted(steps.time + steps.dt, sampling.surface_times, side="left")
    late = (steps.time + steps.dt)[reached] - sampling.surface_times
    motion = plan.model.motions[int(plan.samples.motion[0])]
    flyer_next = motion(steps.time + steps.dt)
    for name in ("solids", "row", "friction"):
        window.arrays[name].grad.zero_()
    window.clear_gradients()
    carried = {name: np.zeros_like(view[name][0]) for name in FIELDS}
    outgoing = np.zeros(len(steps))
    side = plan.model.mesh.side
    tape, n_taped = None, 0
    for segment in reversed(range(len(forward.checkpoints))):
        first = segment * window.n_steps
        n = min(window.n_steps, len(steps) - first)
        now = slice(first, first + n)
        window.begin(forward.checkpoints[segment])
        view["timing"][:n] = np.column_stack([steps.dt[now], steps.interval[now], flyer_next[now]])
        if plan.moving:
            view["returned"][:n] = forward.wave.returned[now]
        if tape is None or n != n_taped:
            tape, n_taped = plan.taped(n), n
        else:  # the same launches on the same rows with other values
            for k in range(n):
                plan.sweep_elements(k)
                plan.sweep_nodes(k)
        window.clear_gradients()
        for name in FIELDS:
            gradient[name][n] = carried[name]
        gradient["push"][:n] = push[now]
        gradient["outgoing"][:n] = outgoing[now]  # it returns in later segments, which are finished
        for i in np.flatnonzero((reached >= first) & (reached < first + n)):
            k = reached[i] - first + 1  # a surface is read from the row after its step
            gradient["u_r"][k, side] += cotangent.surface_r[i]
            gradient["u_y"][k, side] += cotangent.surface_y[i]
            gradient["v_r"][k, side] -= late[i] * cotangent.surface_r[i]
            gradient["v_y"][k, side] -= late[i] * cotangent.surface_y[i]
        tape.backward()
        carried = {name: gradient[name][0].copy() for name in FIELDS}
        if plan.moving:
            forward.wave.add_cotangent(first, gradient["returned"][:n], outgoing)
    return {name: window.arrays[name].grad.numpy().copy() for name in ("solids", "row", "friction")}


def _push_cotangent(sampling: Sampling, forward: ForwardRun, cotangent: Histories) -> FloatArray:
    """Cotangent of the platens' impulses on the nodes in each step [.../(N s)], shape [n_steps, 2]."""
    sampled = ForceSampling(forward.steps, sampling.force_times)
    flyer = sampled.transposed(cotangent.force_flyer, cotangent.impulse_flyer)
    transmission = sampled.transposed(cotangent.force_transmission, cotangent.impulse_transmission)
    return np.column_stack([-flyer, transmission]) / forward.steps.interval[:, None]

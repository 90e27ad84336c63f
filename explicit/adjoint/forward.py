"""The forward run in phases: measures its steps or repeats recorded ones, and leaves checkpoints."""

from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explicit.adjoint.plan import FIELDS, PhasePlan
from explicit.adjoint.returned_wave import ReturnedWave
from explicit.adjoint.steps import ForceSampling, StepSequence
from explicit.arrays import FloatArray
from explicit.elements.base import INVERTED
from explicit.histories import Histories
from explicit.model import Sampling
from explicit.outcome import Outcome


@dataclass(frozen=True)
class ForwardRun:
    """A finished forward run."""

    steps: StepSequence
    """The steps it took."""
    histories: Histories
    """What was recorded, without leading axes."""
    checkpoints: list[dict[str, NDArray[Any]]]
    """The state at the beginning of every segment."""
    wave: ReturnedWave
    """What left and what returned in a moving support."""

    @property
    def memory(self) -> int:
        """Memory of the checkpoints [B]."""
        return sum(values.nbytes for state in self.checkpoints for values in state.values())


def run_forward(plan: PhasePlan, sampling: Sampling, steps: StepSequence | None = None) -> ForwardRun:
    """Run forward, segment by segment of as many steps as the plan's window holds.

    Parameters
    ----------
    plan : PhasePlan
        The simulation.
    sampling : Sampling
        What to record.
    steps : StepSequence, optional
        The steps to take; default: measured as by `explicit.run`.

    Raises
    ------
    ValueError
        If a requested time is before the model's start, or the run does not reach its end; the message has
        the cause and the cure.
    """
    window, model = plan.window, plan.model
    asked = min(float(sampling.force_times[0]), float(sampling.surface_times[0]))
    if asked < model.start:
        raise ValueError(f"requested time {asked:.9g} s is before the model's start {model.start:.9g} s")
    motion = model.motions[int(plan.samples.motion[0])]
    path = None if steps is None else motion(steps.time + steps.dt)
    rest = {name: np.zeros_like(window.view[name][0]) for name in (*FIELDS, "touched")}
    rest["touched"][model.mesh.lower_face] = 1
    rest["touched"][model.mesh.upper_face] = 1
    window.begin(rest)
    window.view["worst"][0] = 0.0
    wave = ReturnedWave(plan.support)
    outline = _Outline(plan, sampling.surface_times)
    checkpoints = [window.state(0)]
    taken: list[float] = []
    pushes: list[FloatArray] = []
    time, dt, before, first, next_dt = model.start, 0.0, 0.0, 0.0, 0.0
    begun, k = -np.inf, 0
    while begun < sampling.force_times[-1] or not outline.complete:
        if k == window.n_steps:
            pushes.append(window.view["push"].copy())
            checkpoints.append(window.state(k))
            window.begin(checkpoints[-1])
            k = 0
        step = len(taken)
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
        taken.append(dt)
        begun, time, before, k = time, time + dt, dt, k + 1
    pushes.append(window.view["push"][:k].copy())
    sequence = StepSequence(model.start, np.array(taken))
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
    """The side surface at the requested times, carried back from the end of the step that contains each."""

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
        """Record what lies before `end`, the time of row k."""
        view, side = self._view, self._side
        while not self.complete and self._times[self._done] <= end:
            late = end - self._times[self._done]
            self.r[self._done] = self._reference[:, 0] + view["u_r"][k, side] - late * view["v_r"][k, side]
            self.y[self._done] = self._reference[:, 1] + view["u_y"][k, side] - late * view["v_y"][k, side]
            self._done += 1


def _measured_step(plan: PhasePlan) -> float:
    omega_squared = float(plan.window.view["worst"][0])
    if not omega_squared > 0.0:
        return inf  # what is no number leaves the largest bound at zero
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
    lost = np.flatnonzero(~np.isfinite(push).all(axis=1))
    if lost.size:
        outcome = Outcome.DIVERGED
        raise ValueError(
            f"the run ended at {steps.time[lost[0]]:.6g} s: {outcome.cause}. Cure: {outcome.cure}"
        )

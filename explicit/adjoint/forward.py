"""The forward run in phases: measures its steps or repeats recorded ones, and leaves checkpoints."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explicit.adjoint.plan import PhasePlan
from explicit.adjoint.steps import ForceSampling, StepSequence
from explicit.elements.base import INVERTED
from explicit.histories import Histories
from explicit.model import Sampling
from explicit.outcome import Outcome

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ForwardRun:
    """A finished forward run."""

    steps: StepSequence
    """The steps it took."""
    histories: Histories
    """What was recorded, without leading axes."""
    checkpoints: list[dict[str, NDArray[Any]]]
    """The state at the beginning of every segment."""

    @property
    def memory(self) -> int:
        """Memory of the checkpoints [B]."""
        return sum(values.nbytes for state in self.checkpoints for values in state.values())


def march(plan: PhasePlan, sampling: Sampling, steps: StepSequence | None = None) -> ForwardRun:
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
    motion, side = model.motions[int(plan.samples.motion[0])], model.mesh.side
    rest = {name: np.zeros_like(window.view[name][0]) for name in ("u_r", "u_y", "v_r", "v_y", "touched")}
    rest["touched"][model.mesh.lower_face] = 1
    rest["touched"][model.mesh.upper_face] = 1
    window.begin(rest)
    window.view["worst"][0] = 0.0
    reference = model.mesh.nodes[side] - [0.0, model.mesh.nodes[:, 1].min()]
    surface_r = np.empty((len(sampling.surface_times), len(side)))
    surface_y = np.empty_like(surface_r)
    checkpoints = [window.state(0)]
    taken: list[float] = []
    pushes: list[FloatArray] = []
    time, dt, before, first = model.start, 0.0, 0.0, 0.0
    begun, done, k = -np.inf, 0, 0
    while begun < sampling.force_times[-1] or done < len(sampling.surface_times):
        if k == window.n_steps:
            pushes.append(window.view["push"].copy())
            checkpoints.append(window.state(k))
            window.begin(checkpoints[-1])
            k = 0
        step = len(taken)
        measured = steps is None and step % plan.stepping.measure_every == 0
        plan.sweep_elements(k, int(measured))
        if steps is not None:
            if step == len(steps):
                raise ValueError(f"the {len(steps)} recorded steps end at {time:.6g} s, before the last time")
            dt = float(steps.dt[step])
        elif measured:
            dt = _measured_step(plan)
            first = first or dt
        _check(plan, window.view["worst"][0], dt, first, step, time)
        if measured:
            window.view["worst"][0] = 0.0
        flyer_next = float(motion(np.array([time + dt]))[0])
        window.view["clock"][k] = dt, 0.5 * (dt + before), flyer_next
        plan.sweep_nodes(k)
        end = time + dt
        while done < len(sampling.surface_times) and sampling.surface_times[done] <= end:
            late = end - sampling.surface_times[done]
            view = window.view
            surface_r[done] = reference[:, 0] + view["u_r"][k + 1, side] - late * view["v_r"][k + 1, side]
            surface_y[done] = reference[:, 1] + view["u_y"][k + 1, side] - late * view["v_y"][k + 1, side]
            done += 1
        taken.append(dt)
        begun, time, before, k = time, end, dt, k + 1
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
        surface_r=surface_r,
        surface_y=surface_y,
    )
    return ForwardRun(sequence, histories, checkpoints)


def _measured_step(plan: PhasePlan) -> float:
    omega_squared = float(plan.window.view["worst"][0])
    return min(plan.stepping.safety * 2.0 / np.sqrt(omega_squared), plan.stepping.largest_step)


def _check(plan: PhasePlan, worst: float, dt: float, first: float, step: int, time: float) -> None:
    outcome = Outcome.COMPLETED
    if worst >= 0.5 * INVERTED:
        outcome = Outcome.INVERTED
    elif not np.isfinite(worst):
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

"""The reverse pass: every segment is run again from its checkpoint onto a tape, and the tape backward."""

import numpy as np

from explicit.adjoint.forward import ForwardRun
from explicit.adjoint.plan import FIELDS, PhasePlan
from explicit.adjoint.steps import ForceSampling
from explicit.arrays import FloatArray
from explicit.histories import Histories
from explicit.model import Sampling


def reverse(
    plan: PhasePlan, sampling: Sampling, forward: ForwardRun, cotangent: Histories
) -> dict[str, FloatArray]:
    """Carry the cotangent of the histories back to what the kernels read.

    Parameters
    ----------
    plan : PhasePlan
        The simulation, in a window as long as a segment.
    sampling : Sampling
        What was recorded.
    forward : ForwardRun
        The forward run of this plan.
    cotangent : Histories
        Derivative of the objective by every entry of the histories, without leading axes.

    Returns
    -------
    dict
        Derivatives by "solids" (a record per modulus and viscosity), "row" (the law's constants) and
        "friction".

    Raises
    ------
    ValueError
        If the wave in the support returns within a segment.
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
        else:  # the same launches on the same rows: only what is in them is new
            for k in range(n):
                plan.sweep_elements(k)
                plan.sweep_nodes(k)
        window.clear_gradients()
        for name in FIELDS:
            gradient[name][n] = carried[name]
        gradient["push"][:n] = push[now]
        gradient["outgoing"][:n] = outgoing[now]  # it returns in later segments, which are done
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

"""A batch with one failure of every kind between sound runs, and what its failures are checked against."""

from dataclasses import dataclass, replace

import numpy as np
from batch import same_bits
from failure_elements import kinetic_energy, rectangles, state, step_bound
from numpy.typing import NDArray
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, speed_after_rise

from explicit import Model, Outcome, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import MarlowLaw, bulk_modulus, neo_hookean
from explicit.time_loop.element_sweeps import CHECK_EVERY

FloatArray = NDArray[np.float64]

END = 1.5e-3
TIMES = np.linspace(0.0, END, 301)[1:]
POISSON = 0.495
MU = shear_modulus(POISSON)
SHORT = 1.2
"""Where the data of the short curve end [-]."""
STEPPING = Stepping(floor=0.05, max_steps=2000)
JUST_BEFORE = 1e-9
"""Two positions so far apart give the velocity of a step [s]."""
EXPECTED = (
    Outcome.COMPLETED,
    Outcome.INVERTED,
    Outcome.COMPLETED,
    Outcome.STEP_COLLAPSED,
    Outcome.STEP_LIMIT,
    Outcome.TABLE_EXCEEDED,
    Outcome.DIVERGED,
    Outcome.COMPLETED,
)
WHY = (
    "sound",
    "flyer at 20 m/s",
    "sound",
    "flyer at 4.5 m/s goes through the other platen",
    "400 times as stiff",
    f"curve ends at s = {SHORT}",
    "curve softens to less than nothing",
    "sound",
)
"""What is special about each row."""


def model() -> Model:
    """Bonded, 8 x 11, three curves and four flyers to choose from; the data's end is the end."""
    softening = MU * (1.0 - 1.4 * np.linspace(0.0, 50.0, 5))
    laws = (
        neo_hookean(MU, last=50.0),
        neo_hookean(MU, last=SHORT),
        MarlowLaw(last=50.0, quotient=softening, slope=np.full(5, -1.4 * MU)),
    )
    motions = tuple(speed_after_rise(speed, 50e-6, end=END) for speed in (2.6, 20.0, 4.5, 1.8))
    mesh = cylinder(RADIUS, LENGTH, n_radial=8, n_axial=11)
    return Model(mesh, DENSITY, laws, motions, past_data="stop")


FACTORS = np.array([1.0, 1.0, 1.1, 1.0, 400.0, 1.0, 1.0, 0.9])
MATERIALS = np.array([0, 0, 0, 0, 0, 1, 2, 0])
MOTIONS = np.array([0, 1, 0, 2, 0, 0, 0, 3])


def samples(rows: list[int]) -> Samples:
    """Some rows of the batch."""
    return Samples.of(
        poisson=POISSON, stiffness_factor=FACTORS[rows], material=MATERIALS[rows], motion=MOTIONS[rows]
    )


@dataclass(frozen=True)
class Witness:
    """One failure, looked at again from recorded node positions."""

    named: int
    """The element that the solver named."""
    found: int
    """The element with the extreme value of NumPy's."""
    value: float
    """What ended the run, at its end: the smallest J, the largest s, the stable step over the first one, or
    the kinetic energy over the platens' work [-]."""
    before: float
    """The same when it was last looked at and found in order."""
    same_history: bool
    """Whether everything before the end has the bits of a run that was asked to end there."""


def alone(i: int, sampling: Sampling, **changes: float) -> Response:
    """Row i in a batch of its own."""
    return run(model(), samples([i]), sampling, stepping=replace(STEPPING, **changes))


def moment(i: int, steps: int) -> float:
    """The time row i has reached after some steps [s]."""
    return float(alone(i, Sampling(TIMES, TIMES), max_steps=steps).end_times[0])


def witness(batch: Response, i: int) -> Witness:
    """Recompute from node positions which element failed, and whether the history is the right one."""
    outcome, mesh = batch.outcomes[i], model().mesh
    elements = rectangles(mesh, DENSITY)
    # The end of the data is looked for at every step, the rest at every eighth.
    back = 1 if outcome is Outcome.TABLE_EXCEEDED else CHECK_EVERY
    values, found = [], -1
    for time in (moment(i, int(batch.steps[i]) - back), float(batch.end_times[i])):
        pair = Sampling(TIMES[:1], np.array([time - JUST_BEFORE, time]), all_nodes=True)
        single = alone(i, pair)
        assert single.nodes is not None
        F = state(elements, single.nodes[0, 1] - mesh.nodes)
        velocity = (single.nodes[0, 1] - single.nodes[0, 0]) / JUST_BEFORE
        if outcome is Outcome.INVERTED:
            found, value = int(np.argmin(F.upright)), float(F.upright.min())
        elif outcome is Outcome.TABLE_EXCEEDED:
            found, value = int(np.nanargmax(F.s)), float(np.nanmax(F.s))
        elif outcome is Outcome.DIVERGED:
            found = int(np.argmax((velocity**2).sum(axis=1)[elements.quads].sum(axis=1)))
            value = kinetic_energy(elements, velocity) / float(single.energy.external[0].max())
        else:
            mu = MU * FACTORS[i]
            numbers = {"shear": mu, "bulk": float(bulk_modulus(mu, POISSON)), "hourglass": model().hourglass}
            first = step_bound(mesh, elements, state(elements, 0.0 * mesh.nodes), **numbers).max()
            share = np.sqrt(first / step_bound(mesh, elements, F, **numbers))
            found, value = int(np.argmin(share)), float(share.min())
        values.append(value)
    return Witness(
        named=int(batch.failed_elements[i]),
        found=found,
        before=values[0],
        value=values[1],
        same_history=_same_history(batch, i),
    )


def _same_history(batch: Response, i: int) -> bool:
    """Whether row i up to its end has the bits of a run that was asked to end there, and nothing after it."""
    n_force = int(np.isfinite(batch.force_flyer[i]).sum())
    n_surface = int(np.isfinite(batch.surface_r[i]).all(axis=1).sum())
    asked = alone(i, Sampling(TIMES[:n_force], TIMES[:n_surface]))
    histories = [
        (getattr(batch, name)[i], getattr(asked, name)[0])
        for name in ("force_flyer", "force_transmission", "impulse_flyer", "impulse_transmission")
    ]
    histories += [(getattr(batch, name)[i], getattr(asked, name)[0]) for name in ("surface_r", "surface_y")]
    histories += [(values[i], getattr(asked.energy, name)[0]) for name, values in vars(batch.energy).items()]
    same = all(np.array_equal(whole[: len(part)], part) for whole, part in histories)
    # The shorter run may see at its own end what went wrong in its last steps.
    told = asked.outcomes[0] in (Outcome.COMPLETED, batch.outcomes[i])
    return same and told and all(np.isnan(h[len(p) :]).all() for h, p in histories)


def motion_over_work(i: int, **changes: float) -> tuple[Response, FloatArray]:
    """Row i alone, and its kinetic energy over the platens' largest work so far at every 5 us to its end [-].

    Velocities are those of the step that contains the time, from two node positions.
    """
    pairs = np.stack([TIMES - JUST_BEFORE, TIMES], axis=1).ravel()
    single = alone(i, Sampling(TIMES, pairs, all_nodes=True), **changes)
    assert single.nodes is not None
    elements = rectangles(model().mesh, DENSITY)
    nodes = single.nodes[0].reshape(len(TIMES), 2, -1, 2)
    known = np.isfinite(nodes).all(axis=(1, 2, 3))
    kinetic = np.array([kinetic_energy(elements, (b - a) / JUST_BEFORE) for a, b in nodes[known]])
    return single, kinetic / np.maximum.accumulate(single.energy.external[0, 1::2][known])


def bits_of_neighbours(batch: Response) -> dict[str, bool]:
    """Whether every row has the bits it has alone, and the sound ones those of a batch of their own."""
    sampling = Sampling(TIMES, TIMES)
    sound = [i for i, outcome in enumerate(EXPECTED) if outcome.ok]
    without = run(model(), samples(sound), sampling, stepping=STEPPING)
    return {
        "alone": all(same_bits(batch, i, alone(i, sampling), 0) for i in range(len(EXPECTED))),
        "without": all(same_bits(batch, i, without, k) for k, i in enumerate(sound)),
    }

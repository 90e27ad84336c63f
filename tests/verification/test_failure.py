"""Failed simulations: every kind of failure in one batch, its time, its element, and its neighbours."""

from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from scene import DENSITY, LENGTH, RADIUS, FloatArray, shear_modulus, speed_after_rise
from test_batch import same_bits

from explicit import Mesh, Model, Outcome, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import MarlowLaw, bulk_modulus, neo_hookean
from explicit.mesh import element_geometry
from explicit.time_loop.element_sweeps import CHECK_EVERY, MOTION_LIMIT

Rectangles = Witness = Result = SimpleNamespace


def rectangles(mesh: Mesh, density: float) -> Rectangles:
    """Integrate the elements of a mesh whose corners run lower left, lower right, upper right, upper left."""
    R, Y = mesh.nodes[mesh.quads, 0], mesh.nodes[mesh.quads, 1]
    a, b, height = R[:, 0], R[:, 1], Y[:, 3] - Y[:, 0]
    mean, width = 0.5 * (a + b), b - a
    left, right = (2.0 * a + b) / (6.0 * mean), (a + 2.0 * b) / (6.0 * mean)
    across = 0.5 / width[:, None] * np.array([-1.0, 1.0, 1.0, -1.0])
    along = np.stack([-left, -right, right, left], axis=1) / height[:, None]
    volume = 2.0 * np.pi * mean * width * height
    share = 0.5 * np.stack([left, right, right, left], axis=1)
    return Rectangles(
        quads=mesh.quads,  # corner nodes, shape [n_elements, 4]
        volume=volume,  # volume over a full turn [m^3], shape [n_elements]
        gradient_r=across,  # mean dN/dR of each corner [1/m], shape [n_elements, 4]
        gradient_y=along,  # mean dN/dY of each corner [1/m], shape [n_elements, 4]
        # mean N / R of each corner [1/m], shape [n_elements, 4]
        hoop=np.repeat(0.25 / mean[:, None], 4, axis=1),
        # each corner's share of the mass [kg], shape [n_elements, 4]
        corner_mass=density * volume[:, None] * share,
    )


@dataclass(frozen=True)
class State:
    """The deformation gradient of every element: F = [[f11, h12], [h21, f22]] and f33, shape [n_elements]."""

    f11: FloatArray
    h12: FloatArray
    h21: FloatArray
    f22: FloatArray
    f33: FloatArray

    @property
    def plane(self) -> FloatArray:
        """Planar part of det F [-]."""
        return self.f11 * self.f22 - self.h12 * self.h21

    @property
    def J(self) -> FloatArray:
        """det F [-]."""
        return self.plane * self.f33

    @property
    def upright(self) -> FloatArray:
        """The smaller of det F and its planar part [-]: an element above 0 has not turned inside out."""
        return np.minimum(self.J, self.plane)

    @property
    def s(self) -> FloatArray:
        """sqrt(I1_bar - 3) [-]; NaN where J <= 0."""
        squared = self.f11**2 + self.h12**2 + self.h21**2 + self.f22**2 + self.f33**2
        J = np.where(self.J > 0.0, self.J, np.nan)
        return np.sqrt(np.maximum(squared * J ** (-2.0 / 3.0) - 3.0, 0.0))


def state(elements: Rectangles, displacement: FloatArray) -> State:
    """The deformation of every element from nodal displacements (u_r, u_y) [m], shape [n_nodes, 2]."""
    u_r, u_y = displacement[elements.quads, 0], displacement[elements.quads, 1]
    return State(
        f11=1.0 + (elements.gradient_r * u_r).sum(axis=1),
        h12=(elements.gradient_y * u_r).sum(axis=1),
        h21=(elements.gradient_r * u_y).sum(axis=1),
        f22=1.0 + (elements.gradient_y * u_y).sum(axis=1),
        f33=1.0 + (elements.hoop * u_r).sum(axis=1),
    )


def kinetic_energy(elements: Rectangles, velocity: FloatArray) -> float:
    """Kinetic energy of the lumped masses [J]."""
    squared = (velocity**2).sum(axis=1)[elements.quads]
    return float(0.5 * (elements.corner_mass * squared).sum())


def step_bound(
    mesh: Mesh, elements: Rectangles, F: State, *, shear: float, bulk: float, hourglass: float
) -> FloatArray:
    """omega^2 of every element of an undamped neo-Hookean solid [1/s^2], as docs/theory/solver.md has it.

    The hourglass constants are those of `explicit.mesh`.
    """
    b_r = (F.f22[:, None] * elements.gradient_r - F.h21[:, None] * elements.gradient_y) / F.plane[:, None]
    b_y = (F.f11[:, None] * elements.gradient_y - F.h12[:, None] * elements.gradient_r) / F.plane[:, None]
    c = elements.hoop / F.f33[:, None]
    w_y = 1.0 / elements.corner_mass
    w_r = np.where(mesh.on_axis[elements.quads], 0.0, w_y)
    rank_one = (w_r * (b_r + c) ** 2 + w_y * b_y**2).sum(axis=1)
    gradient = b_r**2 + b_y**2
    trace = (w_r * (gradient + c**2) + w_y * gradient).sum(axis=1)
    iso = F.J ** (-2.0 / 3.0)
    rr, yy = iso * (F.f11**2 + F.h12**2), iso * (F.f22**2 + F.h21**2)
    ry, tt = iso * (F.f11 * F.h21 + F.h12 * F.f22), iso * F.f33**2
    largest = np.maximum(np.maximum(rr, yy) + np.abs(ry), tt)
    volumetric = bulk * F.J * np.maximum(2.0 * F.J - 1.0, 0.5) * rank_one
    g = element_geometry(mesh)
    control = (g.gamma**2 * (w_r * g.hourglass_r[:, None] + w_y * g.hourglass_y[:, None])).sum(axis=1)
    stiff = elements.volume * (volumetric + 2.0 * shear * largest * trace)
    return np.asarray(stiff + hourglass * shear * control)


END = 1.5e-3
TIMES = np.linspace(0.0, END, 301)[1:]
POISSON = 0.495
MU = shear_modulus(POISSON)
SHORT = 1.2  # where the data of the short curve end [-]
STEPPING = Stepping(floor=0.05, max_steps=2000)
JUST_BEFORE = 1e-9  # two positions so far apart give the velocity of a step [s]
EXPECTED = (
    Outcome.COMPLETED, Outcome.INVERTED, Outcome.COMPLETED, Outcome.STEP_COLLAPSED, Outcome.STEP_LIMIT,
    Outcome.TABLE_EXCEEDED, Outcome.DIVERGED, Outcome.COMPLETED,
)  # fmt: skip
WHY = (
    "sound", "flyer at 20 m/s", "sound", "flyer at 4.5 m/s goes through the other platen",
    "400 times as stiff", f"curve ends at s = {SHORT}", "curve softens to less than nothing", "sound",
)  # fmt: skip
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
        named=int(batch.failed_elements[i]),  # the element that the solver named
        found=found,  # the element with the extreme value of NumPy's
        before=values[0],  # the same when it was last looked at and found in order
        # What ended the run, at its end: the smallest J, the largest s, the stable step over the first one,
        # or the kinetic energy over the platens' work [-].
        value=values[1],
        # whether everything before the end has the bits of a run that was asked to end there
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


FAILED = [i for i, outcome in enumerate(EXPECTED) if not outcome.ok]  # rows of the batch that must fail
NEVER = 10**6  # steps between two measurements of the step that is measured only once
ONSET = 3.0
"""Force by which a diverging run may be wrong before it is ended [N]: what a force measurement resolves."""


@cache
def case() -> Result:
    """Run the batch, its rows alone, and the unstable run."""
    batch = run(model(), samples(list(range(len(EXPECTED)))), Sampling(TIMES, TIMES), stepping=STEPPING)
    unstable, runaway = motion_over_work(0, measure_every=NEVER)
    known = np.isfinite(unstable.force_flyer[0])
    astray = max(
        float(np.abs(getattr(unstable, name)[0] - getattr(batch, name)[0])[known].max())
        for name in ("force_flyer", "force_transmission")
    )
    return Result(
        batch=batch,  # eight simulations, five of which fail
        # Whether rows keep the bits they have "alone", and the sound ones those of a batch "without" the
        # others.
        bits=bits_of_neighbours(batch),
        witnesses={i: witness(batch, i) for i in FAILED},  # each failure looked at again with NumPy, by row
        unstable=unstable,  # row 0 with a step that is measured once and never again
        astray=astray,  # largest difference of its recorded forces from the sound run's [N]
        # Kinetic energy over the platens' work so far at the times of the batch, to each end [-].
        motion={
            "sound": motion_over_work(0)[1],
            "softening curve": motion_over_work(6)[1],
            "step never measured again": runaway,
        },
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    left, right = figure.subplots(1, 2)
    batch = result.batch
    for i, outcome in enumerate(batch.outcomes):
        force = batch.force_transmission[i]
        known = np.isfinite(force)
        if outcome.ok:
            left.plot(1e3 * TIMES, force, color="0.6", linewidth=0.8, label="sound" if i == 0 else None)
        else:
            name = outcome.name.lower().replace("_", " ")
            (line,) = left.plot(1e3 * TIMES[known], force[known], label=name)
            left.plot(1e3 * TIMES[known][-1], force[known][-1], "o", color=line.get_color())
    left.set_yscale("symlog", linthresh=10.0, linscale=1.0)
    ticks = [-10, 0, 10, 100, 1000]
    left.set_yticks(ticks, [str(tick) for tick in ticks])
    left.set(xlabel="time [ms]", ylabel="transmission force [N]", ylim=(-30.0, 5e4), xlim=(0.0, 1e3 * END))
    left.legend(ncols=2, loc="upper right")
    for (name, ratio), style in zip(result.motion.items(), ("-", "--", "-."), strict=True):
        right.semilogy(1e3 * TIMES[: len(ratio)], ratio, style, label=name)
    right.axhline(MOTION_LIMIT, color="0.3", linewidth=0.8, linestyle=":", label="limit")
    right.set(xlabel="time [ms]", ylabel="kinetic energy / work [-]", xlim=(0.0, 1e3 * END))
    right.set_ylim(bottom=0.008)
    right.legend(loc="lower left")


MEASURED = {
    Outcome.INVERTED: "smallest J",
    Outcome.STEP_COLLAPSED: "stable step over the first",
    Outcome.STEP_LIMIT: "stable step over the first",
    Outcome.TABLE_EXCEEDED: "largest s",
    Outcome.DIVERGED: "kinetic energy over work",
}
"""What NumPy computes of each failure."""


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    batch = result.batch
    ends = [
        [
            str(i),
            WHY[i],
            outcome.name,
            f"{1e3 * batch.end_times[i]:.4f}",
            str(batch.steps[i]),
            "" if outcome.ok else str(batch.failed_elements[i]),
            "" if outcome.ok else ", ".join(f"{1e3 * x:.2f}" for x in batch.failed_places[i]),
        ]
        for i, outcome in enumerate(batch.outcomes)
    ]
    seen = [
        [
            str(i), str(w.named), str(w.found), MEASURED[batch.outcomes[i]], f"{w.before:.4g}",
            f"{w.value:.4g}", "yes" if w.same_history else "NO",
        ]
        for i, w in result.witnesses.items()
    ]  # fmt: skip
    good = result.bits
    named = result.witnesses.values()
    same = all(result.bits.values()) and all(w.same_history for w in named)
    return locals()


EVERY = pytest.mark.parametrize("row", FAILED, ids=lambda i: EXPECTED[i].name)


def test_every_kind_of_failure_is_there() -> None:
    batch = case().batch
    assert batch.outcomes == EXPECTED
    assert set(EXPECTED) == set(Outcome)


@pytest.mark.parametrize("kind", ["alone", "without"])
def test_nobody_notices_a_neighbours_failure(kind: str) -> None:
    assert case().bits[kind]


@EVERY
def test_the_history_up_to_the_end_is_that_of_a_run_asked_to_end_there(row: int) -> None:
    assert case().witnesses[row].same_history


@EVERY
def test_every_history_is_kept_to_the_end(row: int) -> None:
    batch = case().batch
    end = batch.end_times[row]
    assert 0.0 < end < END
    for history in (batch.surface_r, batch.surface_y, batch.energy.external, batch.energy.hourglass):
        known = np.isfinite(history[row]).reshape(len(TIMES), -1).all(axis=1)
        np.testing.assert_array_equal(known, end >= TIMES)
    for history in (batch.force_flyer, batch.impulse_transmission):
        known = np.isfinite(history[row])
        assert not known[end < TIMES].any()
        # A force is known when its step is made: the last one belongs to the step before, < 6.1 us long.
        assert known[end - 6.1e-6 > TIMES].all()


@EVERY
def test_the_element_named_is_the_one(row: int) -> None:
    seen, batch = case().witnesses[row], case().batch
    assert seen.named == seen.found
    i, j = divmod(seen.named, 8)  # eight elements across
    np.testing.assert_allclose(
        batch.failed_places[row],
        [(j + 0.5) * RADIUS / 8, (i + 0.5) * LENGTH / 11],
        rtol=1e-12,  # round-off
    )


def test_a_completed_run_names_no_element() -> None:
    batch = case().batch
    sound = batch.completed
    assert (batch.failed_elements[sound] == -1).all()
    assert np.isnan(batch.failed_places[sound]).all()
    assert batch.describe(0) == f"COMPLETED at {1e6 * batch.end_times[0]:.1f} us"


def test_a_failure_is_noticed_when_it_happens() -> None:
    seen = {EXPECTED[i]: w for i, w in case().witnesses.items()}
    assert seen[Outcome.INVERTED].before > 0.0 >= seen[Outcome.INVERTED].value
    collapsed = seen[Outcome.STEP_COLLAPSED]
    assert collapsed.before >= STEPPING.floor > collapsed.value
    table = seen[Outcome.TABLE_EXCEEDED]
    assert table.before <= SHORT < table.value
    motion = seen[Outcome.DIVERGED]
    assert motion.before <= MOTION_LIMIT < motion.value


@EVERY
def test_the_sentence_names_moment_element_and_cure(row: int) -> None:
    batch = case().batch
    said, outcome = batch.describe(row), batch.outcomes[row]
    r, y = 1e3 * batch.failed_places[row]
    moment = f"{outcome.name} at {1e6 * batch.end_times[row]:.1f} us"
    assert said.startswith(
        f"{moment} in element {batch.failed_elements[row]} (R = {r:.2f} mm, Y = {y:.2f} mm): "
    )
    assert outcome.cause in said
    assert said.endswith(f"Cure: {outcome.cure}")


def test_an_unstable_step_is_stopped_before_its_forces_are_wrong() -> None:
    result = case()
    assert result.unstable.outcomes == (Outcome.DIVERGED,)
    assert result.astray < ONSET
    # It was not ended for nothing: its specimen moves with more energy than it was given.
    assert result.motion["step never measured again"][-1] > MOTION_LIMIT


def test_sound_motion_stays_far_below_the_limit() -> None:
    # One at first touch, when all work is motion yet; the step's own error is 2 % of it there.
    assert case().motion["sound"].max() < 1.05

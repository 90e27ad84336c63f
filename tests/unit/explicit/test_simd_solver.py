"""The time loop over lanes, compared with the scalar kernel, between the mappings, and for any pack."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
import warp as wp
from shared_launches import LONG, FullSeats, launch_shared

import explicit
from explicit import run
from explicit.arguments import batch_of, body_of, output_of, state_of
from explicit.device import select_device
from explicit.drivers import LARGE_MESH, packs
from explicit.materials import MarlowLaw, neo_hookean
from explicit.platens import Support
from explicit.precision import PRECISIONS
from explicit.relaxation import BergstromBoyce, PronySeries
from explicit.relaxation.base import RateDependence
from explicit.simd import PACK_BYTES, Mapping, lane_kernel, team
from explicit.simd.team import ELEMENTS_EACH, FINISHED, MOST_SEATS, SharedRun, single_thread_team
from explicit.time_loop.kernel import time_loop_kernel

RADIUS, LENGTH, END = 4.75e-3, 6.5e-3, 8e-4
N = 17  # two packs in fp64 or one in fp32, and one simulation more
CRUSHED, SPOILT = 3, 12
"""Simulations that end early: the flyer goes through the other platen; a stiffness is not a number."""
GOOD = np.delete(np.arange(N), [CRUSHED, SPOILT])
TIMES = np.linspace(0.0, END, 33)
SAMPLING = explicit.Sampling(TIMES, TIMES[::4])


@dataclass(frozen=True)
class Case:
    """What is simulated."""

    name: str
    element: str = "one_point"
    precision: str = "fp64"
    damping_kind: Any = "deviatoric"
    bar: bool = False
    moving: bool = False
    contact: str = "coulomb"
    relaxes: str = ""


CASES = [
    Case("deviatoric"),
    Case("full", damping_kind="full"),
    Case("bar", bar=True),
    Case("fp32", precision="fp32"),
    Case("fp32-full-bar", precision="fp32", damping_kind="full", bar=True),
    Case("moving", moving=True),
    Case("fbar", element="fbar"),
    Case("fbar-full-bar", element="fbar", damping_kind="full", bar=True),
    Case("release", contact="bonded_release"),
    Case("penalty", contact="penalty"),
    Case("prony", relaxes="prony"),
    Case("creep", relaxes="creep"),
    Case("fp32-fbar-creep", precision="fp32", element="fbar", relaxes="creep"),
]
BRANCHES: dict[str, tuple[RateDependence, ...]] = {
    "": (),
    "prony": (PronySeries((0.5,), (1e-4,)), PronySeries((0.3, 0.8), (5e-5, 4e-4))),
    "creep": (BergstromBoyce(0.5, 3e3), BergstromBoyce(1.5, 1e3, exponent=3.0, chain_exponent=-0.6)),
}
"""What relaxes within the window; one branch and two."""
SLOW = ("fp32-fbar-creep",)
"""A case whose kernels take long to compile and differ from others in precision and element alone."""
EVERY_WAY = ("deviatoric", "bar", "fbar", "release", "penalty", "prony", "fp32-fbar-creep")
"""Cases that threads share in every way; the others, whose loops meet at the same places, in the hardest."""
EVERY = pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[pytest.mark.slow] * (case.name in SLOW), id=case.name) for case in CASES],
)


def ramp(depth: float, late: float) -> explicit.PlatenMotion:
    """From rest to a depth, at a speed that rises over the first part of the window."""
    return explicit.PlatenMotion.sampled(
        lambda t: depth * (np.maximum(t - late, 0.0) / END) ** 2,
        lambda t: 2.0 * depth * np.maximum(t - late, 0.0) / END**2, start=0.0, end=END, n_knots=65,
    )  # fmt: skip


def support_of(case: Case) -> Support:
    if case.moving:
        return explicit.MovingSupport(tuple(ramp(-0.01 * LENGTH * i / N, 0.0) for i in range(N)))
    # The wave comes back four times within the window; the impedance is near the specimen's own.
    return explicit.CharacteristicBar(8.0, END / 5) if case.bar else explicit.CharacteristicBar(1e300, 1e300)


def model_of(case: Case) -> explicit.Model:
    # A stiffening curve that ends at s = 0.5, so that some of the specimen is strained past its data.
    soft = neo_hookean(27e3, last=0.5)
    stiff = MarlowLaw(last=1.0, quotient=np.linspace(20e3, 60e3, 5), slope=np.full(5, 40e3))
    return explicit.Model(
        # 40 elements and 35 inner nodes: two groups of each
        explicit.cylinder(RADIUS, LENGTH, n_radial=5, n_axial=8),
        870.0,
        (soft, stiff),
        (ramp(0.35 * LENGTH, 0.0), ramp(0.2 * LENGTH, 1e-4), ramp(5.0 * LENGTH, 0.0)),
        faces=case.contact,
        side=case.contact,
        damping_kind=case.damping_kind,
        element=case.element,
        support=support_of(case),
        relaxation=BRANCHES[case.relaxes],
    )


def samples_of(case: Case) -> explicit.Samples:
    rng = np.random.default_rng(5)
    motion = rng.integers(0, 2, N)
    motion[CRUSHED] = 2
    return explicit.Samples.of(
        stiffness_factor=rng.uniform(0.6, 1.6, N), poisson=rng.uniform(0.48, 0.495, N),
        damping=rng.choice([0.0, 1e-5, 4e-5], N), friction=rng.choice([0.0, 0.05, 0.3, 5.0], N),
        mass_damping=rng.choice([0.0, 100.0], N), material=rng.integers(0, 2, N), motion=motion,
        release_stress=np.resize([0.0, 300.0, 3e3, np.inf], N),
        contact_stiffness=np.resize([1e10, 1e12, 1e14], N),
        relaxation=np.arange(N) % 2 if case.relaxes else 0,
    )  # fmt: skip


def launch(
    case: Case,
    mapping: Mapping | None,
    n: int = N,
    shift: int = 0,
    spoil: bool = True,
    threads: int = 1,
    patience: int = 0,
) -> Any:
    """The first n simulations; in packs that begin at `shift`; each shared by so many threads."""
    where = select_device("cpu")
    numbers, model = PRECISIONS[case.precision], model_of(case)
    kernel = time_loop_kernel(
        MarlowLaw, model.faces, model.side, numbers, case.element, relaxation=model.relaxation_kind
    )
    lanes = PACK_BYTES // numbers.dtype().itemsize
    output, _ = output_of(kernel, model.mesh, N, SAMPLING, model.mesh.side, where)
    stepping = explicit.Stepping(precision=case.precision, max_steps=5000)
    batch = batch_of(kernel, model, samples_of(case), SAMPLING, stepping, numbers, where)
    if spoil:
        solids = batch.solids.numpy()
        solids["scale"][SPOILT] = np.nan
        batch.solids = wp.array(solids, dtype=kernel.element.Solid, device=where)
    body = body_of(kernel, model, numbers, where)
    if mapping is None:
        state = state_of(kernel, model, numbers, where, n, 1)
        wp.launch(kernel.kernel, (n, 1), [body, batch, state, output, 0], device=where, block_dim=1)
        return output
    made = lane_kernel(kernel.kernel, kernel.structs, numbers, mapping, lanes).kernel
    width = lanes if mapping == "simulation" else 1
    first = 0
    while first < n:
        count = min(width if first else (shift or width), n - first)
        state = state_of(kernel, model, numbers, where, 1, width)

        def share(team: Any, given: tuple[Any, ...] = (state, output, first, count)) -> None:
            wp.launch(made, 1, [body, batch, *given, team], device=where, block_dim=1)

        if threads == 1:
            share(single_thread_team())
        else:
            assert launch_shared(share, FullSeats(model.mesh.n_elements, threads, where, patience)) > 0
        first += count
    return output


HISTORIES = ("force", "impulse", "position", "energy")
NUMBERS = ("outcome", "failed_element", "steps", "end_time", "smallest_step", "past_data", "strain_measure")


@cache
def results(case: Case, mapping: Mapping | None) -> dict[str, np.ndarray]:
    return read(launch(case, mapping))


def read(output: Any) -> dict[str, np.ndarray]:
    histories = {name: getattr(output, name).numpy() for name in HISTORIES}
    return {**histories, **dict(zip(NUMBERS, output.ending.numpy().T, strict=True))}


@EVERY
def test_the_batch_exercises_what_it_should(case: Case) -> None:
    got = results(case, None)
    outcomes = [explicit.Outcome(int(code)) for code in got["outcome"]]
    assert all(outcomes[i].ok for i in GOOD)
    # Its 24 elements are crushed at 36 m/s within a few steps: they fold, the step collapses, or the step
    # that was measured before no longer holds, whichever is seen first.
    assert outcomes[CRUSHED] in (
        explicit.Outcome.INVERTED,
        explicit.Outcome.STEP_COLLAPSED,
        explicit.Outcome.DIVERGED,
    )
    assert outcomes[SPOILT] in (explicit.Outcome.INVERTED, explicit.Outcome.DIVERGED)
    assert np.isfinite(got["position"][GOOD]).all()
    assert len(set(got["steps"])) > 5  # lanes end at different times
    assert got["past_data"].max() > 0.0
    energy = got["energy"][GOOD, -1]
    used = [0, 1, 2, 4, 5, 6] if case.element == "fbar" else [*range(7)]
    used += [8] if case.relaxes else []
    assert all((energy[:, k] != 0.0).any() for k in used)


@EVERY
def test_the_mappings_agree_bit_for_bit(case: Case) -> None:
    a, b = results(case, "simulation"), results(case, "worker")
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


@EVERY
def test_threads_that_share_a_simulation_agree_bit_for_bit(case: Case) -> None:
    """Two that stay together; more that are late at a meeting now and then, or at each, go and come back."""
    expected = results(case, "worker")
    ways = ((2, 0, SPOILT + 1), (2, LONG, CRUSHED + 1), (3, 1000, CRUSHED + 1))
    for threads, patience, n in ways if case.name in EVERY_WAY else ways[:1]:
        got = read(launch(case, "worker", n, threads=threads, patience=patience))
        for name in got:
            np.testing.assert_array_equal(got[name][:n], expected[name][:n], err_msg=f"{name}, {threads}")


@EVERY
@pytest.mark.parametrize("mapping", ["simulation", "worker"])
def test_the_scalar_kernel_agrees(case: Case, mapping: Mapping) -> None:
    got, warp = results(case, mapping), results(case, None)
    np.testing.assert_array_equal(got["outcome"][GOOD], warp["outcome"][GOOD])
    np.testing.assert_array_equal(got["steps"][GOOD], warp["steps"][GOOD])
    # Sums are fused on one side only. Ten times the largest difference seen, relative to the largest value:
    # 1e-12 (2e-13 but for forces), 3e-4 (1e-6) in fp32; a stiff contact amplifies round-off most.
    force, other = (1e-11, 2e-12) if case.precision == "fp64" else (3e-3, 1e-5)
    for name in (*HISTORIES, *NUMBERS[3:]):
        atol = (force if name == "force" else other) * np.abs(warp[name][GOOD]).max()
        np.testing.assert_allclose(got[name][GOOD], warp[name][GOOD], rtol=0.0, atol=atol, err_msg=name)
    early = slice(0, 9)  # what comes before the crushed one folds
    atol = force * np.abs(warp["force"][GOOD]).max()
    np.testing.assert_allclose(got["force"][CRUSHED, early], warp["force"][CRUSHED, early], atol=atol)


@pytest.mark.parametrize("case", [CASES[0], CASES[3]], ids=lambda case: case.name)
def test_a_simulation_keeps_its_bits_in_any_pack(case: Case) -> None:
    whole = results(case, "simulation")
    for n in range(1, N + 1):
        got = read(launch(case, "simulation", n))
        for name in got:
            np.testing.assert_array_equal(got[name][:n], whole[name][:n], err_msg=f"{n} {name}")
        assert np.isnan(got["position"][n:]).all()  # untouched
        assert np.isnan(got["steps"][n:]).all()
    for shift in (1, 2, 5):
        got = read(launch(case, "simulation", shift=shift))
        for name in got:
            np.testing.assert_array_equal(got[name], whole[name], err_msg=f"shift {shift} {name}")


@pytest.mark.parametrize("case", [CASES[2], CASES[4], CASES[6]], ids=lambda case: case.name)
@pytest.mark.parametrize("mapping", ["simulation", "worker"])
def test_what_is_not_a_number_stays_in_its_lane(case: Case, mapping: Mapping) -> None:
    got, sound = results(case, mapping), read(launch(case, mapping, spoil=False))
    others = np.delete(np.arange(N), SPOILT)
    assert sound["outcome"][SPOILT] == explicit.Outcome.COMPLETED
    for name in got:
        np.testing.assert_array_equal(got[name][others], sound[name][others], err_msg=name)


def test_packs_hold_every_simulation_once() -> None:
    for n, lanes, elements in product(range(1, 70), (4, 8, 16), (24, LARGE_MESH, LARGE_MESH + 1)):
        jobs = packs(n, lanes, elements)
        held = [i for _, first, count in jobs for i in range(first, first + count)]
        assert held == list(range(n))
        assert all(count == 1 for mapping, _, count in jobs if mapping == "worker")
        full = [count for mapping, _, count in jobs if mapping == "simulation"]
        assert all(count == lanes for count in full[:-1])
        assert all(0.75 * lanes <= count <= lanes for count in full)
        assert sum(count == 1 for _, _, count in jobs) < (lanes if elements <= LARGE_MESH else n + 1)
        assert (not full) == (elements > LARGE_MESH or n < 0.75 * lanes)


def lasting(jobs: list[tuple[Mapping, int, int]], threads: int, alone: float) -> float:
    """How long threads need for jobs that they take in order, one simulation `alone` of a pack's time."""
    busy = [0.0] * threads
    for mapping, _, _ in jobs:
        busy[busy.index(min(busy))] += 1.0 if mapping == "simulation" else alone
    return max(busy)


def test_threads_that_would_be_idle_run_what_is_left_one_by_one() -> None:
    for n, lanes, threads in product(range(1, 140), (4, 8, 16), (2, 3, 16)):
        jobs = packs(n, lanes, 24, threads)
        assert [i for _, first, count in jobs for i in range(first, first + count)] == list(range(n))
        # As many alone as make a pack worth while take a pack's time.
        alone = 1.0 / (0.75 * lanes)
        assert lasting(jobs, threads, alone) <= lasting(packs(n, lanes, 24), threads, alone) + 1e-12
    assert packs(7, 8, 24, 2) == [("worker", i, 1) for i in range(7)]
    assert packs(10, 8, 24, 2) == [("worker", i, 1) for i in range(10)]  # five each: 5/6 of a pack's time
    assert [count for _, _, count in packs(12, 8, 24, 2)] == [8, 1, 1, 1, 1]
    assert [count for _, _, count in packs(23, 8, 24, 2)] == [8, 8, 1, 1, 1, 1, 1, 1, 1]
    assert packs(7, 8, LARGE_MESH + 1, 2) == packs(7, 8, LARGE_MESH + 1)


@pytest.mark.parametrize("case", [CASES[2], CASES[3]], ids=lambda case: case.name)
def test_a_run_is_the_same_for_any_threads(case: Case) -> None:
    expected = read(launch(case, "simulation", spoil=False))
    for threads in (1, 2, 5):
        finished: list[int] = []
        stepping = explicit.Stepping(precision=case.precision, max_steps=5000)
        got = run(
            model_of(case), samples_of(case), SAMPLING, stepping=stepping, threads=threads,
            progress=finished.append,
        )  # fmt: skip
        assert sum(finished) == N
        np.testing.assert_array_equal(got.steps, expected["steps"])
        np.testing.assert_array_equal(got.force_flyer, expected["force"][:, :, 0])
        np.testing.assert_array_equal(got.surface_r, expected["position"][:, :, :, 0])
        np.testing.assert_array_equal(got.energy.impact, expected["energy"][:, :, 6])


SHARED_RUN_END = 6e-4
MANY = ELEMENTS_EACH * MOST_SEATS


class Launches:
    """Launches that note their threads; the first thread's waits until the others have come."""

    def __init__(self, others: int = 0, error: Exception | None = None, early: bool = False) -> None:
        self.others, self.error, self.early = others, error, early
        self.seats: list[int] = []

    def begin(self) -> Any:
        if self.early and self.error:
            raise self.error
        return self.launch

    def launch(self, team: Any) -> None:
        self.seats.append(team.seat)
        if team.seat == 0:
            while len(self.seats) <= self.others:
                time.sleep(1e-4)
            if self.error:
                raise self.error
        else:  # as the time loop does
            while not team.words.numpy()[FINISHED]:
                time.sleep(1e-4)


@pytest.mark.parametrize(
    ("n_elements", "threads", "seats"),
    [
        (MANY, 1, 1), (MANY, 2, 2), (2 * ELEMENTS_EACH - 1, 5, 1), (2 * ELEMENTS_EACH, 5, 2),
        (10 * MANY, 99, MOST_SEATS), (0, 9, 1),
    ],
)  # fmt: skip
def test_as_many_join_as_have_work(n_elements: int, threads: int, seats: int) -> None:
    run = SharedRun(Launches().begin, 3, n_elements, select_device("cpu"))
    assert len(run.offer(threads)) == seats - 1
    assert run.run() == 3


def test_who_joins_has_a_seat_of_its_own_and_leaves_with_the_run() -> None:
    launches = Launches(others=3)
    run = SharedRun(launches.begin, 1, MANY, select_device("cpu"))
    with ThreadPoolExecutor(3) as pool:
        joined = [pool.submit(one) for one in run.offer(4)]
        assert run.run() == 1
        for future in joined:
            future.result(timeout=10.0)
    assert sorted(launches.seats) == [0, 1, 2, 3]


@pytest.mark.parametrize("early", [True, False], ids=["before", "within"])
def test_an_error_reaches_who_runs_and_sends_the_others_away(early: bool) -> None:
    launches = Launches(others=0 if early else 2, error=ValueError("no room"), early=early)
    run = SharedRun(launches.begin, 1, MANY, select_device("cpu"))
    with ThreadPoolExecutor(2) as pool:
        joined = [pool.submit(one) for one in run.offer(3)]
        with pytest.raises(ValueError, match="no room"):
            run.run()
        for future in joined:
            future.result(timeout=10.0)
    assert sorted(launches.seats) == ([] if early else [0, 1, 2])


def test_who_comes_after_the_end_leaves_at_once() -> None:
    launches = Launches()
    run = SharedRun(launches.begin, 1, MANY, select_device("cpu"))
    (late,) = run.offer(2)
    run.run()
    late()
    assert launches.seats == [0, 1]


def test_the_last_launches_are_joined_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of five launches on three threads the last two can be at work while a thread is idle."""
    offered = []

    class Watched(SharedRun):
        def offer(self, threads: int) -> Any:
            offered.append(self.count)
            return super().offer(threads)

    runs = [Watched(Launches().begin, k, MANY, select_device("cpu")) for k in range(5)]
    counts: list[int] = []
    explicit.drivers._work(runs, 3, counts.append)
    assert offered == [4, 3]
    assert sorted(counts) == [0, 1, 2, 3, 4]
    offered.clear()
    explicit.drivers._work(runs[:1], 1, None)
    assert offered == []


def model(contact: str) -> explicit.Model:
    motion = explicit.PlatenMotion.sampled(
        lambda t: 3.0 * t**2 / SHARED_RUN_END, lambda t: 6.0 * t / SHARED_RUN_END, start=0.0,
        end=SHARED_RUN_END, n_knots=65,
    )  # fmt: skip
    mesh = explicit.cylinder(4.75e-3, 6.5e-3, n_radial=6, n_axial=9)
    return explicit.Model(mesh, 870.0, (neo_hookean(27e3),), (motion,), faces=contact, side=contact)


@pytest.mark.parametrize("contact", ["bonded", "coulomb"])
def test_a_run_has_the_same_bits_on_any_threads(contact: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One run, and five of which the last are joined; simulations of a mesh that counts as large."""
    monkeypatch.setattr(team, "ELEMENTS_EACH", 8)
    times = np.linspace(0.0, SHARED_RUN_END, 25)
    sampling = explicit.Sampling(times, times, ledger_every=3)
    for n in (1, 5):
        samples = explicit.Samples.of(
            stiffness_factor=np.linspace(0.8, 1.2, n), friction=0.3, poisson=0.499, damping=2e-5
        )
        one, *others = (
            explicit.run(model(contact), samples, sampling, threads=threads) for threads in (1, 2, 3)
        )
        assert (one.steps > 50).all()
        assert one.completed.all()
        for other in others:
            for name in ("force_flyer", "impulse_transmission", "surface_r", "steps", "smallest_step"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
            for name, value in vars(one.energy).items():
                np.testing.assert_array_equal(value, getattr(other.energy, name), err_msg=name)

"""A CUDA device, where there is one, against the CPU: on the chip and off it, with ledgers and failures."""

from dataclasses import fields, replace

import numpy as np
import pytest
import warp as wp

from explicit import (
    CharacteristicBar,
    Model,
    Outcome,
    PlatenMotion,
    Response,
    Samples,
    Sampling,
    Stepping,
    cylinder,
    run,
)
from explicit.device import select_device
from explicit.layout.lanes import BLOCK, CLUSTERS
from explicit.layout.state import ON_CHIP_ELEMENTS
from explicit.materials import LAWS, MaterialLaw, neo_hookean
from explicit.relaxation import BergstromBoyce, PronySeries
from explicit.relaxation.base import RateDependence

TIMES = np.linspace(5e-6, 2e-4, 40)
SAMPLES = Samples.of(stiffness_factor=[0.8, 1.0, 1.2], friction=0.3, damping=2.5e-5)
MESHES = [(6, 8), (16, 22), (24, 32), (36, 40)]
"""Fewer elements than workers, as many, more than fit on the chip in fp64, and more than a few blocks have
workers for."""
APART = 1e-9
"""Sums are made in another order: round-off, 1e-16, amplified by a few hundred steps."""


@pytest.fixture(scope="module")
def cuda() -> str:
    select_device("cpu")
    if not wp.is_cuda_available():
        pytest.skip("no CUDA device")
    return "cuda"


def model(mesh: tuple[int, int], law: MaterialLaw | None = None, **options: str) -> Model:
    """A soft disc under a platen that gains speed."""
    motion = PlatenMotion.sampled(lambda t: 5e4 * t**2, lambda t: 1e5 * t, start=0.0, end=TIMES[-1])
    specimen = cylinder(4.75e-3, 6.5e-3, n_radial=mesh[0], n_axial=mesh[1], grading=2.0)
    laws = (law or neo_hookean(27e3),)
    return Model(specimen, 870.0, laws, (motion,), faces="coulomb", side="coulomb", **options)  # type: ignore[arg-type]


def both(mesh: tuple[int, int], device: str, **stepping: int) -> tuple[Response, Response]:
    problem = model(mesh)
    sampling, steps = Sampling(TIMES, TIMES), Stepping(**stepping)  # type: ignore[arg-type]
    here, there = (run(problem, SAMPLES, sampling, stepping=steps, device=d) for d in ("cpu", device))
    return here, there


def apart(a: np.ndarray, b: np.ndarray) -> float:
    assert np.array_equal(np.isnan(a), np.isnan(b))
    return float(np.nanmax(np.abs(a - b)) / max(float(np.nanmax(np.abs(a))), 1e-300))


def test_the_meshes_are_what_they_are_for() -> None:
    few, full, many, most = (across * along for across, along in MESHES)
    assert few < BLOCK - 32 == full < ON_CHIP_ELEMENTS < many < CLUSTERS[-1] * (BLOCK - 32) < most


@pytest.mark.parametrize("mesh", MESHES, ids=str)
def test_histories_and_ledgers_agree(mesh: tuple[int, int], cuda: str) -> None:
    here, there = both(mesh, cuda)
    for name in ("force_flyer", "force_transmission", "impulse_flyer", "surface_r", "surface_y"):
        assert apart(getattr(here, name), getattr(there, name)) < APART, name
    work = np.abs(here.energy.external).max()
    for field in fields(here.energy):
        difference = np.abs(getattr(here.energy, field.name) - getattr(there.energy, field.name)).max()
        assert difference < APART * work, field.name
    np.testing.assert_array_equal(here.steps, there.steps)


@pytest.mark.parametrize("element", ["one_point", "fbar"])
@pytest.mark.parametrize("relaxes", ["prony", "creep"])
def test_what_relaxes_agrees(element: str, relaxes: str, cuda: str) -> None:
    branches: tuple[RateDependence, ...] = {
        "prony": (PronySeries((0.5,), (5e-5,)), PronySeries((0.3, 0.8), (2e-5, 2e-4))),
        "creep": (BergstromBoyce(0.5, 300.0), BergstromBoyce(1.5, 100.0)),
    }[relaxes]
    problem = replace(model((16, 22)), element=element, relaxation=branches)
    samples = Samples.of(stiffness_factor=[0.8, 1.0, 1.2], friction=0.3, relaxation=np.array([0, 1, 0]))
    here, there = (run(problem, samples, Sampling(TIMES, TIMES), device=d) for d in ("cpu", cuda))
    for name in ("force_flyer", "force_transmission", "surface_r"):
        assert apart(getattr(here, name), getattr(there, name)) < APART, name
    work = np.abs(here.energy.external).max()
    assert np.abs(here.energy.viscous).max() > 0.0
    assert np.abs(here.energy.viscous - there.energy.viscous).max() < APART * work
    np.testing.assert_array_equal(here.steps, there.steps)


def test_a_failure_ends_at_the_same_element(cuda: str) -> None:
    here, there = both((24, 32), cuda, max_steps=50)
    assert here.outcomes == there.outcomes == (Outcome.STEP_LIMIT,) * 3
    np.testing.assert_array_equal(here.failed_elements, there.failed_elements)


def test_a_simulation_has_the_same_bits_in_a_batch_that_shares_multiprocessors(cuda: str) -> None:
    n = 9 * wp.get_device(cuda).sm_count  # more than one launch
    problem, few = model((16, 22)), SAMPLES
    many = Samples.of(stiffness_factor=np.resize(few.stiffness_factor, n), friction=0.3, damping=2.5e-5)
    sampling = Sampling(TIMES, TIMES, ledger_every=4)
    alone, among = (run(problem, samples, sampling, device=cuda) for samples in (few, many))
    for name in ("force_flyer", "force_transmission", "surface_r", "surface_y", "steps"):
        expected = np.resize(getattr(alone, name), getattr(among, name).shape)
        assert np.array_equal(expected, getattr(among, name), equal_nan=True), name
    work = np.nanmax(alone.energy.external)
    for name in (
        field.name for field in fields(alone.energy)
    ):  # summed warp by warp, in blocks of two sizes: round-off
        expected = np.resize(getattr(alone.energy, name), getattr(among.energy, name).shape)
        assert np.nanmax(np.abs(expected - getattr(among.energy, name))) < 1e-12 * work, name


@pytest.mark.parametrize("share", [1, 5])
@pytest.mark.parametrize("mesh", MESHES[2:], ids=str)
def test_a_simulation_has_the_same_bits_on_one_multiprocessor_and_on_several(
    mesh: tuple[int, int], share: int, cuda: str
) -> None:
    # every one has a simulation of its own, or four share one: in global memory where that is too large
    n = wp.get_device(cuda).sm_count // share
    problem, few, sampling = model(mesh), SAMPLES, Sampling(TIMES[:8], TIMES[:8])
    many = Samples.of(stiffness_factor=np.resize(few.stiffness_factor, n), friction=0.3, damping=2.5e-5)
    alone, among = (run(problem, samples, sampling, device=cuda) for samples in (few, many))
    for name in ("force_flyer", "force_transmission", "surface_r", "surface_y", "steps"):
        expected = np.resize(getattr(alone, name), getattr(among, name).shape)
        assert np.array_equal(expected, getattr(among, name)), name
    work = np.nanmax(alone.energy.external)
    for name in (field.name for field in fields(alone.energy)):  # summed warp by warp: round-off
        expected = np.resize(getattr(alone.energy, name), getattr(among.energy, name).shape)
        assert np.abs(expected - getattr(among.energy, name)).max() < 1e-12 * work, name


@pytest.mark.parametrize("mesh", MESHES[1:3], ids=str)
def test_a_support_that_yields_agrees(mesh: tuple[int, int], cuda: str) -> None:
    problem = replace(model(mesh), support=CharacteristicBar(impedance=30.0, round_trip=8e-5))
    here, there = (run(problem, SAMPLES, Sampling(TIMES, TIMES), device=d) for d in ("cpu", cuda))
    rigid = run(model(mesh), SAMPLES, Sampling(TIMES, TIMES), device=cuda)
    assert apart(rigid.surface_y, there.surface_y) > 1e3 * APART  # it does yield
    for name in ("force_flyer", "force_transmission", "surface_r", "surface_y"):
        assert apart(getattr(here, name), getattr(there, name)) < APART, name
    np.testing.assert_array_equal(here.steps, there.steps)


@pytest.mark.parametrize("every", [1, 8])
@pytest.mark.parametrize("mesh", MESHES[:3], ids=str)
def test_the_end_of_the_data_is_met_in_the_same_step(mesh: tuple[int, int], every: int, cuda: str) -> None:
    problem = model(mesh, neo_hookean(27e3, last=0.3), past_data="stop")
    steps = Stepping(measure_every=every)
    here, there = (
        run(problem, SAMPLES, Sampling(TIMES, TIMES), stepping=steps, device=d) for d in ("cpu", cuda)
    )
    assert here.outcomes == there.outcomes == (Outcome.TABLE_EXCEEDED,) * 3
    np.testing.assert_array_equal(here.steps, there.steps)
    np.testing.assert_array_equal(here.failed_elements, there.failed_elements)


def test_a_result_stays_what_it_is_when_others_are_computed(cuda: str) -> None:
    problem, sampling = model((6, 8)), Sampling(TIMES, TIMES)
    first = run(problem, SAMPLES, sampling, device=cuda)
    kept, copy = first.surface_r[1], first.surface_r[1].copy()
    force, forces = first.force_flyer, first.force_flyer.copy()
    del first
    stiffer = Samples.of(stiffness_factor=[2.0, 3.0, 4.0], friction=0.3, damping=2.5e-5)
    for _ in range(3):
        run(problem, stiffer, sampling, device=cuda)
    np.testing.assert_array_equal(kept, copy)
    np.testing.assert_array_equal(force, forces)


@pytest.mark.parametrize("name", list(LAWS))
def test_every_law_agrees(name: str, cuda: str) -> None:
    problem, sampling = model((6, 8), LAWS[name].example()), Sampling(TIMES, TIMES)
    here, there = (run(problem, SAMPLES, sampling, device=device) for device in ("cpu", cuda))
    for history in ("force_flyer", "force_transmission", "surface_r", "surface_y"):
        assert apart(getattr(here, history), getattr(there, history)) < APART, history
    np.testing.assert_array_equal(here.steps, there.steps)


@pytest.mark.parametrize("form", ["logarithmic", "simo_taylor"])
@pytest.mark.parametrize("element", ["one_point", "fbar"])
def test_every_volumetric_form_agrees(form: str, element: str, cuda: str) -> None:
    problem = model((6, 8), LAWS["ogden2"].example(), volumetric=form, element=element)
    here, there = (run(problem, SAMPLES, Sampling(TIMES, TIMES), device=device) for device in ("cpu", cuda))
    for history in ("force_flyer", "force_transmission", "surface_r", "surface_y"):
        assert apart(getattr(here, history), getattr(there, history)) < APART, history

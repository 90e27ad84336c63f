"""A CUDA device, if there is one, compared with the CPU: state on the chip and off it, ledgers, failures."""

import gc
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
import warp as wp

import explicit
from explicit import (
    CharacteristicBar,
    Mesh,
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
from explicit.arguments import body_of, fits_on_several, node_order
from explicit.device import select_device
from explicit.drivers import STEP, Pool
from explicit.layout import state
from explicit.layout.lanes import BLOCK, CLUSTERS, SPREAD, cluster_for, supports_chip_memory
from explicit.layout.structs import GROUP
from explicit.materials import LAWS, MarlowLaw, MaterialLaw, neo_hookean
from explicit.precision import PRECISIONS, Precision
from explicit.relaxation import BergstromBoyce, PronySeries
from explicit.relaxation.base import RateDependence
from explicit.time_loop.kernel import TimeLoopKernel, time_loop_kernel

TIMES = np.linspace(5e-6, 2e-4, 40)
SAMPLES = Samples.of(stiffness_factor=[0.8, 1.0, 1.2], friction=0.3, damping=2.5e-5)
MESHES = [(6, 8), (16, 22), (24, 32), (36, 40)]
"""Fewer elements than workers, as many, more than fit on the chip in fp64, and more than a few blocks have
workers for."""
APART = 1e-9  # sums are made in another order: round-off, 1e-16, amplified by a few hundred steps


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
    assert few < BLOCK - 32 == full < state.ON_CHIP_ELEMENTS < many < CLUSTERS[-1] * (BLOCK - 32) < most


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


def same_bits(problem: Model, sampling: Sampling, n: int, device: str) -> None:
    """Of a batch of `n`, against the three alone; energies, summed warp by warp, agree to round-off."""
    few = SAMPLES
    many = Samples.of(stiffness_factor=np.resize(few.stiffness_factor, n), friction=0.3, damping=2.5e-5)
    alone, among = (run(problem, samples, sampling, device=device) for samples in (few, many))
    for name in ("force_flyer", "force_transmission", "surface_r", "surface_y", "steps"):
        expected = np.resize(getattr(alone, name), getattr(among, name).shape)
        assert np.array_equal(expected, getattr(among, name), equal_nan=True), name
    work = np.nanmax(alone.energy.external)
    for name in (field.name for field in fields(alone.energy)):
        expected = np.resize(getattr(alone.energy, name), getattr(among.energy, name).shape)
        np.testing.assert_allclose(getattr(among.energy, name), expected, rtol=0.0, atol=1e-12 * work)


def test_a_simulation_has_the_same_bits_in_a_batch_that_shares_multiprocessors(cuda: str) -> None:
    # more than one launch
    same_bits(model((16, 22)), Sampling(TIMES, TIMES, ledger_every=4), 9 * wp.get_device(cuda).sm_count, cuda)


@pytest.mark.parametrize("share", [1, 5])
@pytest.mark.parametrize("mesh", MESHES[2:], ids=str)
def test_a_simulation_has_the_same_bits_on_one_multiprocessor_and_on_several(
    mesh: tuple[int, int], share: int, cuda: str
) -> None:
    # every one has a simulation of its own, or four share one: in global memory where that is too large
    same_bits(model(mesh), Sampling(TIMES[:8], TIMES[:8]), wp.get_device(cuda).sm_count // share, cuda)


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


@pytest.fixture
def pool() -> Pool:
    select_device("cpu")
    return Pool(limit=4 * STEP, pinned=False)


def test_a_piece_is_used_again_when_its_result_is_gone(pool: Pool) -> None:
    piece, numbers = pool.lend(10)
    numbers[:] = np.arange(10.0)
    view = numbers[2:4]
    del numbers
    gc.collect()
    other, _ = pool.lend(10)
    assert other is not piece  # the view still lives
    np.testing.assert_array_equal(view, [2.0, 3.0])
    del view
    gc.collect()
    assert pool.lend(10)[0] is piece


def test_the_numbers_are_those_of_the_piece(pool: Pool) -> None:
    piece, numbers = pool.lend(7)
    piece.memory.numpy()[:7] = np.arange(7.0)
    assert numbers.shape == (7,)
    assert numbers.flags.writeable
    np.testing.assert_array_equal(numbers, np.arange(7.0))


def test_no_more_is_locked_than_is_allowed(pool: Pool) -> None:
    kept = [pool.lend(STEP) for _ in range(4)]
    assert pool.lend(1) is None
    kept.pop()
    gc.collect()
    assert pool.lend(1) is not None


def test_free_pieces_make_room_for_a_larger_one(pool: Pool) -> None:
    for _ in range(2):
        assert pool.lend(STEP) is not None
    gc.collect()
    piece, _ = pool.lend(4 * STEP)
    assert piece.memory.size == 4 * STEP


def test_a_piece_is_not_wasted_on_much_less(pool: Pool) -> None:
    large, numbers = pool.lend(3 * STEP)
    del numbers
    gc.collect()
    assert pool.lend(10)[0] is not large
    assert pool.lend(STEP + 1)[0] is large


@dataclass(frozen=True)
class Device:
    """What is asked of a Warp device."""

    is_cuda: bool = True
    arch: int = 90
    sm_count: int = 132


WORKERS = BLOCK - 32
FEW = int(SPREAD * 132)
LARGE = 64 * 86


def test_the_more_simulations_the_fewer_blocks_each() -> None:
    assert cluster_for(1, LARGE, Device(), False) == CLUSTERS[0] == 16
    assert cluster_for(FEW // 16, LARGE, Device(), False) == 16
    assert cluster_for(FEW // 16 + 1, LARGE, Device(), False) == 4
    assert cluster_for(FEW // 4, LARGE, Device(), False) == 4
    assert cluster_for(FEW // 4 + 1, LARGE, Device(), False) == 1


@pytest.mark.parametrize(
    ("n_elements", "blocks"), [(WORKERS, 1), (WORKERS + 1, 4), (4 * WORKERS, 4), (4 * WORKERS + 1, 16)]
)
def test_no_blocks_without_work(n_elements: int, blocks: int) -> None:
    assert cluster_for(1, n_elements, Device(), False) == blocks


@pytest.mark.parametrize(
    ("device", "on_chip"), [(Device(), True), (Device(is_cuda=False), False), (Device(arch=80), False)]
)
def test_others_have_one(device: Device, on_chip: bool) -> None:
    assert cluster_for(1, LARGE, device, on_chip) == 1


def test_the_fewest_blocks_on_whose_chips_a_mesh_fits() -> None:
    both, most = {4, 16}.__contains__, {16}.__contains__
    assert cluster_for(1, 4 * WORKERS, Device(), False, both) == 4
    assert cluster_for(1, LARGE, Device(), False, both) == 4
    assert cluster_for(1, WORKERS + 1, Device(), False, most) == 16
    assert cluster_for(1, WORKERS, Device(), False, most) == 1  # one block has a worker for every element
    # where the chips of as many blocks are not free, those that are share it in global memory
    assert cluster_for(FEW // 16 + 1, LARGE, Device(), False, most) == 4


def test_on_other_architectures_blocks_share_a_mesh_in_global_memory() -> None:
    assert supports_chip_memory(Device())
    later = Device(arch=100)
    assert not supports_chip_memory(later)
    assert not supports_chip_memory(Device(is_cuda=False))
    assert cluster_for(1, 4 * WORKERS + 1, later, False, {4, 16}.__contains__) == 16
    assert cluster_for(1, 4 * WORKERS + 1, Device(), False, {4, 16}.__contains__) == 4


SIDE_BY_SIDE_TIMES = np.linspace(1e-6, 1e-4, 20)


def problem(mesh: tuple[int, int], density: float, damping: np.ndarray) -> explicit.Problem:
    motion = explicit.PlatenMotion.sampled(
        lambda t: 5e4 * t**2, lambda t: 1e5 * t, start=0.0, end=SIDE_BY_SIDE_TIMES[-1]
    )
    cylinder = explicit.cylinder(4.75e-3, 6.5e-3, n_radial=mesh[0], n_axial=mesh[1], grading=2.0)
    model = explicit.Model(cylinder, density, (neo_hookean(27e3),), (motion,))
    return explicit.Problem(
        model, explicit.Samples.of(damping=damping), explicit.Sampling(SIDE_BY_SIDE_TIMES, SIDE_BY_SIDE_TIMES)
    )


def test_models_that_share_the_cores_have_the_bits_of_each_alone() -> None:
    """A pack and a simulation that does not fill one; another mesh; another density; one that ends early."""
    many = [
        problem((5, 6), 870.0, np.linspace(1e-5, 3e-5, 9)),
        problem((6, 8), 870.0, np.array([2.5e-5])),
        problem((5, 6), 900.0, np.array([2.5e-5, 1e-5])),
    ]
    many.append(replace(many[1], stepping=explicit.Stepping(max_steps=10)))
    together = explicit.run_side_by_side(many, threads=2)
    assert together[3].outcomes[0] is explicit.Outcome.STEP_LIMIT
    for one, found in zip(many[:3], together, strict=False):
        alone = explicit.run(one.model, one.samples, one.sampling)
        assert found.completed.all()
        assert np.array_equal(found.force_transmission, alone.force_transmission)
        assert np.array_equal(found.surface_r, alone.surface_r)
    assert explicit.run_side_by_side([]) == []


SEVERAL_CHIPS_LARGE = [((24, 32), 4), ((40, 28), 4), ((64, 86), 16), ((33, 9), 4)]


def kernel_of(blocks: int, numbers: Precision) -> TimeLoopKernel:
    return time_loop_kernel(MarlowLaw, "bonded", "bonded", numbers, "one_point", True, cluster=blocks)


def model_of(mesh: Mesh) -> Model:
    motion = PlatenMotion(start=0.0, step=1.0, position=np.zeros(2), velocity=np.zeros(2))
    return Model(mesh, 870.0, (neo_hookean(27e3),), (motion,))


def entries(groups: np.ndarray, constants: int) -> np.ndarray:
    """Constants of a grouped table by element or node, shape [constants, n]."""
    values = groups[:, : constants * GROUP].reshape(-1, constants, GROUP)
    return values.transpose(1, 0, 2).reshape(constants, -1)


def parted(numbers: Precision, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Block and place in its shared memory."""
    return place // state.numbers_between_blocks(numbers), place % state.numbers_between_blocks(numbers)


@pytest.mark.parametrize("precision", list(PRECISIONS))
@pytest.mark.parametrize(("size", "blocks"), SEVERAL_CHIPS_LARGE)
def test_every_force_is_gathered_once_by_the_node_it_acts_on(
    size: tuple[int, int], blocks: int, precision: str
) -> None:
    mesh, numbers = cylinder(4.75e-3, 6.5e-3, n_radial=size[0], n_axial=size[1]), PRECISIONS[precision]
    assert fits_on_several(mesh, blocks)
    body = body_of(kernel_of(blocks, numbers), model_of(mesh), numbers, select_device("cpu"), on_chip=True)
    order, n_inner, first_boundary = node_order(mesh)
    place = state.spread_nodes(order, first_boundary, blocks, numbers)
    quads = entries(body.quads.numpy(), 4)[:, : mesh.n_elements]
    np.testing.assert_array_equal(quads, place[mesh.quads].T)
    # nodes have places of their own; the last block has the boundary, the others the interior
    assert len(np.unique(place)) == mesh.n_nodes
    block, inside = parted(numbers, place)
    assert ((block == blocks - 1) == (order >= n_inner)).all()
    assert inside.max() < BLOCK
    # a corner's force lies in the block of its element, behind those of the corners before
    element, corner = np.divmod(np.arange(4 * mesh.n_elements), 4)
    found = state.spread_corners(element, corner, numbers)
    assert len(np.unique(found)) == 4 * mesh.n_elements
    owner, slot = parted(numbers, found)
    np.testing.assert_array_equal(owner, element // BLOCK)
    np.testing.assert_array_equal(slot, corner * BLOCK + element % BLOCK)
    acts_on = dict(zip(found.tolist(), mesh.quads[element, corner].tolist(), strict=True))
    corners = entries(body.corners.numpy(), 4)
    gathered = []
    for n in range(mesh.n_nodes):
        for c in corners[:, order[n]].tolist():
            if c in acts_on:
                assert acts_on[c] == n
                gathered.append(c)
            else:  # what holds zero, in the node's own block
                assert (
                    c // state.numbers_between_blocks(numbers),
                    c % state.numbers_between_blocks(numbers),
                ) == (block[n], 4 * BLOCK)
    assert sorted(gathered) == sorted(acts_on)


def test_numbers_are_bytes_apart() -> None:
    for numbers in PRECISIONS.values():
        assert (
            state.numbers_between_blocks(numbers) * numbers.dtype().itemsize == state.BLOCK_DISTANCE == 2**24
        )
        assert 16 * state.numbers_between_blocks(numbers) < 2**31  # sixteen blocks, by 32-bit integers


def test_what_fits() -> None:
    full = 3 * BLOCK
    assert state.fits_on_chips(full, full, state.BOUNDARY, 4)
    assert not state.fits_on_chips(full + 1, full, state.BOUNDARY, 4)
    assert not state.fits_on_chips(full, full + 1, state.BOUNDARY, 4)
    assert not state.fits_on_chips(full, full, state.BOUNDARY + 1, 4)
    assert fits_on_several(cylinder(1.0, 1.0, n_radial=64, n_axial=86), 16)
    assert not fits_on_several(cylinder(1.0, 1.0, n_radial=64, n_axial=86), 4)

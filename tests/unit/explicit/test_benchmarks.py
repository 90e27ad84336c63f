"""Basis of the benchmarks: counted operations, kernels of the limits, the peer's deck; no speeds."""

import json
import math
import stat
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from benchmarks import counting, deck, limits, peer, problem, solver
from benchmarks.limit_kernels import fma_kernel, lanes, shared_kernel
from explicit.device import select_device
from explicit.elements.base import isochoric_factor_function
from explicit.materials import neo_hookean
from explicit.precision import PRECISIONS

FP64 = PRECISIONS["fp64"]


def test_operations_of_a_dot_product():
    counter = counting.Counter()
    a, b = counter.vector([1.0, 2.0, 3.0, 4.0]), counter.vector([5.0, 6.0, 7.0, 8.0])
    assert counter.words.dot(a, b).value == 70.0
    assert counter.tally == counting.Tally(additions=3, products=4, fused=3)
    assert (counter.tally.operations, counter.tally.instructions) == (7, 4)


def test_operations_by_hand():
    """The series: 2 products, 2 sums; its error: 3 and 1; corrected: 4 and 3; square and cube: 1 and 2
    products. All sums have a product."""
    counter = counting.Counter()
    factor = counter.function(isochoric_factor_function(FP64))
    square, inverse = factor(counter.number(0.98), counter.number(-0.02))
    assert square.value == pytest.approx(0.98 ** (-2.0 / 3.0), rel=1e-15)  # a few roundings of fp64
    assert inverse.value == pytest.approx(1.0 / 0.98, rel=1e-15)  # the same
    assert counter.tally == counting.Tally(additions=6, products=12, fused=6)


def test_operations_of_the_law():
    """Divisions and roots: the law's own root of I1 - 3; its stress is right."""
    law = neo_hookean(2.0)
    counter = counting.Counter()
    stress = counter.function(law.kernel_functions(FP64)[0])
    b_bar = np.array([1.2, 0.9, 0.1, 1.0 / (1.2 * 0.9)])
    found = stress(*counter.vector(b_bar), counter.vector(law.parameters()))
    # the law has a NumPy twin; sums in another order
    assert np.allclose([item.value for item in found], law.stress(b_bar), rtol=1e-13)
    assert (counter.tally.roots, counter.tally.divisions) == (1, 0)


def test_cost_of_an_element_update():
    """Measured at every step, the bound is paid in full; the fused fewer than the sums or the products."""
    model = problem.model((4, 6), "bonded")
    rarely, always = counting.cost(model, 1_000_000), counting.cost(model, 1)
    bare, full = counting.count(model, measure=False), counting.count(model, measure=True)
    share = model.mesh.n_nodes / model.mesh.n_elements
    assert always.operations == full.operations + share * counting.NODE_OPERATIONS
    assert rarely.operations == pytest.approx(bare.operations + share * counting.NODE_OPERATIONS, abs=1e-3)
    assert 0 < bare.fused < min(bare.additions, bare.products)
    assert full.roots >= bare.roots + 2  # of the bound itself: sqrt(stiffness) and sqrt(1 + xi^2)


def test_native_code_cannot_be_counted():
    @wp.func_native(snippet="return x;")
    def same(x: wp.float64) -> wp.float64: ...

    with pytest.raises(TypeError, match="same is native code"):
        counting.Counter().function(same)


@pytest.mark.parametrize(("precision", "chains"), [("fp64", 4), ("fp32", 16)])
def test_multiply_adds_are_made(precision, chains):
    """x -> a x + b from x0, `turns` times: a^n x0 + b (1 - a^n) / (1 - a), summed over the chains."""
    device, turns, numbers = select_device("cpu"), 50, PRECISIONS[precision]
    out = wp.zeros(lanes(numbers), dtype=numbers.real, device=device)
    wp.launch(fma_kernel(numbers, chains, False), dim=1, inputs=[turns, 0, out], device=device, block_dim=1)
    start = sum(range(1, chains + 1))
    decay = 0.999**turns
    expected = decay * start + chains * 0.001 * (1.0 - decay) / (1.0 - 0.999)
    # 50 roundings to fp32 of 6e-8 each, relative
    assert np.allclose(out.numpy(), expected, rtol=1e-5 if numbers.name == "fp32" else 1e-12)


@pytest.fixture
def short(monkeypatch):
    """Measurements of a millisecond: what they say is not asserted."""
    monkeypatch.setattr(limits, "SECONDS", 1e-3)
    monkeypatch.setattr(limits, "REPEATS", 1)


@pytest.mark.usefixtures("short")
def test_limits_of_a_cpu_are_rates_of_it():
    (limit,) = limits.limits(select_device("cpu"), FP64, 200.0, 1)
    assert limit.updates == limit.rate / 200.0
    assert limit.rate > 1e6  # it ran at all: no processor is as slow


@pytest.mark.slow
@pytest.mark.parametrize("numbers", PRECISIONS.values(), ids=PRECISIONS)
def test_limit_kernels_compile_for_a_gpu(numbers, tmp_path):
    select_device("cpu")
    for kernel in (fma_kernel(numbers, 8, True), shared_kernel(numbers)):
        wp.compile_aot_module(kernel.module, arch=90, module_dir=tmp_path, use_ptx=True)
    text = {path.name: path.read_text() for path in tmp_path.glob("*.ptx")}
    suffix = "f64" if numbers is FP64 else "f32"
    assert sorted(f"fma.rn.{suffix}" in ptx for ptx in text.values()) == [False, True]
    assert sorted(f"ld.shared.{suffix}" in ptx for ptx in text.values()) == [False, True]


def test_the_peers_energy_is_the_models():
    """The stress of C10, C20, C30 at some stretches against that of the model's law."""
    c10, c20, c30, d1 = problem.yeoh()
    (law,) = problem.model((4, 6), "bonded").materials
    for stretch in (0.4, 0.7, 0.95):
        s = math.sqrt(stretch**2 + 2.0 / stretch - 3.0)
        expected = 2.0 * (c10 + 2.0 * c20 * s**2 + 3.0 * c30 * s**4)
        # the law interpolates 65 points by a cubic, and extrapolates to rest by a line in I1
        assert law.two_u_prime(np.array([s]))[0] == pytest.approx(expected, rel=1e-3)
    assert 2.0 / d1 == pytest.approx(2.0 / 3.0 * 74e3 / 3.0 * 1.499 / 0.002)  # K of nu = 0.499


def test_deck():
    mesh = problem.model((2, 3), "bonded").mesh
    lines = deck.deck(mesh, end=5e-6, step=1e-6).splitlines()
    node = lines[1 + 11].split(",")
    assert [float(part) for part in node] == pytest.approx([12, *mesh.nodes[11] * 1e3, 0.0])
    assert lines[lines.index("*DYNAMIC, DIRECT") + 1] == "1e-06, 5e-06"
    start = lines.index("*AMPLITUDE, NAME=STROKE")
    path = [float(line.split(",")[1]) for line in lines[start + 1 : start + 7]]
    # the polynomial 2.6 m/s (2.5 s^4 - 3 s^5 + s^6) 50 us at s = t / 50 us, in mm
    s = np.arange(6) / 50.0
    assert path == pytest.approx(list(2600.0 * 50e-6 * (2.5 * s**4 - 3.0 * s**5 + s**6)), rel=1e-9)
    assert sum(line.startswith("*NSET") for line in lines) == 3


def test_forces_are_read_from_what_ccx_prints():
    printed = """
 total force (fx,fy,fz) for set LOWER and time  0.1000000E-05

       -3.896794E-03  1.521613E-02 -2.881267E-17

 total force (fx,fy,fz) for set LOWER and time  0.2000000E-05

        1.000000E-03 -2.000000E-02  0.000000E+00
"""
    times, force = peer.forces(printed)
    assert np.allclose(times, [1e-6, 2e-6])
    assert np.allclose(force, [180.0 * 1.521613e-2, -3.6])


def stand_in(folder: Path, text: str) -> None:
    path = folder / "ccx"
    path.write_text(f"#!{sys.executable}\nimport sys\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("print('Version 2.20'); sys.exit(201)", "ended with 201"),
        ("open('peer.dat', 'w').close(); print('diverged')", "printed 0 of 3 forces.*diverged"),
    ],
)
def test_a_peer_that_fails_is_no_result(text, message, tmp_path, monkeypatch):
    stand_in(tmp_path, text)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(peer.PeerError, match=message):
        peer.measure_peer((2, 3), window=3e-6)


@pytest.mark.usefixtures("short")
def test_table_without_the_peer(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    result, kept = tmp_path / "table.json", tmp_path / "kept.npz"
    arguments = ["--mesh", "2x3", "--runs", "1", "--repeats", "2"]
    solver.main([*arguments, "--save", str(kept)])
    solver.main([*arguments, "--json", str(result), "--compare", str(kept)])
    said = capsys.readouterr().out
    assert "no ccx on the PATH" in said
    table = json.loads(result.read_text())
    assert [row["contact"] for row in table["rows"]] == ["bonded", "bonded", "coulomb", "coulomb"]
    for row in table["rows"]:
        assert row["same_bits"]
        assert row["completed"] == 1
        assert row[f"force_difference_to_{row['precision']}_N"] == 0.0  # the same device and precision
        assert list(row["fraction_of"]) == ["SIMD arithmetic"]
    assert "peer" not in table
    assert not {"host", "date", "time"} & set(table["machine"])


@pytest.mark.slow
@pytest.mark.skipif(peer.program() is None, reason="no ccx on the PATH (Debian and Ubuntu: calculix-ccx)")
def test_the_peers_force_agrees():
    """100 us: the dilatational wave reaches the other platen and comes back once."""
    found = peer.measure_peer((32, 44))
    assert found.version.startswith("2.")
    # The front of the wave is as sharp as the mesh allows, and the two discretise it differently (lumped or
    # consistent mass, steps at the bound or of 1 us with numerical damping). Seen with 16 x 22 elements 3.5 %
    # and 9.5 % of the force, here 0.6 % and 1.5 %.
    assert found.rms_difference < 0.012 * found.largest_force
    assert found.largest_difference < 0.03 * found.largest_force
    assert found.whole_run == pytest.approx(found.seconds * 14.0)  # 1.4 ms
    assert [found.cost(n, 2) for n in (1, 3)] == [found.whole_run, 2.0 * found.whole_run]

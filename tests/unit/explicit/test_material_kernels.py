"""The Warp functions of every closed-form law: over lanes, by Warp itself, against the NumPy twin."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import MAPPINGS, PRECISION, N, inputs, lane_launch, scalar_launch, small_structs
from lawstates import largest_curvature, stretches, turned

from explicit.materials import LAWS, AnyLaw
from explicit.materials.volumetric import VolumetricLaw, volumetric_functions
from explicit.precision import Precision
from explicit.simd import Mapping

EVERY = [pytest.param(p, m, id=f"{p.name}-{m or 'warp'}") for p in PRECISION for m in (*MAPPINGS, None)]
COMPILED = [pytest.param(*x.values, id=x.id, marks=[pytest.mark.slow] * (x.id[:4] == "fp32")) for x in EVERY]
"""The same; all laws take seconds to compile, and those of single precision differ by their numbers alone."""
EXAMPLES: list[AnyLaw] = [law.example() for law in LAWS.values()]
SLOTS_OF_A_LAW = 5
"""Numbers that the kernel writes for each law: tau_rr, tau_ry, tau_tt, the tangent, the energy."""


def variants(law: AnyLaw) -> list[AnyLaw]:
    """Five materials of one law."""
    return [law.scaled(1.0 + 0.2 * k) for k in range(5)]


def rows() -> np.ndarray:
    """The kernels' rows of the variants, law after law, shape [5 n_laws, longest]."""
    found = [item.parameters() for law in EXAMPLES for item in variants(law)]
    table = np.zeros((len(found), max(map(len, found))))
    for place, row in zip(table, found, strict=True):
        place[: len(row)] = row
    return table


def writer(numbers: Precision, k: int) -> Any:
    """A function that writes what the first k laws say of one state."""
    real = numbers.real

    @wp.func
    def nothing(
        x: real,
        y: real,
        z: real,
        w: real,
        variant: int,
        rows: wp.array2d(dtype=real),
        out: wp.array(dtype=real),
    ):
        """No law says nothing."""

    if k == 0:
        return nothing
    before, place = writer(numbers, k - 1), k - 1
    stress, tangent, energy = list(LAWS.values())[place].kernel_functions(numbers)
    first_row, at = 5 * place, SLOTS_OF_A_LAW * place

    @wp.func
    def write(
        x: real,
        y: real,
        z: real,
        w: real,
        variant: int,
        rows: wp.array2d(dtype=real),
        out: wp.array(dtype=real),
    ):
        before(x, y, z, w, variant, rows, out)
        row = rows[first_row + variant]
        tau = stress(x, y, z, w, row)
        out[at] = tau[0]
        out[at + 1] = tau[2]
        out[at + 2] = tau[3]
        out[at + 3] = tangent(x, y, z, w, row)
        out[at + 4] = energy(x, y, z, w, row)

    return write


@cache
def laws_kernel(numbers: Precision) -> Any:
    """All laws in one kernel, of b_bar = (x, y, z, 1 / (x y - z^2)) and their rows one below another."""
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    one, write = numbers.real(1.0), writer(numbers, len(LAWS))

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        x, y, z = batch.x[sample], batch.y[sample], batch.z[sample]
        if lane == 0:
            w = one / (x * y - z * z)
            write(x, y, z, w, batch.k[sample], batch.rows, output.values[sample])

    return kernel


def states(seed: int = 7, largest: float = 0.5) -> np.ndarray:
    """N isochoric tensors (rr, yy, ry, tt): the first at rest, the next on the edge of it, shape [N, 4]."""
    lam = stretches(N, largest, seed)
    lam[0] = 1.0
    lam[1] = [1.0 + 1e-6, 1.0 + 1e-6, (1.0 + 1e-6) ** -2]  # both stretches in the plane are one
    lam[2] = [0.7, 0.7, 0.7**-2]
    return turned(lam**2, np.linspace(0.2, 2.9, N))


def evaluated(numbers: Precision, mapping: Mapping | None, b_bar: np.ndarray) -> np.ndarray:
    """What the kernel writes, shape [n_laws, N, 5]."""
    x, y, z = (b_bar[:, i].astype(numbers.dtype) for i in range(3))
    given = replace(inputs(numbers), rows=rows().astype(numbers.dtype), x=x, y=y, z=z)
    if mapping is None:
        values = scalar_launch(laws_kernel(numbers), numbers, given).values
    else:
        values = lane_launch(laws_kernel(numbers), numbers, given, mapping).values
    used = SLOTS_OF_A_LAW * len(EXAMPLES)
    return values[:, :used].astype(float).reshape(N, len(EXAMPLES), SLOTS_OF_A_LAW).transpose(1, 0, 2)


def as_seen(numbers: Precision, b_bar: np.ndarray) -> np.ndarray:
    """The tensors that the kernel makes of rounded numbers."""
    x, y, z = (b_bar[:, i].astype(numbers.dtype).astype(float) for i in range(3))
    return np.stack([x, y, z, 1.0 / (x * y - z * z)], axis=-1)


@pytest.mark.parametrize(("numbers", "mapping"), COMPILED)
def test_every_law_is_its_twin(numbers: Precision, mapping: Mapping | None) -> None:
    b_bar, k = states(), inputs(numbers).k
    found, seen = evaluated(numbers, mapping, b_bar), as_seen(numbers, b_bar)
    # Rounding of b_bar, of size 1, times moduli of 1e4 to 1e5 Pa, times the exponents of the example.
    scale = 1e5 * 20.0 * float(np.finfo(numbers.dtype).eps)
    for law, values in zip(EXAMPLES, found, strict=True):
        for i in range(N):
            item = variants(law)[k[i]]
            expected = item.stress(seen[i])[[0, 2, 3]]
            np.testing.assert_allclose(values[i, :3], expected, rtol=1e-6, atol=scale, err_msg=law.NAME)
            energy = float(item.energy(seen[i]))
            assert values[i, 4] == pytest.approx(energy, rel=1e-6, abs=scale), law.NAME


def test_both_mappings_give_the_same_bits() -> None:
    (numbers,) = (p for p in PRECISION if p.name == "fp64")
    one, other = (evaluated(numbers, mapping, states()) for mapping in MAPPINGS)
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("seed", range(5))
def test_the_tangent_bounds_the_stiffness_and_not_by_much(seed: int) -> None:
    (numbers,) = (p for p in PRECISION if p.name == "fp64")
    b_bar, k = states(seed, 0.8), inputs(numbers).k
    found = evaluated(numbers, "simulation", b_bar)[:, 2:, 3]
    seen = as_seen(numbers, b_bar)
    root = np.hypot(0.5 * (seen[:, 0] - seen[:, 1]), seen[:, 2])
    middle = 0.5 * (seen[:, 0] + seen[:, 1])
    lam = np.sqrt(np.stack([middle + root, middle - root, seen[:, 3]], axis=-1))[2:]
    lam[0] *= [1.0, 1.0 + 1e-7, 1.0]  # the twin wants different ones
    mean = (lam**2).mean(axis=1)
    squared = ((lam**2 - mean[:, None]) ** 2).sum(axis=1)
    largest = (lam**2).max(axis=1)
    # What `explicit.elements.base.shear_bound` makes of the tangent, in the axes of b.
    factor = np.minimum(2.0, 1.0 + (mean + 2.0 / 3.0 * squared / mean) / largest)
    for law, tangent in zip(EXAMPLES, found, strict=True):
        exact = np.array([largest_curvature(variants(law)[j], x) for j, x in zip(k[2:], lam, strict=True)])
        known = np.isfinite(exact)
        assert known.any()
        ratio = (tangent * factor)[known] / exact[known]
        assert (ratio > 1.0 - 1e-6).all(), law.NAME  # 1e-6: the two stretches that were held apart
        # Row sums of a matrix of three rows, and a tangent for axes that are turned.
        assert np.median(ratio) < 1.5, law.NAME


def test_at_rest_the_tangent_is_the_shear_modulus() -> None:
    (numbers,) = (p for p in PRECISION if p.name == "fp64")
    found, k = evaluated(numbers, "worker", states()), inputs(numbers).k
    for law, values in zip(EXAMPLES, found, strict=True):
        assert values[0, 3] == pytest.approx(variants(law)[k[0]].shear_modulus, rel=1e-9)


def test_past_locking_gent_is_no_number_and_disturbs_nobody() -> None:
    (numbers,) = (p for p in PRECISION if p.name == "fp64")
    b_bar, place = states(), list(LAWS).index("gent")
    whole = evaluated(numbers, "simulation", b_bar)
    b_bar[[3, 8]] = turned(np.array([40.0, 1.0, 1.0 / 40.0]), 0.1)
    found, others = evaluated(numbers, "simulation", b_bar), np.delete(np.arange(N), [3, 8])
    assert np.isnan(found[place][[3, 8]][:, [0, 1, 2, 4]]).all()  # a bound is the largest of numbers
    np.testing.assert_array_equal(found[:, others], whole[:, others])


# ---- the volumetric law ----------------------------------------------------------------------------------

FORMS = ("quadratic", "logarithmic", "simo_taylor")


@cache
def volume_kernel(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    one = numbers.real(1.0)
    a, b, c = (volumetric_functions(form, numbers) for form in FORMS)
    pa, qa, ra, ea = a.pressure, a.stiffness, a.rank_one, a.energy
    pb, qb, rb, eb = b.pressure, b.stiffness, b.rank_one, b.energy
    pc, qc, rc, ec = c.pressure, c.stiffness, c.rank_one, c.energy

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        K, d = batch.y[sample], batch.x[sample]
        J, out = one + d, output.values[sample]
        if lane == 0:
            out[0] = pa(K, J, d)
            out[1] = qa(K, J, d)
            out[2] = ra(K, J, d)
            out[3] = ea(K, J, d)
            out[4] = pb(K, J, d)
            out[5] = qb(K, J, d)
            out[6] = rb(K, J, d)
            out[7] = eb(K, J, d)
            out[8] = pc(K, J, d)
            out[9] = qc(K, J, d)
            out[10] = rc(K, J, d)
            out[11] = ec(K, J, d)

    return kernel


@pytest.mark.parametrize(("numbers", "mapping"), EVERY)
def test_every_volumetric_form_is_its_twin(numbers: Precision, mapping: Mapping | None) -> None:
    d = np.array([0.0, 1e-12, -1e-9, 1e-5, -1e-3, 0.0199, -0.0201, 0.021, -0.3, 0.4, -0.6, 1.0, -0.9])
    d, bulk = d.astype(numbers.dtype), np.linspace(1e4, 9e6, N).astype(numbers.dtype)
    given = replace(inputs(numbers), x=d, y=bulk)
    launched = (
        scalar_launch(volume_kernel(numbers), numbers, given)
        if mapping is None
        else lane_launch(volume_kernel(numbers), numbers, given, mapping)
    )
    found = launched.values[:, :12].astype(float).reshape(N, 3, 4)
    # A few roundings. Simo and Taylor's energy is a difference, of a share SMALL / 2 of its parts, and below
    # that a series that leaves out SMALL^6 / 8.
    last = 8.0 * float(np.finfo(numbers.dtype).eps)
    for j, form in enumerate(FORMS):
        for i in range(N):
            pressure, stiffness, energy = exact_volume(form, float(bulk[i]), float(d[i]))
            J = 1.0 + float(d[i])
            assert found[i, j, 0] == pytest.approx(pressure, rel=last, abs=1e-30), form
            assert found[i, j, 1] == pytest.approx(max(stiffness, 0.0), rel=last), form
            assert found[i, j, 3] == pytest.approx(energy, rel=max(100.0 * last, 1e-11), abs=1e-30), form
            rank_one = J * (J * stiffness + pressure)
            if form == "quadratic":  # half the modulus where the plain factor would leave it
                rank_one = max(rank_one, 0.5 * float(bulk[i]) * J)
            assert found[i, j, 2] == pytest.approx(rank_one, rel=1e3 * last), form


def exact_volume(form: str, bulk: float, d: float) -> tuple[float, float, float]:
    """U', U'' and U of J = 1 + d with the digits of d."""
    J, log = 1.0 + d, np.log1p(d)
    if form == "quadratic":
        return bulk * d, bulk, 0.5 * bulk * d * d
    if form == "logarithmic":
        return bulk * log / J, bulk * (1.0 - log) / J**2, 0.5 * bulk * log**2
    powers = np.arange(2, 60)
    series = float((2.0 * (-1.0) ** powers * d**powers / powers).sum()) if abs(d) < 0.05 else 2.0 * (d - log)
    return 0.5 * bulk * d * (2.0 + d) / J, 0.5 * bulk * (1.0 + J**-2), 0.25 * bulk * (d * d + series)


@pytest.mark.parametrize("form", FORMS)
def test_the_twins_are_derivatives_of_their_energy(form: str) -> None:
    law, J, h = VolumetricLaw(3e6, form), np.linspace(0.4, 2.5, 40), 1e-5  # type: ignore[arg-type]
    first = (law.energy(J + h) - law.energy(J - h)) / (2.0 * h)
    second = (law.pressure(J + h) - law.pressure(J - h)) / (2.0 * h)
    np.testing.assert_allclose(law.pressure(J), first, atol=3e6 * 1e-8)  # h^2 and rounding over h
    np.testing.assert_allclose(law.stiffness(J), second, atol=3e6 * 1e-8)
    assert law.stiffness(1.0) == pytest.approx(3e6)
    assert (law.pressure(1.0), law.energy(1.0)) == (0.0, 0.0)


def test_a_form_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match=r"volumetric must be one of .*'simo_taylor'\], got 'cubic'"):
        VolumetricLaw(1e6, "cubic")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="bulk must be > 0 Pa and finite, got 0"):
        VolumetricLaw(0.0)

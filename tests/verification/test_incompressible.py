"""Toward nu = 1/2: the cost of direct runs, and a fine mesh corrected on coarse ones."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
import test_which_element as runs
from order import assert_order, fitted_order
from scene import FloatArray, rms, table
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import minimize_scalar
from test_dynamic_bonded import low_pass
from test_which_element import CUTOFF, TRUTH, Mesh, size

from explicit import (
    NearlyIncompressible,
    Outcome,
    Response,
    Samples,
    Stepping,
    cylinder,
    run,
    run_nearly_incompressible,
)
from explicit.incompressible import COMPRESSIBLE
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.settings import Numerics

POISSON = (0.49, 0.495, 0.499, 0.4999)  # Poisson's ratios of the study of steps and time [-]
STUDY: Mesh = (16, 22)  # its mesh
TARGETS = (0.4999, 0.49999)  # nearly incompressible ratios [-]
MESHES: tuple[Mesh, ...] = ((16, 22), (24, 32), (32, 44), (48, 64))  # corrected meshes
CASES: dict[Mesh, tuple[Mesh, Mesh]] = {
    mesh: (half.mesh, less.mesh) for mesh in MESHES for half, less in [Numerics(mesh=mesh).coarser()]
}
"""Fine mesh and the two of the correction, as `kolsky` takes them."""
LADDER: tuple[Mesh, ...] = ((8, 11), (12, 16), (16, 22))
"""Coarse meshes under the fine one of 32 × 44: what the error of the correction converges with."""
FACTORS = TRUTH + 0.006 * np.arange(-1, 7)  # stiffness factors of the batch in which m is identified [-]
IDENTIFIED: Mesh = (24, 32)  # mesh on which m is identified


def samples(poisson: float, factors: FloatArray | float = TRUTH) -> Samples:
    """The shot's parameters with another Poisson's ratio."""
    model = runs.shot().forward.shot.model
    return Samples.of(stiffness_factor=factors, poisson=poisson, damping=model.damping)


@cache
def direct(mesh: Mesh, poisson: float, *, batch: bool = False) -> Response:
    """A direct run, or the batch of `FACTORS`."""
    forward = runs.shot().forward
    given = samples(poisson, FACTORS if batch else TRUTH)
    response = run(forward.model(Numerics(mesh=mesh)), given, replace(forward.sampling, ledger_every=16))
    assert response.completed.all()
    return response


@cache
def corrected(
    mesh: Mesh, coarse: tuple[Mesh, Mesh], poisson: float, *, batch: bool = False
) -> NearlyIncompressible:
    """The run on the fine mesh at nu = 0.495, corrected to another ratio."""
    forward = runs.shot().forward
    return run_nearly_incompressible(
        forward.model(Numerics(mesh=mesh)),
        (forward.mesh(Numerics(mesh=coarse[0])), forward.mesh(Numerics(mesh=coarse[1]))),
        samples(poisson, FACTORS if batch else TRUTH),
        replace(forward.sampling, ledger_every=16),
    )


def smooth(force: FloatArray) -> FloatArray:
    """The 5 kHz part of a force [N]."""
    return low_pass(force, CUTOFF)


def force_difference(mesh: Mesh, poisson: float, coarse: tuple[Mesh, Mesh] | None) -> FloatArray:
    """Transmission force minus the direct run's [N], raw; of the compressible run where `coarse` is None."""
    found = direct(mesh, COMPRESSIBLE) if coarse is None else corrected(mesh, coarse, poisson).response
    return np.asarray(found.force_transmission[0] - direct(mesh, poisson).force_transmission[0])


def radius_difference(mesh: Mesh, poisson: float, coarse: tuple[Mesh, Mesh] | None) -> FloatArray:
    """Radii of the surface minus the direct run's [m]; of the compressible run where `coarse` is None."""
    found = direct(mesh, COMPRESSIBLE) if coarse is None else corrected(mesh, coarse, poisson).response
    return np.asarray(found.surface_r[0] - direct(mesh, poisson).surface_r[0])


@dataclass(frozen=True)
class Correction:
    """A corrected run beside the direct one."""

    cost: float  # element steps over those of the fine mesh at nu = 0.495 [-]
    direct_cost: float  # the same of the direct run [-]
    force: tuple[float, float, float]  # 5 kHz force, rms: error at nu = 0.495, error corrected, estimate [N]
    raw: tuple[float, float, float]  # the same of the raw force [N]
    radius: tuple[float, float, float]  # the same of the surface's radii [m]


@cache
def correction(mesh: Mesh, poisson: float, coarse: tuple[Mesh, Mesh] | None = None) -> Correction:
    """Compare a corrected run with the direct one; `coarse` is that of `CASES` by default."""
    coarse = coarse or CASES[mesh]
    found = corrected(mesh, coarse, poisson)
    errors = [force_difference(mesh, poisson, which) for which in (None, coarse)]
    radii = [radius_difference(mesh, poisson, which) for which in (None, coarse)]
    forces = (*errors, found.force_change[0])
    return Correction(
        cost=float(found.cost[0]),
        direct_cost=float(direct(mesh, poisson).steps[0] / direct(mesh, COMPRESSIBLE).steps[0]),
        force=tuple(rms(smooth(f)) for f in forces),  # type: ignore[arg-type]
        raw=tuple(rms(f) for f in forces),  # type: ignore[arg-type]
        radius=tuple(rms(r) for r in (*radii, found.radius_change[0])),  # type: ignore[arg-type]
    )


def ladder_errors(poisson: float) -> FloatArray:
    """5 kHz force errors of 32 × 44 corrected on each mesh of `LADDER`, rms [N]."""
    smaller: Mesh = (6, 8)
    return np.array([correction((32, 44), poisson, (mesh, smaller)).force[1] for mesh in LADDER])


def identified(response: Response) -> float:
    """The stiffness factor of least joint chi-square of a batch of `FACTORS` [-].

    Noise and discrepancy weigh as in `kolsky identify`: with the noise alone the ringing, which at another nu
    than the shot's has another frequency, would be all that counts.
    """
    found = predict(response, runs.shot().observations)
    objective = Objective(runs.shot().observations, found.inside.all(axis=0))
    vectors = objective.vectors(found)
    for _ in range(3):
        costs = objective.chi2(vectors)
        objective = objective.with_discrepancy(vectors[int(np.argmin(costs))])
    between = BarycentricInterpolator(FACTORS, objective.chi2(vectors))
    bounds = (float(FACTORS[0]), float(FACTORS[-1]))
    return float(minimize_scalar(lambda m: float(between(m)), bounds=bounds, method="bounded").x)


@cache
def limited(max_steps: int) -> NearlyIncompressible:
    """A small case in which the stiff run of the correction may use up its steps before its end."""
    forward = runs.shot().forward
    model = replace(
        forward.model(Numerics(mesh=(6, 8))), mesh=cylinder(4.75e-3, 6.5e-3, n_radial=6, n_axial=8)
    )
    meshes = (
        cylinder(4.75e-3, 6.5e-3, n_radial=5, n_axial=6),
        cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=5),
    )
    stepping = Stepping(max_steps=max_steps)
    return run_nearly_incompressible(model, meshes, samples(0.49999), forward.sampling, stepping=stepping)


COST = 3.5  # largest allowed cost of nu = 0.4999 over nu = 0.495 [-]: what the project asks for
FORCE_TOLERANCE = 6e-3
"""Allowed rms error of the corrected 5 kHz force over its peak [-]: below the 1 % of the solver's other
errors; uncorrected it is 4.4 %."""
RADIUS_TOLERANCE = 10e-6
"""Allowed rms error of the corrected radii [m]: the accuracy of the outline in the experiment, 0.01 mm."""
FACTOR_TOLERANCE = 1e-3
"""Allowed change of m by correcting instead of running directly [-]: a tenth of a usual interval."""
ESTIMATE = 1.5
"""Largest allowed error over its estimate [-]: the estimate is a difference of two errors that need not have
one sign everywhere."""
FINE: Mesh = (32, 44)


Result = SimpleNamespace


@cache
def case() -> Result:
    """Four fine meshes, two ratios, and batches to identify m; about 20 s."""
    wanted = [(mesh, nu) for mesh in CASES for nu in TARGETS if mesh != (48, 64) or nu == TARGETS[0]]
    return Result(
        # by fine mesh and Poisson's ratio
        corrections={(mesh, nu): correction(mesh, nu) for mesh, nu in wanted},
        # fit of the 5 kHz error of 32 × 44 against the coarse mesh's element size
        ladder=fitted_order([size(mesh) for mesh in LADDER], ladder_errors(TARGETS[0])),
        factors=factors(),  # identified m [-]: compressible, direct and corrected
    )


def factors() -> dict[str, float]:
    """Identified m of batches: compressible, direct and corrected."""
    nu, coarse = TARGETS[0], CASES[IDENTIFIED]
    return {
        "compressible": identified(direct(IDENTIFIED, COMPRESSIBLE, batch=True)),
        "direct": identified(direct(IDENTIFIED, nu, batch=True)),
        "corrected": identified(corrected(IDENTIFIED, coarse, nu, batch=True).response),
    }


def peak() -> float:
    """Largest 5 kHz force at nu = 0.4999 [N]."""
    return float(smooth(direct(FINE, TARGETS[0]).force_transmission[0]).max())


def correction_table(result: Result) -> str:
    """Cost and errors of the corrected runs."""
    rows = []
    for (mesh, nu), one in result.corrections.items():
        coarse = ", ".join(f"{a} × {b}" for a, b in CASES[mesh])
        errors = [
            ", ".join(f"{100 * value / peak():.2f}" for value in one.force),
            ", ".join(f"{1e6 * value:.1f}" for value in one.radius),
            ", ".join(f"{value:.1f}" for value in one.raw),
        ]
        costs = [f"{one.direct_cost:.2f}", f"{one.cost:.2f}"]
        rows.append([f"{mesh[0]} × {mesh[1]}", coarse, f"{nu:g}", *costs, *errors])
    header = [
        "mesh", "corrected on", "ν", "cost, direct", "cost", "5 kHz force [%]", "radii [µm]", "raw force [N]",
    ]  # fmt: skip
    return table(header, rows)


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    m, nu, found = result.factors, TARGETS[0], result.corrections
    dear, cheap = found[FINE, TARGETS[1]].direct_cost, found[FINE, TARGETS[1]].cost
    told = {
        name: [getattr(o, name)[2] / getattr(o, name)[1] for o in found.values()]
        for name in ("force", "radius")
    }
    ranges = {name: f"{min(values):.1f} to {max(values):.1f}" for name, values in told.items()}
    first = [one for (_, nu), one in result.corrections.items() if nu == TARGETS[0]]
    force, radius = (max(one.force[1] for one in first) / peak(), max(one.radius[1] for one in first))
    least, most = (min(one.cost for one in first), max(one.cost for one in first))
    return locals()


NU = TARGETS[0]


def hold(one: Correction) -> None:
    """What is asked of every corrected run."""
    assert one.force[1] < FORCE_TOLERANCE * peak()
    assert one.radius[1] < RADIUS_TOLERANCE
    assert one.force[1] < 0.2 * one.force[0]  # or it were not worth its price
    assert one.radius[1] < 0.4 * one.radius[0]
    assert one.force[1] < ESTIMATE * one.force[2]
    assert one.radius[1] < ESTIMATE * one.radius[2]


def test_coarse_mesh() -> None:
    one = correction(STUDY, NU)
    hold(one)
    assert one.cost < COST
    assert one.cost < one.direct_cost


def test_the_ledger_still_balances() -> None:
    energy = corrected(STUDY, CASES[STUDY], NU).response.energy
    assert energy.imbalance().max() < 1e-3  # as of the page on energy


def test_a_run_that_fails_says_so() -> None:
    found = limited(700)
    response = found.response
    assert response.outcomes == (Outcome.STEP_LIMIT,)
    reached = response.force_times <= response.end_times[0]
    assert 0 < reached.sum() < len(reached)
    assert np.isfinite(response.force_flyer[0, reached][:-1]).all()
    assert np.isnan(response.force_flyer[0, ~reached][1:]).all()
    assert np.isnan(response.surface_r[0, -1]).all()
    assert limited(10**6).response.outcomes == (Outcome.COMPLETED,)


def test_cost_counts_every_run() -> None:
    found = corrected(STUDY, CASES[STUDY], NU)
    fine = direct(STUDY, 0.495).steps[0] * STUDY[0] * STUDY[1]
    coarse = sum(mesh[0] * mesh[1] * direct(mesh, nu).steps[0] for mesh in CASES[STUDY] for nu in (0.495, NU))
    assert found.compressible_element_steps[0] == fine
    assert found.element_steps[0] == fine + coarse


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"samples": samples(0.49)}, "poisson must be above compressible = 0.495, got 0.49"),
        ({"sampling": "all"}, "all_nodes is not available"),
        ({"coarse": ((8, 11), (12, 16))}, r"fewer elements than the one before, got \[352, 88, 192\]"),
    ],
)
def test_what_cannot_be_done_is_refused(change: dict[str, object], message: str) -> None:
    forward = runs.shot().forward
    model = forward.model(Numerics(mesh=STUDY))
    coarse = change.get("coarse", ((12, 16), (8, 11)))
    meshes = [forward.mesh(Numerics(mesh=mesh)) for mesh in coarse]  # type: ignore[attr-defined]
    sampling = replace(forward.sampling, all_nodes="sampling" in change)
    with pytest.raises(ValueError, match=message):
        run_nearly_incompressible(
            model,
            (meshes[0], meshes[1]),
            change.get("samples", samples(NU)),  # type: ignore[arg-type]
            sampling,
        )


def test_meshes_of_two_specimens_are_refused() -> None:
    forward = runs.shot().forward
    wide = cylinder(5e-3, 6.5e-3, n_radial=8, n_axial=11)
    mesh = forward.mesh(Numerics(mesh=(12, 16)))
    with pytest.raises(ValueError, match="meshes must be of one specimen, got radius"):
        run_nearly_incompressible(
            forward.model(Numerics(mesh=STUDY)), (mesh, wide), samples(NU), forward.sampling
        )


@pytest.mark.slow
def test_every_mesh_and_ratio() -> None:
    for mesh, nu in [*product(MESHES[:2], TARGETS), (MESHES[2], NU)]:  # the page has the costliest too
        one = correction(mesh, nu)
        hold(one)
        if nu == NU:
            assert one.cost < COST
        assert one.cost < 0.6 * one.direct_cost or one.cost < COST


@pytest.mark.slow
def test_error_falls_with_the_mesh_of_the_correction() -> None:
    sizes = [size(mesh) for mesh in LADDER]
    assert_order(sizes, ladder_errors(NU), 2.0, 0.3, at_least=True)  # second order in space, or better


@pytest.mark.slow
def test_identified_stiffness_is_that_of_direct_runs() -> None:
    m = factors()
    assert m["corrected"] == pytest.approx(m["direct"], abs=FACTOR_TOLERANCE)
    assert abs(m["compressible"] - m["direct"]) > 10 * FACTOR_TOLERANCE  # so the correction matters

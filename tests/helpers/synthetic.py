"""A synthetic but realistic `Identification`: closed-form barrel, smooth force, known noise.

There is no simulation. The volume of the specimen is constant, and the force reaches 70 N after 1.4 ms. Force
and outline depend linearly on the parameters. Every misfit of the design and of the surrogate is computed
from histories, as for real runs.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from explicit import EnergyLedger, Outcome, Response
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse import result
from kolsky.inverse.run_table import DesignTable, Terms

FloatArray = NDArray[np.float64]

RADIUS, LENGTH = 4.75e-3, 6.5e-3
SURROGATE_MESH, (N_RADIAL, N_AXIAL) = (16, 22), (24, 33)
FRAMES, FRAME_RATE = 186, 120e3
SAMPLES, SAMPLE_STEP = 3000, 0.5e-6
BIN = 10e-6
NOISE_FORCE, NOISE_Z = 0.6, 4e-6
TAU_FORCE, TAU_SHAPE = 0.12, 2.5e-6  # discrepancy of the model, in quadrature with the noise
OPTIMUM = {"stiffness_factor": 1.12, "friction": 0.42, "damping": 2.5e-5}
FIXED = {"poisson": 0.499, "damping": 2.5e-5, "friction": 0.5}
UNITS = {"stiffness_factor": "1", "friction": "1", "damping": "s"}
BOUNDS = {"stiffness_factor": (0.75, 1.45), "friction": (0.05, 2.0), "damping": (0.0, 1e-4)}
SIGMA = {"stiffness_factor": 0.0019, "friction": 0.031, "damping": 4e-7}
SIGMA_NUMERICAL = {"stiffness_factor": 0.0016, "friction": 0.012, "damping": 1e-7}
MESH_SHIFT = {"stiffness_factor": -0.0058, "friction": 0.04, "damping": 5e-7}
CHECKS = {
    "flyer_chi2_per_dof": 0.97, "flyer_noise_scale": 1.0, "flyer_static_scatter": 0.93,
    "force_noise_correlation": 0.02, "force_baseline_samples": 400, "curve_last_s": 2.5,
    "curve_last_strain": -0.8,
}  # fmt: skip


def displacement(time: FloatArray) -> FloatArray:
    """Flyer displacement [m]; 59 % of the length at the last frame."""
    return 3.2 * time - 450.0 * time**2


def outline(eta: FloatArray, time: float) -> FloatArray:
    """Radius [m] of the side at the relative height `eta`. The volume is that of the rest state.

    r = R (phi + b g), g = 4 eta (1 - eta) (1 + s (eta - 1/2)); b solves the mean of r^2 = R^2 L / l.
    The skew s of the first wave decays.
    """
    left = 1.0 - displacement(np.array(time)) / LENGTH
    skew = 0.8 * np.exp(-time / 0.3e-3)
    phi = 1.0 + 0.6 * (1.0 - left) ** 2 * 0.5
    mean, square = 2.0 / 3.0, 8.0 / 15.0 + skew**2 * 2.0 / 105.0
    b = (np.sqrt((mean * phi) ** 2 - square * (phi**2 - 1.0 / left)) - mean * phi) / square
    return RADIUS * (phi + b * 4.0 * eta * (1.0 - eta) * (1.0 + skew * (eta - 0.5)))


def force(time: FloatArray) -> FloatArray:
    """Transmitted force [N]: a first wave, then a rise to 70 N at 1.4 ms."""
    ms = 1e3 * time
    rise = 70.0 * np.exp(-(((ms - 1.4) / 0.42) ** 2))
    return rise + 5.0 * np.exp(-(((ms - 0.62) / 0.1) ** 2)) - 2.5 * np.exp(-(((ms - 0.45) / 0.07) ** 2))


def synthetic(
    names: tuple[str, ...] = ("stiffness_factor",),
    *,
    shot: str = "made-up-01",
    nodes: bool = True,
    seed: int = 1,
) -> result.Identification:
    """A result with the free parameters `names` (of `OPTIMUM`)."""
    rng = np.random.default_rng(seed)
    comparison = _comparison(rng)
    design, curves = _design(names, comparison, rng)
    optimum = {name: OPTIMUM[name] for name in names}
    terms = _terms(comparison)
    offsets = {"joint": 0.0, "force only": 0.9, "shape only": -1.6, "paper": 1.3}
    routes = tuple(
        result.Route(
            name=route,
            parameters={n: v + offset * SIGMA[n] for n, v in optimum.items()},
            cost=terms.phi if route == "paper" else terms.chi2,
            sigma={} if route == "paper" else {n: SIGMA[n] * (1.0 + abs(offset)) for n in names},
            correction={} if route == "paper" else {n: 0.1 * MESH_SHIFT[n] for n in names},
            budget=()
            if route == "paper"
            else (result.Contribution("flyer motion", {n: SIGMA[n] * (1.0 + abs(offset)) for n in names}),),
        )
        for route, offset in offsets.items()
    )
    estimates = {
        name: result.Estimate(
            name=name,
            unit=UNITS[name],
            value=OPTIMUM[name],
            sigma_noise=SIGMA[name],
            sigma_numerical=SIGMA_NUMERICAL[name],
            numerical_parts={"mesh": 0.8 * SIGMA_NUMERICAL[name], "roughness": 0.6 * SIGMA_NUMERICAL[name]},
            mesh_shift=MESH_SHIFT[name],
            mesh_correction=0.1 * MESH_SHIFT[name],
            noise_parts={
                "force and shape": 0.8 * SIGMA[name],
                "flyer motion": 0.48 * SIGMA[name],
                "material curve": 0.36 * SIGMA[name],
            },
            outcome=result.Verdict.IDENTIFIED,
        )
        for name in names
    }
    return result.Identification(
        shot=shot,
        estimates=estimates,
        fixed={name: value for name, value in FIXED.items() if name not in names},
        routes=routes,
        route_difference=result.RouteDifference(
            values={n: 2.5 * SIGMA[n] for n in names},
            sigma={n: 2.0 * SIGMA[n] for n in names},
            budget=(
                result.Contribution("force and shape", {n: 1.6 * SIGMA[n] for n in names}),
                result.Contribution("flyer motion", {n: 1.2 * SIGMA[n] for n in names}),
            ),
        ),
        terms=terms,
        comparison=comparison,
        response=_response(nodes),
        mesh=SURROGATE_MESH,
        refined_mesh=(N_RADIAL, N_AXIAL),
        design=design,
        curves=curves,
        surrogate={
            "loo_force": 0.041, "loo_shape": 1.3e-6, "check_force": 0.017, "check_shape": 0.6e-6,
            "counted_points": 2588.0, "force_discrepancy": TAU_FORCE, "shape_discrepancy": TAU_SHAPE,
        },
        warnings=("the made-up specimen does not exist (nominal strain -0.8)", "nor does its flyer"),
        fit=fit(names),
        clocks=(
            result.ClockLag("force", -0.2e-6, 0.5e-6, 0.2, True, "scope.csv", "force.clock_offset"),
            result.ClockLag("outline", 0.1e-6, 0.4e-6, 0.1, True, "outline.csv", "centre_line.frame"),
            result.ClockLag("flyer", 0.1e-6, 0.4e-6, 0.1, True, "flyer.csv", "flyer.frame"),
        ),
        seconds={"design": 8.4, "refinement": 3.2, "check": 11.3, "noise": 4.9},
        provenance=_provenance(seed),
    )  # fmt: skip


def fit(names: tuple[str, ...]) -> tuple[result.FitQuality, result.FitQuality]:
    """The residual of a correct model: as large as predicted."""
    force = result.FitQuality(
        channel="force", unit="N", values=130, residual=0.2, predicted={"noise": 0.12, "flyer motion": 0.16},
        peak=70.0, slow_residual=0.03, slow_expected=0.04, chi2=2.78, discrepancy_share=0.64, correlation=0.3,
        whiteness=0.001, weight=dict.fromkeys(names, 0.7), limit=2.0, slow_limit=2.5,
    )  # fmt: skip
    outline = replace(
        force, channel="outline", unit="m", values=2588, residual=4.1e-6,
        predicted={"noise": 4e-6, "mesh": 1e-6}, peak=2.4e-3, slow_residual=1e-6, slow_expected=1.1e-6,
        chi2=1.05, weight=dict.fromkeys(names, 0.3),
    )  # fmt: skip
    return force, outline


def failed() -> result.Identification:
    """The same shot when no simulation of the design completed: every number that needs a run is NaN."""
    good = synthetic()
    count = len(good.design.outcomes)
    lost = np.full(count, np.nan)
    estimate = replace(
        good.estimates["stiffness_factor"], value=np.nan, sigma_noise=np.nan, sigma_numerical=np.nan,
        mesh_shift=np.nan, noise_parts={}, outcome=result.Verdict.FAILED,
    )  # fmt: skip
    response = good.response
    gone = {n: np.full_like(v, np.nan) for n, v in vars(response.energy).items()}
    nan = float("nan")
    return replace(
        good,
        estimates={"stiffness_factor": estimate},
        routes=(),
        terms=Terms(nan, nan, nan, nan, nan, nan, nan, nan, 0, 0, 0),
        comparison=replace(
            good.comparison,
            force_model=np.full_like(good.comparison.force_model, np.nan),
            Z_model=np.full_like(good.comparison.Z_model, np.nan),
            inside=np.zeros_like(good.comparison.inside),
        ),
        response=replace(
            response,
            force_transmission=np.full_like(response.force_transmission, np.nan),
            surface_r=np.full_like(response.surface_r, np.nan),
            surface_y=np.full_like(response.surface_y, np.nan),
            energy=EnergyLedger(**gone),
            outcomes=(Outcome.INVERTED,),
            failed_elements=np.array([23], dtype=np.int64),
            failed_places=np.array([[0.984 * RADIUS, 0.015 * LENGTH]]),
            nodes=None,
        ),
        design=replace(
            good.design,
            outcomes=("INVERTED",) * count,
            failed_elements=np.full(count, 351),
            failed_places=np.tile([0.97 * RADIUS, 0.98 * LENGTH], (count, 1)),
            phi_shape=lost,
            phi_force=lost,
            chi2_shape=lost,
            chi2_force=lost,
        ),
        curves=(),
        surrogate={},
        fit=(),
        clocks=(),
    )


def _comparison(rng: np.random.Generator) -> result.Comparison:
    time = SAMPLE_STEP * np.arange(SAMPLES)
    recorded = ForceHistory(
        time=time,
        force=force(time) + NOISE_FORCE * rng.standard_normal(SAMPLES),
        sigma=np.full(SAMPLES, NOISE_FORCE),
    )
    per_bin = round(BIN / SAMPLE_STEP)
    centres = time.reshape(-1, per_bin).mean(axis=1)
    frames = np.arange(FRAMES) / FRAME_RATE
    height = LENGTH - displacement(frames)
    # The points move with the material and get closer as the specimen shortens. The last one of the late
    # frames is outside the model's range.
    eta = np.linspace(0.06, 0.95, 14) + 0.004 * rng.standard_normal((FRAMES, 14))
    eta[170:, -1] = 1.02
    frame = np.repeat(np.arange(FRAMES), 14)
    y = (eta * height[:, None]).ravel()
    model = np.concatenate([outline(eta[i], t) for i, t in enumerate(frames)])
    inside = eta.ravel() <= 1.0
    drift = 5e-6 * np.sin(2.0 * np.pi * frames[frame] / 0.9e-3) * np.cos(np.pi * eta.ravel())
    return result.Comparison(
        force_time=centres,
        force_measured=recorded.force.reshape(-1, per_bin).mean(axis=1),
        force_sigma=np.full(centres.size, NOISE_FORCE / np.sqrt(per_bin)),
        force_model=force(centres) + 0.15 * np.sin(2.0 * np.pi * centres / 0.5e-3),
        centre_line=CentreLine(
            time=frames[frame], frame=frame.astype(np.int64), y=y,
            Z=model + drift + NOISE_Z * rng.standard_normal(model.size), sigma=np.full(model.size, NOISE_Z),
        ),
        Z_model=np.where(inside, model, np.nan),
        inside=inside,
        recorded=recorded,
    )  # fmt: skip


def _misfit(parameters: dict[str, float], c: result.Comparison) -> tuple[float, float, float, float]:
    """Phi_S, Phi_F, chi2 shape and chi2 force, with a linear dependence of force and outline on the
    parameters."""
    change = parameters.get("stiffness_factor", OPTIMUM["stiffness_factor"]) - OPTIMUM["stiffness_factor"]
    friction = parameters.get("friction", OPTIMUM["friction"])
    damping = (parameters.get("damping", OPTIMUM["damping"]) - OPTIMUM["damping"]) / OPTIMUM["damping"]
    slip = np.exp(-OPTIMUM["friction"] / 0.25) - np.exp(-friction / 0.25)
    F = c.force_model * (1.0 + 0.85 * change + 0.25 * slip + 0.05 * damping)
    Z = c.Z_model - 60e-6 * (change - 0.8 * slip) * c.centre_line.y / LENGTH
    rF, rZ = F - c.force_measured, (Z - c.centre_line.Z)[c.inside]
    sigma = c.centre_line.sigma[c.inside]
    phi_shape = float(np.mean(np.abs(rZ) / c.centre_line.Z[c.inside]))
    phi_force = float(np.sum(np.abs(rF)) * BIN / SAMPLE_STEP)
    return phi_shape, phi_force, float(np.sum((rZ / sigma) ** 2)), float(np.sum((rF / c.force_sigma) ** 2))


def _terms(c: result.Comparison) -> Terms:
    phi_shape, phi_force, chi2_shape, chi2_force = _misfit({}, c)
    return Terms(
        phi_shape=phi_shape, phi_force=phi_force, phi=phi_force / 1000.0 + phi_shape / 0.001,
        sigma_phi_shape=2.4e-5, sigma_phi_force=41.0, sigma_phi=float(np.hypot(0.041, 0.024)),
        chi2_force=chi2_force, chi2_shape=chi2_shape, n_force=c.force_time.size, n_shape=int(c.inside.sum()),
        n_outside=int((~c.inside).sum()),
    )  # fmt: skip


def _design(
    names: tuple[str, ...], c: result.Comparison, rng: np.random.Generator
) -> tuple[DesignTable, tuple[result.SurrogateCurve, ...]]:
    lower, upper = (np.array([BOUNDS[name][end] for name in names]) for end in (0, 1))
    # One stratum per run and a random order in each column: a Latin hypercube.
    unit = np.stack([(rng.permutation(16) + rng.random(16)) / 16.0 for _ in names], axis=1)
    optimum = np.array([OPTIMUM[name] for name in names])
    near = optimum + 0.03 * (upper - lower) * rng.standard_normal((4, len(names)))
    points = np.concatenate([lower + unit * (upper - lower), near, optimum[None], optimum[None]])
    stage = ("design",) * 16 + ("refinement",) * 4 + ("check",) * 2
    results = np.array([_misfit(dict(zip(names, row, strict=True)), c) for row in points])
    outcomes = ["COMPLETED"] * len(points)
    outcomes[int(np.argmin(points[:, 0]))] = "INVERTED"
    results[int(np.argmin(points[:, 0]))] = np.nan
    good = np.array(outcomes) == "COMPLETED"
    design = DesignTable(
        names=names,
        points=points,
        lower=lower,
        upper=upper,
        outcomes=tuple(outcomes),
        end_times=np.where(good, 1.55e-3, 1.2e-3),
        failed_elements=np.where(good, -1, 351),
        failed_places=np.where(good[:, None], np.nan, [0.97 * RADIUS, 0.98 * LENGTH]),
        stage=stage,
        phi_shape=results[:, 0],
        phi_force=results[:, 1],
        chi2_shape=results[:, 2],
        chi2_force=results[:, 3],
    )
    bin_noise = float(c.force_sigma[0])
    weight_force = bin_noise**2 / (bin_noise**2 + TAU_FORCE**2)
    weight_shape = NOISE_Z**2 / (NOISE_Z**2 + TAU_SHAPE**2)
    curves = []
    for name in names:
        reach = 0.06 * (BOUNDS[name][1] - BOUNDS[name][0])  # the box of the refinement
        x = np.linspace(OPTIMUM[name] - reach, OPTIMUM[name] + reach, 121)
        along = np.array([_misfit({name: value}, c) for value in x])
        curves.append(
            result.SurrogateCurve(
                parameter=name,
                x=x,
                chi2=along[:, 2] * weight_shape + along[:, 3] * weight_force,
                phi_shape=along[:, 0],
                phi_force=along[:, 1],
            )
        )
    return design, tuple(curves)


def _response(with_nodes: bool) -> Response:
    frames = np.arange(FRAMES) / FRAME_RATE
    eta = np.linspace(0.0, 1.0, N_AXIAL + 1)
    height = LENGTH - displacement(frames)
    side_r = np.stack([outline(eta, t) for t in frames])[None]
    side_y = (eta * height[:, None])[None]
    xi = np.linspace(0.0, 1.0, N_RADIAL + 1)
    r = side_r[0, :, :, None] * xi
    y = np.broadcast_to(side_y[0, :, :, None], r.shape)
    force_times = BIN * np.arange(151)
    F = force(force_times)[None]
    work = np.array([np.trapezoid(force(t := np.linspace(0, end, 400)), displacement(t)) for end in frames])
    rate = np.gradient(displacement(frames), frames)
    kinetic = 0.5 * 870.0 * np.pi * RADIUS**2 * LENGTH * rate**2 * 0.4 * (1.0 - np.exp(-frames / 0.2e-3))
    external = work + kinetic + 2e-3 * frames / frames[-1]
    parts = {
        "elastic": 0.9 * work, "damping": 0.06 * work, "friction": 0.02 * work, "hourglass": 0.004 * work,
        "hourglass_damping": 0.002 * work, "impact": 1e-3 * frames / frames[-1], "viscous": 0.0 * frames,
        "kinetic": kinetic,
    }  # fmt: skip
    lost = 2e-4 * external * np.sin(frames / 0.2e-3)
    parts["elastic"] = external - lost - sum(v for n, v in parts.items() if n != "elastic")
    return Response(
        force_times=force_times,
        force_flyer=F + 3.0,
        force_transmission=F,
        impulse_flyer=np.cumsum(F + 3.0, axis=1) * BIN,
        impulse_transmission=np.cumsum(F, axis=1) * BIN,
        surface_times=frames,
        surface_r=side_r,
        surface_y=side_y,
        energy=EnergyLedger(external=external[None], **{n: v[None] for n, v in parts.items()}),
        outcomes=(Outcome.COMPLETED,),
        failed_elements=np.array([-1], dtype=np.int64),
        failed_places=np.full((1, 2), np.nan),
        end_times=np.array([frames[-1]]),
        steps=np.array([12345], dtype=np.int64),
        smallest_step=np.array([7.7e-8]),
        extrapolated_share=np.array([0.031]),
        largest_strain_measure=np.array([2.36]),
        nodes=np.stack([r, y], axis=-1).reshape(1, FRAMES, -1, 2) if with_nodes else None,
    )


def _provenance(seed: int) -> dict[str, object]:
    return {
        "specimen": {"diameter": 2.0 * RADIUS, "length": LENGTH, "density": 870.0},
        "interface": {"faces": "bonded", "side": "rough"},
        "support": "rigid",
        "window_s": [0.0, 1.5e-3],
        "checks": CHECKS,
        "inputs": {"scope.csv": "9f" * 32, "centreline.csv": "0a" * 32, "flyer.csv": "c3" * 32},
        "settings": {"design": {"kind": "latin hypercube", "runs": 16}, "damping_law": "deviatoric"},
        "versions": {"kolsky": "0.1.0", "numpy": "2.1.0", "warp": "1.8.0"},
        "seed": seed,
        "machine": "x86-64, 2 cores",
        "precision": "float64",
    }


EVIL = "<b>x</b>"
RESULTS = {
    "one": synthetic(),
    "two": synthetic(("stiffness_factor", "friction"), shot=EVIL),
    "damping": synthetic(("stiffness_factor", "damping")),
    "failed": failed(),
}

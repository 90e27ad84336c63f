"""What a user must know before using an answer: one sentence each, with the value and what to do."""

from collections.abc import Iterator, Mapping
from math import hypot, isfinite, sqrt
from typing import Any

import numpy as np

from explicit import Response
from kolsky.apparatus import Interface
from kolsky.identification import DesignTable, Identification, Verdict
from kolsky.methods import disagreements
from kolsky.results.text import worst_imbalance

PAST_CURVE = 0.01
"""Share of the specimen past the quasi-static curve from which on it is said."""
SIGMA_RATIO = 1.3
"""A declared sigma is not believable when the data say this many times more or less."""
WHITE = 3.0
"""Noise is not white when its lag-1 correlation is beyond this many times 1 / sqrt(samples)."""
RESIDUALS = "force and shape"
"""The part of an estimate's noise that comes from the residuals."""
IMBALANCE = 0.01
"""Share of the external work that may be unaccounted for before it is said."""
ARTIFICIAL = 0.01
"""Energy of hourglass control over the strain energy from which on it is said."""


def cautions(
    result: Identification, *, checks: Mapping[str, float], interface: Interface, lost_replicates: int = 0
) -> tuple[str, ...]:
    """Everything about a result that a user should know before using it, gravest first.

    Parameters
    ----------
    result
        The finished identification; its own `warnings` are not read.
    checks
        The figures of `kolsky.prepare.Prepared.checks`.
    interface
        The interface as the shot declares it.
    lost_replicates : int
        Runs of the noise stage that did not complete.

    Returns
    -------
    tuple of str
        One sentence each, without a final stop; empty if there is nothing to say.
    """
    return tuple(
        [
            *_disagreement(result),
            *_force_alone(result),
            *_routes(result),
            *_methods(result),
            *_bounds(result),
            *_past_curve(result, checks),
            *_conditioned(checks),
            *_energy(result),
            *hourglass(result.response),
            *_lost(result, lost_replicates),
            *_outside(result),
            *_symmetry(checks),
            *_flyer(checks),
            *_force_noise(checks),
            *_outline_noise(result),
            *_numerical(result),
            *_left_out(result),
            *sliding(interface, [*result.estimates, *_held(result)]),
        ]
    )


def past_curve(share: float, reached: float, checks: Mapping[str, float]) -> Iterator[str]:
    """Say that the material was strained beyond what the quasi-static test covers.

    Parameters
    ----------
    share : float
        Largest share of the specimen's volume past the curve [-].
    reached : float
        Largest s = sqrt(I1 - 3) [-].
    checks
        "curve_last_s" and "curve_last_strain" of `kolsky.prepare.Prepared.checks`.
    """
    if share > PAST_CURVE:
        last, strain = checks["curve_last_s"], checks["curve_last_strain"]
        yield (
            f"{100.0 * share:.0f} % of the specimen's volume was strained past the quasi-static curve: "
            f"s = sqrt(I1 - 3) reached {reached:.3g}, the curve ends at {last:.3g} (nominal strain "
            f"{strain:+.2g}); from there the law goes on without a test that supports it. "
            f"A curve to a nominal strain of {equivalent_strain(reached, strain):+.2g} would cover it"
        )


def hourglass(response: Response) -> Iterator[str]:
    """Say that hourglass control took part in the answer of the batch's first simulation."""
    if not response.outcomes[0].ok:
        return
    share = float(response.energy.artificial_share()[0])
    if share > ARTIFICIAL:
        yield (
            f"hourglass control stored and dissipated {100.0 * share:.2g} % of the strain energy; refine the "
            "mesh, or check with --element fbar"
        )


def lost_runs(table: DesignTable, rest: str = "") -> Iterator[str]:
    """Count the runs that did not complete, by stage and `explicit.Outcome`, and tell the first of each kind.

    Parameters
    ----------
    table
        Every run.
    rest : str
        What the others are for, said behind the count.
    """
    kinds: dict[str, list[int]] = {}
    for run in table.lost:
        kinds.setdefault(f"{table.stage[run]}: {table.outcomes[run]}", []).append(run)
    if kinds:
        counts = ", ".join(f"{len(runs)} in {kind}" for kind, runs in kinds.items())
        yield f"{len(table.lost)} of {len(table.outcomes)} runs did not complete ({counts}){rest}"
    for runs in kinds.values():
        values = zip(table.names, table.points[runs[0]], strict=True)
        point = ", ".join(f"{name} = {value:.4g}" for name, value in values)
        yield f"run {runs[0]} ({point}) ended {table.ending(runs[0]).sentence}"


def sliding(interface: Interface, named: list[str]) -> Iterator[str]:
    """Say that naming `friction` replaced the declared interface; see `kolsky.forward.Forward.run`."""
    if "friction" in named and {interface.faces, interface.side} != {"coulomb"}:
        yield (
            "with friction as a parameter, Coulomb's law replaced the interface that the shot declares "
            f"(faces {interface.faces}, side {interface.side}): the specimen may slide and lift off"
        )


def equivalent_strain(s: float, branch: float) -> float:
    """Nominal strain of a uniaxial test with the same I1: lam^2 + 2 / lam = 3 + s^2 on one branch."""
    roots = np.roots([1.0, 0.0, -(3.0 + s**2), 2.0]).real
    lam = roots.max() if branch > 0.0 else roots[roots > 0.0].min()
    return float(lam - 1.0)


def _held(result: Identification) -> Mapping[str, Any]:
    held = result.provenance.get("settings", {}).get("held", {})
    return held if isinstance(held, Mapping) else {}


def _disagreement(result: Identification) -> Iterator[str]:
    if any(e.outcome is Verdict.DISAGREEING for e in result.estimates.values()):
        shift = result.surrogate.get("check_shift_sigmas")
        by = "" if shift is None else f": the last one still moved the optimum by {shift:.2g} sigma"
        needed, cure = result.surrogate.get("runs_needed"), ""
        if needed is not None:
            cure = (
                f"; about {needed:.0f} runs around the optimum would do"
                if isfinite(needed)
                else "; more runs would hardly help, because the response is rough: shrink the bounds"
            )
        yield (
            f"the check run on the refined mesh does not confirm the surrogate{by}; do not use the "
            f"value{cure}"
        )


def _force_alone(result: Identification) -> Iterator[str]:
    """Without an outline nothing contradicts a wrong model."""
    if np.isfinite(result.terms.chi2_force) and not result.terms.has_shape:
        yield (
            "no outline was measured: the value rests on the force alone, and nothing shows whether the "
            "specimen deformed as the model says, slid on the platens or was of another length"
        )


def _routes(result: Identification) -> Iterator[str]:
    """Force and shape are two measurements of one specimen: their optima must agree.

    A route's own sigma is from its residuals; flyer, curve and mesh shift the two optima by amounts of their
    own and are counted once.
    """
    routes = {route.name: route for route in result.routes}
    if not {"force only", "shape only"} <= set(routes):
        return
    force, shape = routes["force only"], routes["shape only"]
    boxes = {curve.parameter: (curve.x[0], curve.x[-1]) for curve in result.curves}
    for name, e in result.estimates.items():
        a, b = force.parameters[name], shape.parameters[name]
        inputs = [sigma for source, sigma in e.noise_parts.items() if source != RESIDUALS]
        both = 2.0 * hypot(force.sigma[name], shape.sigma[name], e.sigma_numerical, *inputs)
        if abs(a - b) > both:
            low, high = boxes.get(name, (-np.inf, np.inf))
            near = 1e-4 * (high - low) if np.isfinite(high - low) else 0.0
            edge = any(min(x - low, high - x) <= near for x in (a, b))
            yield (
                f"force and shape disagree about {name}: {a:.5g} by the force alone, {b:.5g} by the shape "
                f"alone, further apart than the k = 2 uncertainty of their difference, {both:.2g}"
                f"{' (and one of them at the edge of the box that was searched)' if edge else ''}; the joint "
                "value is a compromise between them"
            )


def _methods(result: Identification) -> Iterator[str]:
    """Searches of one misfit must end at one point, or it has more than one valley, or is rough."""
    for method, name, distance in disagreements(result.methods):
        if isfinite(distance):
            yield (
                f"methods disagree about {name}: {method.name} ends at {method.values[name]:.5g}, "
                f"{abs(distance):.2g} of the k = 2 half width from the answer ({method.ended})"
            )
        else:
            yield f"{method.name} has no value of {name} to compare ({method.ended})"


def _bounds(result: Identification) -> Iterator[str]:
    """An interval that leaves the design rests on no run there."""
    design = result.design
    for i, name in enumerate(design.names):
        e, low, high = result.estimates[name], design.lower[i], design.upper[i]
        good = e.outcome in (Verdict.IDENTIFIED, Verdict.FORCE_ALONE)
        if good and not low <= e.interval[0] <= e.interval[1] <= high:
            yield (
                f"the k = 2 interval of {name} reaches past the bounds of its design ({low:g} to {high:g}); "
                f"widen them with --free {name}=LOW:HIGH, if a value beyond is possible"
            )


def _conditioned(checks: Mapping[str, float]) -> Iterator[str]:
    if "conditioned_ratio" in checks:
        ratio = checks["conditioned_ratio"]
        yield (
            f"m refers to the first pull; the conditioned curve's stress is {ratio:.3g} times that, so m "
            f"would be about {1.0 / ratio:.3g} times as large against it: --pull conditioned identifies it"
        )


def _past_curve(result: Identification, checks: Mapping[str, float]) -> Iterator[str]:
    response = result.response
    return past_curve(
        float(response.extrapolated_share[0]), float(response.largest_strain_measure[0]), checks
    )


def _energy(result: Identification) -> Iterator[str]:
    imbalance = worst_imbalance(result.response)
    if imbalance > IMBALANCE:
        yield f"{100.0 * imbalance:.2g} % of the simulation's external work is not accounted for"


def _lost(result: Identification, lost_replicates: int) -> Iterator[str]:
    yield from lost_runs(result.design, "; the surrogate rests on the others")
    if lost_replicates:
        yield (
            f"{lost_replicates} replicates of the input noise did not complete; the interval rests on the "
            "others"
        )


def _outside(result: Identification) -> Iterator[str]:
    t = result.terms
    if t.n_outside:
        yield (
            f"{t.n_outside} of {t.n_outside + t.n_shape} outline points lie outside the simulated outline "
            "at the optimum and are not counted"
        )
    searched = result.surrogate.get("counted_points", float(t.n_shape))
    if searched < t.n_shape:
        yield (
            f"{t.n_shape - searched:.0f} of {t.n_shape} outline points were not counted in the search, "
            "because some run of the design does not reach them"
        )


def _symmetry(checks: Mapping[str, float]) -> Iterator[str]:
    end, last = checks.get("symmetry_end", float("inf")), checks.get("window_end", 0.0)
    if end <= last:
        yield (
            f"the flyer leaves its first direction at {1e3 * end:.4g} ms, before the window ends at "
            f"{1e3 * last:.4g} ms: the model is one of revolution; end the window there"
        )
    elif isfinite(end):
        yield f"the window ends at {1e3 * last:.4g} ms, where the flyer leaves its first direction"


def _flyer(checks: Mapping[str, float]) -> Iterator[str]:
    if "front_noise_scale" in checks:
        scale = checks["front_noise_scale"]
        if scale > SIGMA_RATIO:
            yield (
                f"the front face's velocity scatters {scale:.2g} times as much as the gauges' noise and was "
                "taken so uncertain; check the windows and the dispersion correction"
            )
        return
    scale, chi2 = checks["flyer_noise_scale"], checks["flyer_chi2_per_dof"]
    if scale > SIGMA_RATIO:
        yield (
            f"the flyer's noise is {scale:.2g} times its declared sigma and was taken so large; check "
            "flyer.sigma, or whether the flyer rings"
        )
    elif not SIGMA_RATIO**-2 <= chi2 <= SIGMA_RATIO**2:
        which = "small" if chi2 > 1.0 else "large"
        yield (
            f"the flyer's path has chi-square {chi2:.2g} per degree of freedom where 1 is expected: its "
            f"declared sigma is about {max(chi2, 1.0 / chi2) ** 0.5:.2g} times too {which}; check flyer.sigma"
        )


def _force_noise(checks: Mapping[str, float]) -> Iterator[str]:
    if "force_noise_correlation" not in checks:
        return  # a force from bar waves: its noise is the reduction's affair
    c, n = checks["force_noise_correlation"], checks["force_baseline_samples"]
    limit = WHITE / sqrt(n)
    if abs(c) > limit:
        yield (
            f"the force's baseline noise is not white: neighbouring samples correlate by {c:.2g} (white "
            f"noise: within {limit:.2g}), so the sigma of a bin's mean is wrong by a factor of about "
            f"{sqrt((1.0 + c) / (1.0 - c)):.2g}"
        )


def _outline_noise(result: Identification) -> Iterator[str]:
    """Residuals above the noise are the model's and are weighted so; below it only sigma can be wrong."""
    t = result.terms
    if t.n_shape and isfinite(t.chi2_shape) and t.chi2_shape / t.n_shape < SIGMA_RATIO**-2:
        ratio = sqrt(t.n_shape / t.chi2_shape)
        yield (
            f"the outline's residuals are {ratio:.2g} times smaller than its declared sigma, which cannot "
            "be right; check centre_line.sigma"
        )


def _numerical(result: Identification) -> Iterator[str]:
    for name, e in result.estimates.items():
        rough = e.numerical_parts.get("roughness", 0.0)
        mesh = e.numerical_parts.get("mesh", e.sigma_numerical)
        if mesh > e.sigma_noise:
            yield (
                f"the mesh contributes more to the uncertainty of {name} ({mesh:.2g}) than the "
                f"measured noise ({e.sigma_noise:.2g}); refine both meshes"
            )
        if rough > e.sigma_noise:
            yield (
                f"the simulated response is so rough that it contributes more to the uncertainty of {name} "
                f"({rough:.2g}) than the measured noise ({e.sigma_noise:.2g}); refine both meshes, or hold "
                "another parameter"
            )


def _left_out(result: Identification) -> Iterator[str]:
    for source in ("flyer motion", "material curve"):
        if not any(source in e.noise_parts for e in result.estimates.values()) and result.estimates:
            yield f"the interval leaves out the noise of the {source}"

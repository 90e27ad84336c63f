"""Warnings on an answer, most serious first: one sentence each, with the value and the remedy."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite, sqrt

import numpy as np

from explicit import Mesh, Response
from explicit.mesh import corner_areas
from kolsky.base.apparatus import SLIDING_LAW, Interface
from kolsky.inverse.parameters import any_slides, slides
from kolsky.inverse.result import Estimate, Identification, Verdict, disagreements, worst_imbalance
from kolsky.inverse.run_table import DesignTable
from kolsky.shot.curve import PAST_CURVE
from kolsky.uncertainty.mesh_error import LostRun

SIGMA_RATIO = 1.3
"""A declared sigma is implausible if the scatter of the data differs by this factor or more."""
WHITE = 3.0
"""Noise is not white if its lag-1 correlation exceeds this many times 1 / sqrt(samples)."""


def symmetry_warning(checks: Mapping[str, float]) -> Iterator[str]:
    """Warning if the window ends when the flyer leaves its first direction, or later."""
    end, last = checks.get("symmetry_end", float("inf")), checks.get("window_end", 0.0)
    if end <= last:
        yield (
            f"the flyer's direction changes at {1e3 * end:.4g} ms, before the window ends at "
            f"{1e3 * last:.4g} ms: the model is axisymmetric; end the window there"
        )
    elif isfinite(end):
        yield f"the window ends at {1e3 * last:.4g} ms, where the flyer's direction changes"


def flyer_warnings(checks: Mapping[str, float]) -> Iterator[str]:
    """Warning if the flyer's path, or the front face's velocity, scatters more or less than declared."""
    if "front_noise_scale" in checks:
        scale = checks["front_noise_scale"]
        if scale > SIGMA_RATIO:
            yield (
                f"the front face's velocity scatters {scale:.2g} times as much as the gauges' noise, and "
                "the larger value was used; check the windows and the dispersion correction"
            )
        return
    scale, chi2 = checks["flyer_noise_scale"], checks["flyer_chi2_per_dof"]
    if scale > SIGMA_RATIO:
        yield (
            f"the flyer's noise is {scale:.2g} times its declared sigma, and the larger value was used; "
            "check flyer.sigma, or whether the flyer rings"
        )
    elif not SIGMA_RATIO**-2 <= chi2 <= SIGMA_RATIO**2:
        which = "small" if chi2 > 1.0 else "large"
        yield (
            f"the flyer's path has chi-square {chi2:.2g} per degree of freedom where 1 is expected: its "
            f"declared sigma is about {max(chi2, 1.0 / chi2) ** 0.5:.2g} times too {which}; check flyer.sigma"
        )


def force_noise_warnings(checks: Mapping[str, float]) -> Iterator[str]:
    """Warning if the noise of the force is not white. The sigma of a bin assumes white noise."""
    if "force_noise_correlation" not in checks:
        return  # a force from bar waves: its noise is handled by the wave reduction
    c, n = checks["force_noise_correlation"], checks["force_baseline_samples"]
    limit = WHITE / sqrt(n)
    if abs(c) > limit:
        yield (
            f"the force's baseline noise is not white: neighbouring samples correlate by {c:.2g} (white "
            f"noise: within {limit:.2g}), so the sigma of a bin's mean is wrong by a factor of about "
            f"{sqrt((1.0 + c) / (1.0 - c)):.2g}"
        )


def lost_mesh_runs(lost: Sequence[LostRun], coarse: tuple[int, int]) -> Iterator[str]:
    """Report failed runs of `kolsky.uncertainty.mesh_error.MeshChange`, and the formula used instead.
    ``coarse``: elements of the search mesh.
    """
    for run in lost:
        across, along = run.numerics.mesh
        why = f" ({run.why})" if run.why else ""
        if run.is_graded:
            yield (
                f"the run at the answer on the graded mesh of {across} x {along} elements failed{why}; "
                "the correction for the mesh and its part of the interval come from the coarser mesh of "
                f"{coarse[0]} x {coarse[1]} elements, which usually makes that part longer: give another "
                "--refined-mesh, or end the [window] before it"
            )
        else:
            yield (
                f"the run at the answer with {run.numerics.element} elements on {across} x {along} "
                f"failed{why}; the mesh error was estimated by extrapolation only (usually larger): give "
                "another --mesh, or end the [window] before it"
            )


FOLDED = -0.4
"""The edge is reported as folded if an element's corner has a smaller area than this, relative to its
undeformed area [-]. The limit was chosen on impacts with friction of 0.1, 0.3 and 0.5, and validated on
random ones (docs/validation/folding)."""
ARTIFICIAL = 0.01
"""Energy of hourglass control above which it is reported, divided by the strain energy."""


def past_curve_warning(share: float, reached: float, checks: Mapping[str, float]) -> Iterator[str]:
    """Warning if the material was strained beyond the end of the quasi-static curve.

    ``share``: largest share of the specimen's volume past the curve [-]. ``reached``: largest s = sqrt(I1 -
    3) [-]. ``checks``: "curve_last_s", "curve_last_strain" of `kolsky.inverse.problem.PreparedShot.checks`.
    """
    if share > PAST_CURVE:
        last, strain = checks["curve_last_s"], checks["curve_last_strain"]
        yield (
            f"{100.0 * share:.0f} % of the specimen's volume was strained past the quasi-static curve: "
            f"s = sqrt(I1 - 3) reached {reached:.3g}, the curve ends at {last:.3g} (nominal strain "
            f"{strain:+.2g}); the law is extrapolated there. "
            f"A curve to a nominal strain of {equivalent_strain(reached, strain):+.2g} would cover it"
        )


def hourglass_warning(response: Response) -> Iterator[str]:
    """Warning if hourglass control has a significant energy in the batch's first simulation."""
    if not response.outcomes[0].ok:
        return
    share = float(response.energy.artificial_share()[0])
    if share > ARTIFICIAL:
        yield (
            f"hourglass control stored and dissipated {100.0 * share:.2g} % of the strain energy; refine the "
            "mesh, or check with --element fbar"
        )


def folded_warning(
    response: Response, mesh: Mesh, interface: Interface, named: Sequence[str]
) -> Iterator[str]:
    """Warning if the edge of a sliding specimen folded over in the batch's first simulation.

    If a face slides with friction and its edge rolls onto the platen, the elements there are bent into a
    fold. A corner may be turned inside out by more than `FOLDED`. The edge then separates and jumps along the
    platen by up to 0.2 mm, although the run completes (docs/validation/folding).

    ``response``: not checked without nodes. ``interface``: as the shot declares it. ``named``: parameters;
    one that causes sliding replaces that interface.
    """
    if not slides(interface, named) or response.nodes is None or not response.outcomes[0].ok:
        return
    worst = corner_areas(mesh, response.nodes[0]).min(axis=2)
    over = np.flatnonzero((worst < FOLDED).any(axis=1))
    if over.size:
        time, element = response.surface_times[over[0]], int(np.argmin(worst[over[0]]))
        r, y = mesh.nodes[mesh.quads[element]].mean(axis=0)
        yield (
            f"from {1e6 * time:.0f} us on the sliding edge is folded over (element {element} at R = "
            f"{1e3 * r:.2f} mm, Y = {1e3 * y:.2f} mm has a corner turned inside out): the edge may jump "
            "along the platen, and the radii of edge and contact are uncertain by 0.2 mm; compare with "
            "--element fbar, end the window earlier, or prevent slip of the face"
        )


def lost_runs(table: DesignTable, rest: str = "") -> Iterator[str]:
    """Count the failed runs by stage and `explicit.Outcome`, then ``rest``; describe one of each kind."""
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


def rerun_advice(damaged: Sequence[str]) -> Iterator[str]:
    """Report runs that were damaged in a ledger and therefore repeated."""
    if damaged:
        said = ", ".join(damaged[:5]) + (", ..." if len(damaged) > 5 else "")
        yield (
            f"{len(damaged)} runs in the ledger were damaged ({said}) and were run again: check the disk "
            "of the ledger"
        )


def sliding_warning(interface: Interface, named: list[str]) -> Iterator[str]:
    """Warning if a named parameter that causes sliding replaced the declared interface (`Forward.run`)."""
    names = [name for name in named if any_slides([name])]
    if names and {interface.faces, interface.side} != {SLIDING_LAW}:
        yield (
            f"with {names[0]} as a parameter, Coulomb's law replaced the interface that the shot declares "
            f"(faces {interface.faces}, side {interface.side}): the specimen may slide and lift off"
        )


def equivalent_strain(s: float, branch: float) -> float:
    """Nominal strain of a uniaxial test with the same I1, from lam^2 + 2 / lam = 3 + s^2 on one branch."""
    roots = np.roots([1.0, 0.0, -(3.0 + s**2), 2.0]).real
    lam = roots.max() if branch > 0.0 else roots[roots > 0.0].min()
    return float(lam - 1.0)


DISAGREE = 2.5
"""Force and outline disagree if they differ by more than this many standard uncertainties of their
difference. With 2.0, one correct shot in twenty would be reported with one parameter, and one in seven with
three."""
HALF = 0.5
"""The mesh error is reported if the interval would be shorter than this share without it."""
IMBALANCE = 0.01
"""A missing share of the external work above this is reported."""


def _unit(e: Estimate) -> str:
    """The unit after a number; text and files are in SI."""
    return "" if e.unit == "1" else f" {e.unit}"


def _route_disagreement(result: Identification) -> Iterator[str]:
    """Warning if the check run does not confirm the surrogate."""
    if any(e.outcome is Verdict.DISAGREEING for e in result.estimates.values()):
        shift = result.surrogate.get("check_shift_sigmas")
        by = "" if shift is None else f": the last one still moved the optimum by {shift:.2g} sigma"
        cure = (
            "its steps start from the optimum on --mesh: give a finer one, such as 32x43, or hold what the "
            "data hardly determine (--hold)"
        )
        if any("roughness" in e.numerical_parts for e in result.estimates.values()):
            cure = "the response is rough: shrink the bounds (--free NAME=LOW:HIGH)"
        yield (
            f"the check run on the refined mesh does not confirm the surrogate{by}; do not use the value; "
            f"{cure}"
        )


def route_warnings(result: Identification) -> Iterator[str]:
    """Warning if force and outline disagree about a parameter
    (`kolsky.uncertainty.budgets.route_difference`).
    """
    difference, routes = result.route_difference, {route.name: route for route in result.routes}
    if difference is None or not {"force only", "shape only"} <= set(routes):
        return
    force, shape = routes["force only"], routes["shape only"]
    boxes = {curve.parameter: (curve.x[0], curve.x[-1]) for curve in result.curves}
    for name, e in result.estimates.items():
        both = DISAGREE * difference.sigma[name]
        if abs(difference.values[name]) > both:
            low, high = boxes.get(name, (-np.inf, np.inf))
            near = 1e-4 * (high - low) if np.isfinite(high - low) else 0.0
            edge = any(min(x - low, high - x) <= near for x in (force.on_mesh(name), shape.on_mesh(name)))
            yield (
                f"force and outline disagree about {name}: {force.parameters[name]:.5g} by the force alone, "
                f"{shape.parameters[name]:.5g} by the outline alone, further apart than the k = {DISAGREE:g} "
                f"uncertainty of their difference, {both:.2g}"
                f"{_unit(e)}{' (and one of them at the edge of the box that was searched)' if edge else ''}; "
                "the joint value is a compromise between them"
            )


def bound_warnings(result: Identification) -> Iterator[str]:
    """Warning if an interval extends beyond the design. There are no runs outside the design."""
    design = result.design
    for i, name in enumerate(design.names):
        e, low, high = result.estimates[name], design.lower[i], design.upper[i]
        judged = e.outcome.identified or e.outcome is Verdict.BOUND_REACHED
        if judged and not low <= e.value - 2.0 * e.sigma <= e.value + 2.0 * e.sigma <= high:
            yield (
                f"the k = 2 interval of {name} reaches past the bounds of its design ({low:g} to {high:g}); "
                f"widen them with --free {name}=LOW:HIGH, if a value beyond is possible"
            )


def mesh_warnings(result: Identification) -> Iterator[str]:
    """Warning if the interval without the mesh error would be half as long, or if the misfit is rough."""
    for name, e in result.estimates.items():
        rough = e.numerical_parts.get("roughness", 0.0)
        mesh = e.numerical_parts.get("mesh", e.sigma_numerical)
        without = sqrt(max(e.sigma**2 - mesh**2, 0.0))
        if without < HALF * e.sigma:
            yield (
                f"the mesh contributes most of the uncertainty of {name}: U (k = 2) is "
                f"{2.0 * e.sigma:.2g}{_unit(e)} and would be {2.0 * without:.2g}{_unit(e)} without it; if "
                "that is too large, refine both meshes (--mesh, --refined-mesh)"
            )
        if rough > e.sigma_noise:
            low, high = e.value - 2.0 * rough, e.value + 2.0 * rough
            yield (
                f"the simulated response is so rough that it contributes more to the uncertainty of {name} "
                f"({rough:.2g}) than the measured noise ({e.sigma_noise:.2g}): between "
                f"{low:.5g} and {high:.5g}{_unit(e)} the misfit is flat to within its jumps; refine both "
                "meshes, or hold another parameter"
            )


def collect_warnings(
    result: Identification,
    *,
    checks: Mapping[str, float],
    interface: Interface,
    lost_replicates: int = 0,
    mesh: Mesh | None = None,
    lost_meshes: Sequence[LostRun] = (),
) -> tuple[str, ...]:
    """The warnings of a result, most serious first: one sentence each, without a full stop.

    ``checks``: figures of `kolsky.inverse.problem.PreparedShot.checks`. ``interface``: as the shot declares
    it. ``lost_replicates``: failed runs of the noise stage. ``mesh``: of the check run; None to skip the
    check of its elements. ``lost_meshes``: failed runs for the mesh error.
    """
    held, response, t = result.provenance.get("settings", {}).get("held", {}), result.response, result.terms
    named, routes = [*result.estimates, *held], {route.name for route in result.routes}
    share, reached = float(response.extrapolated_share[0]), float(response.largest_strain_measure[0])
    said = [*_route_disagreement(result)]
    if np.isfinite(t.chi2_force) and not t.has_shape:
        said.append(
            "no outline was measured: the value depends on the force only, and nothing shows whether the "
            "specimen deformed as in the model, slid on the platens or was of another length"
        )
    said += route_warnings(result)
    for method, name, distance in disagreements(result.methods):
        said.append(f"{method.name} has no value of {name} to compare ({method.ended})")
        if isfinite(distance):
            said[-1] = (
                f"methods disagree about {name}: {method.name} ends at {method.values[name]:.5g}"
                f"{_unit(result.estimates[name])}, {abs(distance):.2g} of the k = 2 half width from the "
                f"answer ({method.ended})"
            )
    if "shape only" in routes and "paper" not in routes:
        said.append(
            "no surrogate can be fitted to the cost Phi of Eq. (M.5) over the runs: the optimum of that cost "
            "is left out, and the answer does not depend on it"
        )
    said += [*bound_warnings(result), *past_curve_warning(share, reached, checks)]
    if "conditioned_ratio" in checks:
        ratio = checks["conditioned_ratio"]
        said.append(
            f"m refers to the first pull; the stress of the conditioned curve is {ratio:.3g} times as "
            f"large, and m relative to it would be about {1.0 / ratio:.3g} times as large: --pull "
            "conditioned identifies it"
        )
    if (imbalance := worst_imbalance(response)) > IMBALANCE:
        said.append(f"{100.0 * imbalance:.2g} % of the simulation's external work is not accounted for")
    said += hourglass_warning(response)
    said += [] if mesh is None else folded_warning(response, mesh, interface, named)
    said += lost_runs(result.design, "; the surrogate uses the others")
    if lost_replicates:
        said.append(
            f"{lost_replicates} replicates of the input noise did not complete; the interval uses the others"
        )
    if t.n_outside:
        said.append(
            f"{t.n_outside} of {t.n_outside + t.n_shape} outline points lie outside the simulated outline "
            "at the optimum and are not counted"
        )
    searched = result.surrogate.get("counted_points", float(t.n_shape))
    if searched < t.n_shape:
        said.append(
            f"{t.n_shape - searched:.0f} of {t.n_shape} outline points were not counted in the search, "
            "because some run of the design does not reach them"
        )
    said += [*symmetry_warning(checks), *flyer_warnings(checks), *force_noise_warnings(checks)]
    if t.n_shape and isfinite(t.chi2_shape) and t.chi2_shape / t.n_shape < SIGMA_RATIO**-2:
        said.append(
            f"the outline's residuals are {sqrt(t.n_shape / t.chi2_shape):.2g} times smaller than its "
            "declared sigma, which cannot be right; check centre_line.sigma"
        )
    said += [*lost_mesh_runs(lost_meshes, result.mesh), *mesh_warnings(result)]
    said += [
        f"the interval does not include the noise of the {source}"
        for source in ("flyer motion", "material curve")
        if result.estimates and not any(source in e.noise_parts for e in result.estimates.values())
    ]
    return (*said, *sliding_warning(interface, named))

"""The inverse method: design -> batch of runs -> surrogate of the response -> search -> finer mesh.

Stages of `identify`:

1. A design over the free parameters is run on the surrogate mesh; a surrogate of the *response* (force
   bins and profile points) gives a first optimum.
2. More runs around it make the surrogate exact where it matters (see `kolsky.inverse.coarse_search`).
3. The optimum is moved to the refined mesh and confirmed by a real run there: by single runs that correct
   the surrogate (one parameter, `kolsky.inverse.refined_search`), or by a quadratic through a design of runs
   on the refined mesh (several, or a sliding surface, `kolsky.inverse.quadratic_fit`).
4. Noise: the residuals' covariance (see `kolsky.inverse.objective`), and replicates of the flyer's motion
   and of the quasi-static curve drawn from their own noise. Numerics: the shift between the meshes, that
   between the elements, and the roughness of the response.
"""

from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum, fit_for_purpose, search_coarse
from kolsky.inverse.estimates import comparison, curves, estimates, routes
from kolsky.inverse.misfit import terms
from kolsky.inverse.optimum import CorrectedSurrogate, jacobian
from kolsky.inverse.parameters import PARAMETERS, any_slides, design_box
from kolsky.inverse.prepared_shot import prepare_shot
from kolsky.inverse.provenance import provenance
from kolsky.inverse.quadratic_fit import search_by_quadratic
from kolsky.inverse.refined_search import RefinedOptimum, search_by_single_runs, slides
from kolsky.inverse.result import Identification
from kolsky.inverse.settings import Settings
from kolsky.inverse.solver_search import add_method_comparison
from kolsky.inverse.staged_runs import Progress, StagedRuns
from kolsky.shot.curve import with_pull
from kolsky.shot.records import Shot
from kolsky.uncertainty.analyse import analyse
from kolsky.uncertainty.profile_likelihood import LinearisedOptimum
from kolsky.uncertainty.warnings.collect import collect_warnings

ORDER = 2.0
"""Order of the mesh error used for the refined mesh's remaining error; fitted in the verification manual."""
SAFETY_FACTOR = 1.25
"""Factor on the extrapolated mesh error (Roache's grid convergence index with a fitted order)."""
ONE_SIDED = 1.15
"""The index over its standard uncertainty: the mesh errs to one side, by about as much as is extrapolated,
and not evenly about zero, where it would be 2 (ASME V&V 20-2009)."""
EITHER_SIDE = 3.0**0.5
"""The other element's move of the optimum over its standard uncertainty: the truth may lie anywhere between
the two and as far on the other side (a rectangular distribution, GUM 4.3.7)."""


def identify(
    shot: Shot, settings: Settings | None = None, *, progress: Progress | None = None
) -> Identification:
    """Identify the free parameters of a shot.

    Parameters
    ----------
    shot
        A loaded shot.
    settings
        What is free, what is held, numerical choices.
    progress : callable, optional
        Called as ``progress(stage, runs done, runs in the stage)``.

    Returns
    -------
    Identification
        Estimates with intervals and verdicts, the check run beside the data, every run of the design.

    Raises
    ------
    ValueError
        If a parameter is unknown, a bound or value is outside its range, or too few runs completed; the
        message says how, when and where the first one failed.
    """
    settings = settings or Settings()
    shot = with_pull(shot, settings.pull)
    whole = design_box(settings.free)
    stages = StagedRuns(prepare_shot(shot), settings, whole, progress or (lambda stage, done, total: None))
    coarse = search_coarse(stages)
    alone = whole.dimension == 1 and not slides(stages)
    fine = search_by_single_runs(stages, coarse) if alone else search_by_quadratic(stages, coarse)
    return _report(shot, stages, coarse, fine)


def _input_noise(stages: StagedRuns, fine: RefinedOptimum) -> tuple[dict[str, FloatArray], int]:
    """Stage 4: standard uncertainties from the inputs' noise, and how many replicates were lost."""
    scale = {}
    gains = [fine.objective.gain(slope) for slope in fine.slopes]
    if stages.observations.force_sigma_gain > 0.0:
        scale["force scale"] = _largest_shift(gains, fine.objective.scale_error)
    if stages.settings.replicates == 0:
        return scale, 0
    replicates = stages.replicate(fine.x)
    vectors = fine.objective.vectors(replicates.prediction)
    change = np.nan_to_num(vectors - vectors[0])  # a point that one replicate leaves adds nothing
    moves = change @ fine.objective.gain(fine.jacobian).T
    if replicates.scale.any():
        scale["motion scale"] = _largest_shift(gains, change[replicates.scale][0])
    return {
        **scale,
        "flyer motion": np.sqrt((moves[replicates.flyer] ** 2).mean(axis=0)),
        "material curve": np.sqrt((moves[replicates.curve] ** 2).mean(axis=0)),
    }, replicates.lost


def _largest_shift(gains: list[FloatArray], change: FloatArray) -> FloatArray:
    return np.max([np.abs(gain @ change) for gain in gains], axis=0)


def _numerical(settings: Settings, fine: RefinedOptimum) -> dict[str, FloatArray]:
    """Standard uncertainties from the numerics by source, shape [d] each."""
    ratio = settings.refined_mesh[0] / settings.numerics.mesh[0]
    found = {"mesh": SAFETY_FACTOR / ONE_SIDED * np.abs(fine.mesh_shift) / (ratio**ORDER - 1.0)}
    if fine.element_shift is not None:
        # Both are estimates of one error, that of the discretisation: the larger counts.
        found["mesh"] = np.fmax(found["mesh"], np.abs(fine.element_shift) / EITHER_SIDE)
    if fine.roughness is not None:
        found["roughness"] = fine.roughness
    return found


def _report(shot: Shot, stages: StagedRuns, coarse: CoarseOptimum, fine: RefinedOptimum) -> Identification:
    """Everything the stages found, with the warnings it deserves."""
    settings, n_force = stages.settings, fine.objective.n_force
    shape = stages.observations.has_shape
    input_noise, lost = _input_noise(stages, fine)
    held = {name: p.held(shot) for name, p in PARAMETERS.items() if name not in stages.box.names}
    loo = coarse.surrogate.loo_residuals
    found_routes = routes(fine.box, fine.objective, fine.model, stages.box, stages.table)
    corrected = LinearisedOptimum.of(fine.x, fine.box, fine.objective, fine.model, fine.surrogate)
    known = analyse(stages, corrected, fine.check.prediction, bayes=settings.bayes)
    found = Identification(
        shot=shot.name,
        estimates=estimates(
            stages.box,
            fine.x,
            noise={"force and shape": fine.sigma, **input_noise},
            numerical=_numerical(settings, fine),
            mesh_shift=fine.mesh_shift,
            confirmed=fine.confirmed,
            outline=stages.observations.has_shape,
        ),
        fixed={**held, **dict(settings.held)},
        routes=found_routes,
        terms=terms(fine.check.prediction, stages.observations, 0),
        comparison=comparison(fine.check.prediction, stages.observations),
        response=fine.check.response,
        mesh=settings.numerics.mesh,
        refined_mesh=settings.refined_mesh,
        design=stages.table.build(stages.box),
        curves=curves(fine.box, fine.objective, fine.model, fine.x),
        surrogate={
            "loo_force": _rms(loo[:, :n_force]),
            **({"loo_shape": _rms(loo[:, n_force:])} if shape else {}),
            "check_shift_sigmas": fine.moved,
            "check_force": _rms(fine.missed[:n_force]),
            **({"check_shape": _rms(fine.missed[n_force:])} if shape else {}),
            "counted_points": float(fine.objective.counted.sum()),
            "force_discrepancy": fine.objective.force_discrepancy,
            **({"shape_discrepancy": fine.objective.shape_discrepancy} if shape else {}),
            **_runs_needed(stages, coarse, fine),
        },
        seconds=stages.seconds,
        provenance=provenance(
            shot, settings, stages.prepared, sliding=any_slides([*settings.free, *settings.held])
        ),
    )
    found = add_method_comparison(known.added_to(found), stages, fine.objective)
    checks = stages.prepared.checks
    said = collect_warnings(found, checks=checks, interface=shot.interface, lost_replicates=lost)
    return replace(found, warnings=(*said, *known.warnings))


def _runs_needed(stages: StagedRuns, coarse: CoarseOptimum, fine: RefinedOptimum) -> dict[str, float]:
    """Where the check does not confirm the surrogate: how many runs would do, infinite if none."""
    if fine.confirmed:
        return {}
    gain = coarse.objective.gain(jacobian(CorrectedSurrogate(coarse.surrogate).predict, coarse.box, coarse.x))
    found = fit_for_purpose(stages, coarse, gain / (2.0 * fine.sigma[:, None]))
    return {"runs_needed": float("inf") if found.runs_needed is None else float(found.runs_needed)}


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.asarray(x) ** 2)))

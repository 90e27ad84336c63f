"""All warnings of an identification, gravest first."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from explicit import Mesh
from kolsky.base.apparatus import Interface
from kolsky.inverse.result import Identification
from kolsky.uncertainty.numerical import LostRun
from kolsky.uncertainty.warnings import answer, inputs, runs
from kolsky.uncertainty.warnings.meshes import lost_mesh_runs


def collect_warnings(
    result: Identification,
    *,
    checks: Mapping[str, float],
    interface: Interface,
    lost_replicates: int = 0,
    mesh: Mesh | None = None,
    lost_meshes: Sequence[LostRun] = (),
) -> tuple[str, ...]:
    """Collect the warnings of a result, gravest first.

    Parameters
    ----------
    result
        The finished identification; its own `warnings` are not read.
    checks
        The figures of `kolsky.inverse.prepared_shot.PreparedShot.checks`.
    interface
        The interface as the shot declares it.
    lost_replicates : int
        Runs of the noise stage that did not complete.
    mesh
        Of the check run; left out, its elements are not looked at.
    lost_meshes
        Runs that were to tell the mesh's error and did not complete.

    Returns
    -------
    tuple of str
        One sentence each, without a final stop; empty if there is nothing to say.
    """
    named = [*result.estimates, *_held(result)]
    return tuple(
        [
            *answer.disagreement(result),
            *answer.force_alone(result),
            *answer.routes(result),
            *answer.methods(result),
            *answer.bounds(result),
            *_past_curve(result, checks),
            *inputs.conditioned(checks),
            *answer.energy(result),
            *runs.hourglass(result.response),
            *([] if mesh is None else runs.folded(result.response, mesh, interface, named)),
            *answer.lost(result, lost_replicates),
            *answer.outside(result),
            *inputs.symmetry(checks),
            *inputs.flyer(checks),
            *inputs.force_noise(checks),
            *inputs.outline_noise(result),
            *lost_mesh_runs(lost_meshes, result.mesh),
            *answer.numerical(result),
            *answer.left_out(result),
            *runs.sliding(interface, named),
        ]
    )


def _past_curve(result: Identification, checks: Mapping[str, float]) -> Iterator[str]:
    response = result.response
    return runs.past_curve(
        float(response.extrapolated_share[0]), float(response.largest_strain_measure[0]), checks
    )


def _held(result: Identification) -> Mapping[str, Any]:
    held = result.provenance.get("settings", {}).get("held", {})
    return held if isinstance(held, Mapping) else {}

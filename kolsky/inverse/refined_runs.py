"""What runs on the refined mesh say of the optimum, and how they are asked."""

from dataclasses import dataclass

from doe import Box, from_points
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.objective import Objective
from kolsky.inverse.optimum import Model
from kolsky.inverse.stages import Runs, Stages

CONFIRMED = 0.2
"""An optimum is confirmed when the check run moves it by less than this share of the residuals' sigma."""
ROUGH = 3.0
"""Or by less than so many standard deviations of the response's roughness, which is in the interval."""


@dataclass(frozen=True)
class Refined:
    """The optimum on the refined mesh, confirmed or not by its last run."""

    x: FloatArray
    """The answer, shape [d]; the last run is there."""
    box: Box
    """Where the model holds."""
    objective: Objective
    """With the discrepancies of the optimum."""
    model: Model
    """What the runs on the refined mesh would give."""
    surrogate: Model
    """What `model` was before it was bent to agree with runs on the refined mesh; itself if it never was."""
    jacobian: FloatArray
    """Of the model at the optimum, shape [k, d]."""
    slopes: tuple[FloatArray, ...]
    """Every slope of the model that may be the right one for a common scale, shape [k, d] each."""
    sigma: FloatArray
    """Standard deviation of the optimum from the residuals, shape [d]."""
    check: Runs
    """The last run."""
    moved: float
    """How far it moved the optimum, in units of sigma."""
    confirmed: bool
    """Whether that is little."""
    missed: FloatArray
    """The last run minus what the model had foretold for it, shape [k]."""
    mesh_shift: FloatArray
    """Optimum on the refined mesh minus that on the surrogate's, shape [d]."""
    roughness: FloatArray | None = None
    """Standard deviation of the optimum from the response's roughness, shape [d]; None if it is smooth."""
    element_shift: FloatArray | None = None
    """Optimum with the other element minus the answer, shape [d]; None if it was not asked."""


def run_refined(stages: Stages, points: FloatArray) -> Runs:
    """Run points on the refined mesh with all nodes; all of them must complete.

    Raises
    ------
    ValueError
        If one does not.
    """
    check = stages.simulate("check", from_points(stages.box, points), refined(stages), all_nodes=True)
    if len(check.points) < len(points):
        raise ValueError(f"the check needs every run on the refined mesh to complete: {check.lost}")
    return check


def refined(stages: Stages) -> Numerics:
    """The numerical choices of the refined mesh."""
    return stages.settings.numerics.with_mesh(stages.settings.refined_mesh)


def slides(stages: Stages) -> bool:
    """Whether a surface slides by Coulomb's law: as declared, or because friction is named."""
    settings, interface = stages.settings, stages.prepared.forward.shot.interface
    named = "friction" in {*settings.free, *settings.held}
    return named or "coulomb" in (interface.faces, interface.side)

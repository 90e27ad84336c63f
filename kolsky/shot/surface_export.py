"""From the points of a DIC program's export to the centre line and the flyer's motion."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from dic.outcome import PointOutcome
from dic.surfaces import Cylinder, fit_cylinder
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory, centre_line
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.readers.dic_export.export import DicExport, PointState

OUTCOMES = MappingProxyType(
    {
        PointState.VALID: PointOutcome.VALID,
        PointState.REJECTED: PointOutcome.LOW_CORRELATION,
        PointState.MISSING: PointOutcome.NOT_CONVERGED,
    }
)
"""What becomes of a point: an export does not say why a point is missing."""
WIDEST_ANGLE = 30.0
"""Largest angle between the axis of a fitted cylinder and the declared one [degrees]."""


@dataclass(frozen=True)
class Placement:
    """The test frame (x, y, Z) in the coordinates of an export."""

    rotation: FloatArray
    """Rows x, y, Z as unit vectors of the export's coordinates, shape [3, 3]."""
    origin: FloatArray
    """The point of the specimen's axis at y = 0, in the export's coordinates [m], shape [3]."""
    cylinder: Cylinder | None = None
    """The best-fit cylinder it rests on, if it does."""


def declared_placement(*, y: str, Z: str, origin: tuple[float, float, float]) -> Placement:
    """Axes of the test along axes of the export.

    Parameters
    ----------
    y
        Which of the export's axes points along the specimen's axis toward the flyer, e.g. "+Y".
    Z
        Which points toward the cameras.
    origin
        The point of the specimen's axis on the transmission platen's face [m].

    Raises
    ------
    ValueError
        If both are the same axis, or one is none of ±X, ±Y, ±Z.
    """
    along, toward = _unit(y), _unit(Z)
    if abs(along @ toward) > 0.5:
        raise ValueError(f"y and Z must be different axes, got {y} and {Z}")
    return Placement(np.array([np.cross(along, toward), along, toward]), np.array(origin, dtype=np.float64))


def cylinder_placement(
    export: DicExport, *, y: str, Z: str, on_platen: tuple[float, float, float], radius: float, sigma: float
) -> Placement:
    """The test frame on the cylinder that fits the reference positions best.

    Parameters
    ----------
    export
        Points on the specimen's surface.
    y, Z
        As in `declared_placement`, within `WIDEST_ANGLE`.
    on_platen
        Any point of the transmission platen's face [m].
    radius
        Radius of the undeformed specimen [m].
    sigma
        Standard deviation of a position [m].

    Raises
    ------
    ValueError
        If no cylinder fits, or its axis lies elsewhere than declared.
    """
    covariance = np.broadcast_to(sigma**2 * np.eye(3), (len(export.X), 3, 3))
    cylinder = fit_cylinder(export.X, covariance, radius=radius)
    declared = _unit(y)
    cosine = float(cylinder.axis @ declared)
    if abs(cosine) < np.cos(np.radians(WIDEST_ANGLE)):
        angle = float(np.degrees(np.arccos(min(1.0, abs(cosine)))))
        raise ValueError(
            f"the axis of the best-fit cylinder is {angle:.0f} degrees off the declared axis {y}; it must be"
            f" within {WIDEST_ANGLE:g} degrees"
        )
    along = cylinder.axis * np.sign(cosine)
    toward = _unit(Z) - (_unit(Z) @ along) * along
    toward = toward / np.linalg.norm(toward)
    origin = cylinder.point + ((np.asarray(on_platen) - cylinder.point) @ along) * along
    return Placement(np.array([np.cross(along, toward), along, toward]), origin, cylinder)


def surface_history(
    export: DicExport, placement: Placement, time: FloatArray, *, sigma: float
) -> SurfaceHistory:
    """The points of an export in the test frame.

    Parameters
    ----------
    export
        The points.
    placement
        Where the test frame lies.
    time
        Times of the frames on the shot's clock [s], shape [n_frames].
    sigma
        Standard deviation of each component of a position [m].

    Raises
    ------
    ValueError
        As `dic.surfaces.surface_history.SurfaceHistory`.
    """
    outcome = np.full(export.state.shape, int(PointOutcome.VALID))
    for state, meaning in OUTCOMES.items():
        outcome[export.state == state] = int(meaning)
    return SurfaceHistory(
        t=time,
        X=(export.X - placement.origin) @ placement.rotation.T,
        u=export.u @ placement.rotation.T,
        sigma=np.full(export.u.shape, sigma),
        outcome=outcome,
    )


def outline(surface: SurfaceHistory, *, half_width: float) -> CentrePoints:
    """Points near the centre line, carried round the circle to it; the axis is that of the placement.

    Raises
    ------
    ValueError
        As `dic.surfaces.surface_history.centre_line`.
    """
    return centre_line(surface, half_width=half_width)


def flyer_motion(export: DicExport, placement: Placement, time: FloatArray, *, sigma: float) -> FlyerMotion:
    """Mean displacement toward the specimen of the points that are valid in every frame.

    Points that come and go would turn a tilt of the flyer into a step, so they are left out.

    Parameters
    ----------
    export
        Points on the flyer.
    placement
        Where the test frame lies; the flyer goes toward -y.
    time
        Times of the frames on the shot's clock [s], shape [n_frames].
    sigma
        Standard deviation of one displacement of the mean [m].

    Raises
    ------
    ValueError
        If no point is valid in every frame.
    """
    kept = np.all(export.state == PointState.VALID, axis=0)
    if not kept.any():
        raise ValueError("no point of the flyer is valid in every frame")
    displacement = -(export.u[:, kept] @ placement.rotation[1]).mean(axis=1)
    return FlyerMotion(time=time, displacement=displacement, sigma=np.full(time.size, sigma))


def _unit(axis: str) -> FloatArray:
    if len(axis) != 2 or axis[0] not in "+-" or axis[1] not in "XYZ":
        raise ValueError(f"an axis must be one of +X, -X, +Y, -Y, +Z, -Z, got {axis!r}")
    direction = np.zeros(3)
    direction["XYZ".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return direction

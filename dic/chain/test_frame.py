"""Test frame from the specimen at rest: its cylinder and lower end; reduction of bodies to surfaces."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dic.basics import FloatArray, IntArray
from dic.bodies.edge_fit import HALF, fit_edge, in_view, sampled, strip_places
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.chain.inputs import ChainError, ChainSettings, Inputs
from dic.correlation.subsets import overlap_factor
from dic.images import Pictures
from dic.outcome import PointOutcome
from dic.processes import run_parallel
from dic.result import Body, Placement, SurfaceStrain
from dic.stereo.geometry import pixels_per_length
from dic.surfaces.cylinder import Cylinder, SpecimenFrame, fit_cylinder, on_cylinder, test_frame
from dic.surfaces.outline import outline
from dic.surfaces.strains import StrainGauge, strains
from dic.surfaces.surface_history import CentrePoints, referenced, static_mean, to_surface

MODEL = 0.06
"""Standard deviation of an edge due to effects that the model does not include [px]."""
PHASES = (0.0, 0.5)
"""Tried shifts of the strip [px]. The error of a fit depends on the sub-pixel position of the strip's rows,
with a period of one pixel."""
LEAST_GAP = 0.5
"""Largest gap in the paint before the edge that is ignored [px]."""
SHARE = 0.4
"""Half width of the strip across the axis in which an end is searched, over the radius [-]."""
FEWEST_COLUMNS = 16
"""Smallest number of columns of a strip that must be in view [px]."""
LEAST_BEYOND = 2.0
"""Smallest number of rows beyond the end that must be in view [px]."""
REACH = 3.5
"""Largest distance of the end from the declared position [px]."""
RIM_SIGMA = 0.02
"""Relative standard deviation of the platen's radius, if the flyer's radius is used for it [-]."""
OPEN_RIM = 0.25
"""Assumed width of the platen's face outside the specimen, over the radius, and its standard deviation [-].
They are used if no radius of a platen is known."""

DECLARED = 0.5
"""Standard deviation of a position that a person read from a picture [px]."""


def refined_end(
    pictures: tuple[FloatArray, FloatArray],
    rig: StereoRig,
    cylinder: Cylinder,
    declared: tuple[float, float],
    direction: tuple[float, float],
    *,
    platen: float | None = None,
) -> tuple[FloatArray, float, int]:
    """The lower end of a specimen at rest, from its edge in both cameras' pictures.

    A camera above the plane of the end sees the specimen's edge. Beyond the edge it sees the platen's face at
    a grazing angle. For a camera below that plane the platen's rim hides the end. The visible edge is then
    the rim, at the platen's radius in the same plane.
    """
    rim = (1.0 + OPEN_RIM) * cylinder.radius if platen is None else max(platen, cylinder.radius)
    rim_sigma = OPEN_RIM * cylinder.radius if platen is None else RIM_SIGMA * rim
    zero = on_cylinder(rig.cameras[0], declared, cylinder)
    frame = test_frame(cylinder, rig, toward_flyer=direction, zero=zero)
    if _slope(rig.cameras[0], frame, 0.0) < 0.0:  # the camera is below the plane of the lower end
        zero = on_cylinder(rig.cameras[0], declared, replace(cylinder, radius=rim))
        frame = test_frame(cylinder, rig, toward_flyer=direction, zero=zero)
    y, sigma, count = 0.0, np.inf, 0
    for _ in range(2):  # first about the declared position, then about the measured one
        looked = run_parallel(
            [
                partial(end_in_camera, camera, picture, frame, y, cylinder.radius, rim, rim_sigma)
                for camera, picture in zip(rig.cameras, pictures, strict=True)
            ]
        )
        measured = [one for one in looked if one is not None]
        count = len(measured)
        if not count:
            break
        y, sigma = weighted_mean(*np.array([one[:2] for one in measured]).T)
    if not count:
        scale = _scale(rig.cameras[0], frame, 0.0, cylinder.radius)
        y, sigma = 0.0, float(np.hypot(DECLARED / scale, abs(_slope(rig.cameras[0], frame, 0.0)) * rim_sigma))
    return frame.in_rig(np.array([[0.0, y, cylinder.radius]]))[0], sigma, count


def weighted_mean(values: FloatArray, sigmas: FloatArray) -> tuple[float, float]:
    """Mean weighted with the inverse variances, and its standard deviation. If the values disagree, it is
    multiplied by the root of chi-squared per degree of freedom."""
    w = 1.0 / sigmas**2
    mean = float(np.sum(w * values) / np.sum(w))
    chi2 = float(np.sum(w * (values - mean) ** 2)) / max(values.size - 1, 1)
    return mean, float(np.sqrt(max(1.0, chi2) / np.sum(w)))


def _slope(camera: Camera, frame: SpecimenFrame, y: float) -> float:
    """Slope of the rays to a plane across the axis; positive for a camera above the plane."""
    x, height, z = frame.positions(camera.centre)
    return float((height - y) / np.hypot(x, z))


def _scale(camera: Camera, frame: SpecimenFrame, y: float, radius: float) -> float:
    """Scale of lengths along the axis on the cameras' side [px/m]."""
    place = frame.in_rig(np.array([0.0, y, radius]))
    return float(np.linalg.norm(pixels_per_length(camera, place, frame.rotation[1])))


def end_in_camera(
    camera: Camera,
    picture: FloatArray,
    frame: SpecimenFrame,
    y: float,
    specimen: float,
    rim: float,
    rim_sigma: float,
) -> tuple[float, float] | None:
    """Height of the lower end in one camera, and its standard deviation [m]; None if it is not seen there."""
    slope = _slope(camera, frame, y)
    radius = specimen if slope >= 0.0 else rim
    scale = _scale(camera, frame, y, radius)
    half = SHARE * specimen
    x = np.arange(-half, half, 1.0 / scale)
    u = np.arange(-HALF, HALF + 1.0)
    widest = 1.3 * scale * max(slope, 0.0) * (rim - specimen) + 0.3
    fits = []
    for phase in PHASES:
        at = y + phase / scale
        places = strip_places(x, at - u / scale, radius)
        visible = in_view(camera, picture.shape, frame, places)
        rows, columns = visible.any(axis=1), visible[visible.any(axis=1)].all(axis=0)
        if u[rows].max(initial=-HALF) < LEAST_BEYOND or u[rows].min(initial=HALF) > -HALF:
            continue
        if columns.sum() < FEWEST_COLUMNS:
            continue
        strip = sampled(camera, picture, frame, places[np.ix_(rows, columns)])
        fit = fit_edge(strip[None], u[rows], np.array([[0.0], [widest]]), reach=REACH)
        if fit is not None:
            fits.append((phase - fit.place, fit.sigma, fit.gap))
    if not fits:
        return None
    place, off = of_phases(np.array(fits))
    return y + place / scale, float(np.hypot(off / scale, min(slope, 0.0) * rim_sigma))


def of_phases(fits: FloatArray) -> tuple[float, float]:
    """Position of an edge and its standard deviation [px], from fits to strips with different sub-pixel
    shifts.

    The standard deviation contains that of the fits, `MODEL`, and half of the difference between the fits. It
    also contains the gap in the paint before the edge: the body may end anywhere in the gap (uniform
    distribution).
    """
    place, sigma, gap = fits.mean(axis=0)
    apart = 0.5 * float(np.ptp(fits[:, 0]))
    open_gap = max(float(gap) - LEAST_GAP, 0.0) / 12.0**0.5
    return float(place), float(np.sqrt(sigma**2 + MODEL**2 + apart**2 + open_gap**2))


MOST_AVERAGED = 50
"""Largest number of static pictures that are averaged to find the specimen's edge."""

FEWEST_POINTS = 10
"""Smallest number of points of the flyer from which its radius is estimated."""


@dataclass(frozen=True)
class RestState:
    """State of the specimen at rest."""

    placement: Placement
    """The test frame, and the cylinder that defines it."""
    frames: list[int]
    """Static frames in which both cameras saw the specimen."""
    edges: int
    """Number of cameras in which its end was found."""
    platen: float | None = None
    """Radius of the platens, that of the flyer [m]; None: not known."""


def fit_test_frame(inputs: Inputs, body: TrackedBody, flyer: TrackedBody | None = None) -> RestState:
    """Fit the test frame to the specimen at rest.

    ``flyer``: the tracked flyer; both platens are assumed to have its radius. None: the radius is not known.
    Raises ChainError if no point was found by both cameras at rest, or the points lie on no cylinder.
    """
    rig, settings = inputs.rig, inputs.settings
    rest_frames = _rest_frames(inputs, body)
    position, covariance = static_mean(body.reconstruction, rest_frames)
    finite = np.isfinite(position).all(axis=1)
    try:
        overlap = overlap_factor(body.points[finite], settings.subset)
        free = fit_cylinder(position[finite], covariance[finite], overlap=overlap)
        cylinder = free
        if settings.radius is not None:
            cylinder = fit_cylinder(
                position[finite], covariance[finite], overlap=overlap, radius=settings.radius
            )
        means = (
            _mean_picture(inputs.pictures[0], rest_frames),
            _mean_picture(inputs.pictures[1], rest_frames),
        )
        platen = _platen(flyer, cylinder)
        zero, zero_sigma, edges = refined_end(
            means, rig, cylinder, settings.zero, settings.direction, platen=platen
        )
        frame = test_frame(cylinder, rig, toward_flyer=settings.direction, zero=zero, zero_sigma=zero_sigma)
    except ValueError as error:
        raise ChainError(f"the specimen at rest gives no test frame: {error}") from error
    placement = Placement(
        frame=frame,
        radius=free.radius,
        radius_sigma=float(free.sigma[4]),
        rms=cylinder.rms,
        chi2_per_dof=cylinder.chi2_per_dof,
        n_points=int(cylinder.used.sum()),
    )
    return RestState(placement=placement, frames=rest_frames, edges=edges, platen=platen)


def _platen(flyer: TrackedBody | None, cylinder: Cylinder) -> float | None:
    """Radius of the flyer's cylindrical side, from its points in the frame in which they were chosen [m]."""
    if flyer is None:
        return None
    r = flyer.reconstruction
    valid = r.outcome[flyer.material] == PointOutcome.VALID
    if valid.sum() < FEWEST_POINTS:
        return None
    across = (r.position[flyer.material, valid] - cylinder.point) @ cylinder.basis[:2].T
    return float(np.median(np.hypot(*across.T)))


def _rest_frames(inputs: Inputs, body: TrackedBody) -> list[int]:
    """Static frames in which both cameras saw the body."""
    visible = np.any(body.reconstruction.outcome == PointOutcome.VALID, axis=1)
    frames: list[int] = np.flatnonzero(inputs.static & visible).tolist()
    if not frames:
        failed = [f"{gate.name} {count}" for gate, count in body.stereo.count().items() if count]
        raise ChainError(
            f"no point of the specimen was found by both cameras at rest; of {len(body.points)} points the "
            f"match between the cameras failed by {', '.join(failed)}: check the calibration, the crop "
            "offsets and the order of the cameras"
        )
    return frames


def _mean_picture(pictures: Pictures, frames: list[int]) -> FloatArray:
    """The mean of some static pictures, at most `MOST_AVERAGED`."""
    chosen = frames[:MOST_AVERAGED]
    total = np.zeros(pictures.shape)
    for frame in chosen:
        total += pictures.frame(frame)
    return total / len(chosen)


def surface_of(
    inputs: Inputs, body: TrackedBody, placement: Placement, reference: list[int]
) -> tuple[Body, IntArray]:
    """The points of a body with a position in the reference frames, and the outcomes of all other points in
    the material picture."""
    r = body.reconstruction
    selected = referenced(r, reference)
    surface = to_surface(r, placement.frame, inputs.t, reference=reference, points=selected)
    sigma = [
        np.sqrt(0.5 * np.trace(track.covariance[:, selected], axis1=2, axis2=3)) for track in body.tracks
    ]
    return (
        Body(
            surface=surface,
            pixels=(r.pixels[0][:, selected], r.pixels[1][:, selected]),
            match_sigma=(sigma[0], sigma[1]),
            zncc=(body.tracks[0].zncc[:, selected], body.tracks[1].zncc[:, selected]),
            epipolar=r.epipolar[:, selected],
            points=body.points[selected],
            cell=body.cell[selected],
        ),
        r.outcome[body.material, ~selected],
    )


def surface_of_flyer(inputs: Inputs, flyer: TrackedBody | None, placement: Placement) -> Body | None:
    """The flyer's points, or None without a flyer. They refer to their positions in the material picture,
    because most of them are not in view at rest."""
    if flyer is None:
        return None
    return surface_of(inputs, flyer, placement, [flyer.material])[0]


def outline_of(specimen: Body, settings: ChainSettings) -> tuple[CentrePoints, int]:
    """The outline on the centre line without rows whose sigma is too large, and the number of these rows."""
    line = outline(
        specimen.surface,
        specimen.points,
        half_width=settings.strip_half_width,
        subset=settings.subset,
        shape=max(settings.tracking.correlation.shape, settings.stereo.shape),
    )
    if settings.largest_sigma is None:
        return line, 0
    fine = line.sigma <= settings.largest_sigma
    selected = {name: getattr(line, name)[fine] for name in ("t", "frame", "y", "Z", "sigma")}
    return replace(line, **selected), int(np.sum(~fine))


def strains_of(specimen: Body, settings: ChainSettings) -> SurfaceStrain:
    """Green-Lagrange strains of the specimen over the declared window."""
    gauge = StrainGauge(window=settings.strain_window, step=settings.step, subset=settings.subset)
    history = strains(specimen.surface, specimen.points, gauge)
    measured = history.green_lagrange
    return SurfaceStrain(
        value=measured.value, sigma=measured.sigma, outcome=history.outcome, gauge=history.gauge
    )

"""Full-field measurement by two cameras: a curved surface, or a cylinder with a correction of the curvature
bias.

On a curved surface camera 1 sees a subset displaced by a field u(ξ). The shape function cannot follow this
field. The misfit moves the fitted centre by ``b = c₀ - u(0)``, ``c = argmin Σ_ξ |u(ξ) - Σ_j c_j φ_j(ξ)|²``.
φ_j are the terms of the shape function (φ₀ = 1), ξ the pixels in the mask. For a cylinder near the true one,
the rays give u in closed form, and b is subtracted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dic.basics import BoolArray, FloatArray, IntArray
from dic.bodies.follow import TrackedBody, follow_bodies, match_body
from dic.bodies.region import Region, grid_points
from dic.camera import Camera, StereoRig
from dic.chain.outliers import GATE_SIGMAS, LEAST_GATE, OWN_SIGMAS
from dic.chain.remarks import of_findings
from dic.correlation import Noise
from dic.correlation.subsets import Shape, gradient, overlap_factor
from dic.full_field.measure import (
    Extensometer,
    FullFieldSettings,
    Progress,
    Series,
    as_series,
    extensions,
    facts_of,
    frame_outcomes,
    full_mask,
    known_noise,
    noise_from_matches,
    strains_of,
    times_of,
    usable_reference,
)
from dic.images import Pictures, check_series, frame_health
from dic.outcome import PointOutcome
from dic.result import FittedCylinder, FullField
from dic.stereo.diagnose import check_setup
from dic.stereo.epipolar_search import in_mask
from dic.stereo.match import match_stereo
from dic.stereo.reconstruction import Reconstruction, reconstruct
from dic.surfaces.cylinder import Cylinder, SpecimenFrame, fit_cylinder, test_frame
from dic.surfaces.surface_history import referenced, static_mean, to_surface
from dic.tracking import Track


def plane_frame(X: FloatArray, rig: StereoRig) -> SpecimenFrame:
    """Frame on the best-fit plane of points. Z is along the normal toward the cameras. x points to the right
    and y up in camera 0's pictures. The origin is in the middle of the points.
    """
    if len(X) < 3:
        raise ValueError(f"a plane needs three points, got {len(X)}")
    origin = X.mean(axis=0)
    Z = np.linalg.svd(X - origin, full_matrices=False)[2][2]
    middle = 0.5 * (rig.cameras[0].centre + rig.cameras[1].centre)
    Z = Z * (1.0 if (middle - origin) @ Z >= 0.0 else -1.0)
    right = rig.cameras[0].rotation[0]
    x = right - (right @ Z) * Z
    if np.linalg.norm(x) < 0.05:
        raise ValueError("camera 0 looks along the plane that fits the points best")
    x = x / np.linalg.norm(x)
    return SpecimenFrame(np.array([x, np.cross(Z, x), Z]), origin, np.zeros((6, 6)))


def _cylinder_frame(cylinder: Cylinder, rig: StereoRig) -> SpecimenFrame:
    """Frame on a cylinder. y is along its axis and points up in camera 0's pictures, or to the right if the
    axis is horizontal. Z points from the axis toward the cameras. The origin is the point of the axis nearest
    to the middle of the points.
    """
    ends = cylinder.point + np.outer([-0.1, 0.1], cylinder.radius * cylinder.axis)
    across, down = np.abs(np.diff(rig.cameras[0].project(ends), axis=0)[0])
    direction = (0.0, -1.0) if down >= across else (1.0, 0.0)
    return test_frame(cylinder, rig, toward_flyer=direction, zero=cylinder.point)


NODES = 15
"""Number of nodes along each side of a subset. The nodes represent its pixels."""
LEAST_VISIBLE = 0.2
"""Smallest share of the nodes that must lie on the cylinder and in the mask."""


def polynomial_bias(field: FloatArray, shape: Shape) -> FloatArray:
    """Value of the best-fit polynomial of a field over a square, minus the value of the field, both at the
    centre."""
    x, y = subset_nodes(2.0).T  # from -1 to 1: the result does not depend on a length
    terms = [np.ones_like(x), x, y] + ([x * x, x * y, y * y] if shape == Shape.QUADRATIC else [])
    T = np.stack(terms, axis=1)
    finite = np.asarray(np.isfinite(field).all(axis=2))
    middle = field[:, NODES**2 // 2]
    fine = (finite.mean(axis=1) >= LEAST_VISIBLE) & np.isfinite(middle).all(axis=1)
    bias = np.full(middle.shape, np.nan)
    away = np.where(finite[..., None], field - middle[:, None], 0.0)[fine]
    used = finite[fine].astype(np.float64)
    normal = np.einsum("nk,ka,kb->nab", used, T, T, optimize=True)
    bias[fine] = np.linalg.solve(normal, np.einsum("ka,nkm->nam", T, away))[:, 0]
    return bias


def subset_nodes(side: float) -> FloatArray:
    """Centres of NODES x NODES equal squares that make up a square about zero, shape [NODES², 2]."""
    places = ((np.arange(NODES) + 0.5) / NODES - 0.5) * side
    x, y = np.meshgrid(places, places)
    return np.column_stack([x.ravel(), y.ravel()])


def on_cylinder(camera: Camera, pixels: FloatArray, cylinder: Cylinder) -> FloatArray:
    """Points of a cylinder that a camera sees at `pixels` [m], shape [..., 3]; NaN where the ray misses
    it."""
    ideal = camera.undistort(pixels)
    ray = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ camera.rotation
    d, w = ray @ cylinder.basis[:2].T, cylinder.basis[:2] @ (camera.centre - cylinder.point)
    a, b, c = np.sum(d * d, axis=-1), d @ w, w @ w - cylinder.radius**2
    under = b * b - a * c
    s = (-b - np.sqrt(np.where(under >= 0.0, under, np.nan))) / a
    return np.asarray(camera.centre + s[..., None] * ray)


def match_bias(
    rig: StereoRig, cylinder: Cylinder, points: FloatArray, mask: BoolArray, subset: int, shape: Shape
) -> FloatArray:
    """Bias of the positions in camera 1 of points matched from camera 0 [px], shape [n, 2]."""
    pixels = points[:, None] + subset_nodes(float(subset))
    X = on_cylinder(rig.cameras[0], pixels, cylinder)
    inside = in_mask(pixels, mask)[..., None]
    return polynomial_bias(np.where(inside, rig.cameras[1].project(X), np.nan), shape)


def without_bias(track: Track, bias: FloatArray, material: int) -> Track:
    """Camera 1's track, corrected for the bias of the match.

    The matched points are displaced by `bias` in the material frame and are tracked from there. In another
    frame they are displaced by ``F F₀⁻¹ bias``, F the deformation gradients of the track.
    """
    finite_bias = np.where(np.isfinite(bias), bias, 0.0)
    F = gradient(track.warp)
    with np.errstate(invalid="ignore"):  # lost points give no numbers
        start = np.where(np.isfinite(F[material]), F[material], np.eye(2))
        now = np.where(np.isfinite(F), F, np.eye(2))
    shift = now @ (np.linalg.inv(start) @ finite_bias[..., None])
    warp = track.warp.copy()
    warp[..., :2] -= shift[..., 0]
    return replace(track, warp=warp)


NO_MATCH = (
    "no point was matched between the cameras: check the order of the cameras, the calibration, the crop "
    "offsets and the region"
)
CORRECTIONS = 2
"""Number of corrections for the curvature bias: the second one starts from a nearly correct cylinder."""


def _apply_epipolar_gate(rig: StereoRig, body: TrackedBody, rest_frames: Sequence[int]) -> TrackedBody:
    """The body after the epipolar gate derived from its reference frames."""
    epipolar = body.reconstruction.epipolar[list(rest_frames)]
    distances = epipolar[np.isfinite(epipolar)]
    if not distances.size:
        raise ValueError(NO_MATCH)
    gate = max(LEAST_GATE, GATE_SIGMAS * float(np.median(np.abs(distances))) / 0.6745)
    gated = reconstruct(rig, *body.tracks, gate=gate, gate_sigmas=OWN_SIGMAS, common=body.common)
    return replace(body, reconstruction=gated)


def _at_rest_of(r: Reconstruction, rest_frames: Sequence[int]) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Mean reference positions of the points [m], their covariances [m²], and the mask of these points."""
    used = referenced(r, rest_frames)
    X, C = static_mean(r, rest_frames)
    return X[used], C[used], used


def _cylinder_of(
    r: Reconstruction,
    rest_frames: Sequence[int],
    settings: FullFieldSettings,
    points: FloatArray,
    radius: float | None = None,
) -> Cylinder:
    """The cylinder at the reference."""
    X, C, used = _at_rest_of(r, rest_frames)
    return fit_cylinder(X, C, radius=radius, overlap=overlap_factor(points[used], settings.subset))


def _remove_curvature_bias(
    rig: StereoRig,
    body: TrackedBody,
    rest_frames: Sequence[int],
    settings: FullFieldSettings,
    radius: float | None,
) -> tuple[TrackedBody, float, float]:
    """The body after the correction of the curvature bias, the median size of the bias in camera 1 [px], and
    the radius before the correction [m]."""
    first, track = body, body.tracks[1]
    plain, size = _cylinder_of(first.reconstruction, rest_frames, settings, body.points).radius, 0.0
    for _ in range(CORRECTIONS):
        cylinder = _cylinder_of(body.reconstruction, rest_frames, settings, body.points, radius)
        bias = match_bias(rig, cylinder, body.points, body.mask, settings.subset, settings.stereo_shape)
        finite = np.isfinite(bias).all(axis=1)
        size = float(np.median(np.linalg.norm(bias[finite], axis=1))) if finite.any() else 0.0
        tracks = (body.tracks[0], without_bias(track, bias, body.material))
        body = _apply_epipolar_gate(
            rig,
            replace(first, tracks=tracks, reconstruction=reconstruct(rig, *tracks, common=first.common)),
            rest_frames,
        )
    return body, size, plain


def cylinders(
    r: Reconstruction,
    frame: SpecimenFrame,
    points: FloatArray,
    settings: FullFieldSettings,
    correction: float,
    plain: float,
) -> FittedCylinder:
    """A cylinder with a free radius through the points of each frame."""
    n = len(r.outcome)
    radius, sigma, rms, count = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, int)
    for k in range(n):
        valid = r.outcome[k] == PointOutcome.VALID
        try:
            cylinder = fit_cylinder(
                frame.positions(r.position[k, valid]),
                frame.covariances(r.covariance[k, valid]),
                overlap=overlap_factor(points[valid], settings.subset),
            )
        except ValueError:
            continue  # too few points, or no cylinder fits: NaN and no points
        radius[k], sigma[k], rms[k] = cylinder.radius, cylinder.sigma[4], cylinder.rms
        count[k] = int(cylinder.used.sum())
    return FittedCylinder(radius, sigma, rms, count, correction, plain)


TRIED = 300
"""If nothing else gives the noise of the grey values, the matches of this number of points give it."""


def measure_surface(
    pictures: tuple[Series, Series],
    rig: StereoRig,
    settings: FullFieldSettings | None = None,
    *,
    mask: BoolArray | None = None,
    t: FloatArray | None = None,
    extensometers: Sequence[Extensometer] = (),
    facts: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> FullField:
    """Measure displacements and strains of a curved surface by two cameras.

    Parameters
    ----------
    pictures
        The series of camera 0 and camera 1, frame by frame at the same times.
    rig
        The cameras, for the cropped pictures of the series (`StereoRig.cropped`).
    settings, t, extensometers, facts, progress
        As for `dic.full_field.measure.measure_plane`.
    mask
        Pixels of the surface in camera 0's reference picture, shape [rows, columns]; None: the whole picture.

    Returns
    -------
    FullField
        The result, in the frame of the best-fit plane of the reference positions.

    Raises
    ------
    ValueError
        As `measure_plane`, or if no point was matched between the cameras.
    """
    chosen = settings or FullFieldSettings()
    return _measured("surface", pictures, rig, chosen, None, mask, t, extensometers, facts, progress)


def measure_cylinder(
    pictures: tuple[Series, Series],
    rig: StereoRig,
    settings: FullFieldSettings | None = None,
    *,
    radius: float | None = None,
    mask: BoolArray | None = None,
    t: FloatArray | None = None,
    extensometers: Sequence[Extensometer] = (),
    facts: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> FullField:
    """Measure a cylinder by two cameras: its surface, and the fitted radius in each frame.

    The bias due to the curvature within the subsets is subtracted (`dic.full_field.stereo`).

    Parameters
    ----------
    pictures, rig, settings, mask, t, extensometers, facts, progress
        As for `measure_surface`.
    radius
        Radius at the reference from another measurement, e.g. with a calliper [m]. The axis then lies at this
        distance behind the surface. The radii of the frames remain free. None: the radius is estimated.

    Returns
    -------
    FullField
        The result, y along the axis, Z from the axis toward the cameras.

    Raises
    ------
    ValueError
        As `measure_surface`, or if the reference positions lie on no cylinder.
    """
    chosen = settings or FullFieldSettings()
    return _measured("cylinder", pictures, rig, chosen, radius, mask, t, extensometers, facts, progress)


def _measured(
    kind: str,
    pictures: tuple[Series, Series],
    rig: StereoRig,
    settings: FullFieldSettings,
    radius: float | None,
    mask: BoolArray | None,
    t: FloatArray | None,
    extensometers: Sequence[Extensometer],
    facts: Mapping[str, Any] | None,
    progress: Progress | None,
) -> FullField:
    series = (as_series(pictures[0]), as_series(pictures[1]))
    if series[0].n_frames != series[1].n_frames:
        raise ValueError(f"the cameras have {series[0].n_frames} and {series[1].n_frames} pictures")
    found = [frame_health(one) for one in series]
    for one, own in zip(series, found, strict=True):
        check_series(one, own)
    health = (found[0].outcome, found[1].outcome)
    usable_reference(health, settings)
    time, timed = times_of(series[0], t)
    region = full_mask(mask, series[0])
    noise, sigma, measured = _noise(series, rig, health, region, settings)
    matched = match_body(
        series,
        rig,
        Region(corners=(), frame=settings.reference),
        mask=region,
        step=settings.step,
        margin=settings.margin,
        tracking=settings.tracking,
        stereo=settings.stereo,
        noise=noise,
        health=health,
        device=settings.device,
        name=kind,
    )
    body = follow_bodies([matched], rig, settings.stereo, progress=progress)[0]
    at_rest = settings.reference < settings.static
    rest_frames = list(range(settings.static)) if at_rest else [settings.reference]
    body = _apply_epipolar_gate(rig, body, rest_frames)
    correction, plain = 0.0, float("nan")
    if kind == "cylinder":
        body, correction, plain = _remove_curvature_bias(rig, body, rest_frames, settings, radius)
        frame = _cylinder_frame(
            _cylinder_of(body.reconstruction, rest_frames, settings, body.points, radius), rig
        )
    else:
        frame = plane_frame(_at_rest_of(body.reconstruction, rest_frames)[0], rig)
    r = body.reconstruction
    used = referenced(r, rest_frames)
    surface = to_surface(r, frame, time, reference=rest_frames, points=used)
    covariances = frame.covariances(static_mean(r, rest_frames)[1][used])
    sigmas, points = np.sqrt(np.einsum("...ii->...i", covariances)), body.points[used]
    cylinder = cylinders(r, frame, body.points, settings, correction, plain) if kind == "cylinder" else None
    return FullField(
        kind=kind,
        unit="m",
        timed=timed,
        frame_outcome=frame_outcomes(health, surface),
        surface=surface,
        strain=strains_of(surface, points, settings, sigmas),
        points=points,
        cell=body.cell[used],
        pixels=np.stack([r.pixels[0][:, used], r.pixels[1][:, used]]),
        zncc=np.stack([body.tracks[0].zncc[:, used], body.tracks[1].zncc[:, used]]),
        epipolar=r.epipolar[:, used],
        noise=np.array(sigma),
        extensions=extensions(
            surface, points, extensometers, step=settings.step, subset=settings.subset, reference_sigma=sigmas
        ),
        cylinder=cylinder,
        remarks=tuple(of_findings(check_setup(rig, *r.pixels))),
        facts={
            **(facts or {}),
            **facts_of(settings, series, measured),
            "points_without_reference": int((~used).sum()),
            "stereo_shape": settings.stereo_shape.name.lower(),
        },
    )


def _noise(
    series: tuple[Pictures, Pictures],
    rig: StereoRig,
    health: tuple[IntArray, IntArray],
    mask: BoolArray,
    settings: FullFieldSettings,
) -> tuple[tuple[Noise, Noise], list[float], bool]:
    """Noise of both cameras, its size [grey], and whether it was declared or measured at rest."""
    first = known_noise(series[0], health[0], mask, settings)
    second = known_noise(series[1], health[1], None, settings)
    if first is not None and second is not None:
        return (first[0], second[0]), [first[1], second[1]], True
    points, _ = grid_points(mask, settings.step, margin=settings.margin)
    points = points[np.unique(np.linspace(0, len(points) - 1, TRIED).astype(int))]
    pair = [pictures.frame(settings.reference) for pictures in series]
    rough = (Noise(0.01 * float(np.std(pair[0]))), Noise(0.01 * float(np.std(pair[1]))))
    match = match_stereo(
        pair[0], pair[1], points, rig, settings.stereo, noise=rough, mask=mask, device=settings.device
    )
    if not match.valid.any():
        raise ValueError(NO_MATCH)
    found, zncc = points[match.valid], match.zncc[match.valid]
    places = (found, found + match.warp[match.valid, :2])
    sigma = [noise_from_matches(*one, zncc, settings.subset) for one in zip(pair, places, strict=True)]
    return (Noise(sigma[0]), Noise(sigma[1])), sigma, False

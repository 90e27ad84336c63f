"""Full-field measurement by two cameras: a curved surface, or a cylinder."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.follow import follow_body
from dic.bodies.region import Region, grid_points
from dic.camera import StereoRig
from dic.chain.remarks import of_findings
from dic.correlation import Noise
from dic.full_field.extensometers import Extensometer, extensions
from dic.full_field.frames import cylinder_frame, plane_frame
from dic.full_field.grey_noise import noise_from_matches
from dic.full_field.measure import (
    Progress,
    Series,
    as_series,
    facts_of,
    frame_outcomes,
    known_noise,
    strains_of,
    times_of,
    usable_reference,
    whole,
)
from dic.full_field.meeting import at_rest_of, corrected, cylinder_of, cylinders, gated
from dic.full_field.result import FullField
from dic.full_field.settings import FullFieldSettings
from dic.images import Pictures, frame_health
from dic.stereo import match_stereo
from dic.stereo.setup_check import check_setup
from dic.surfaces import referenced, static_mean, to_surface

TRIED = 300
"""Points whose matches give the noise of the grey values where nothing else does."""


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
        The cameras, for pictures with the crop of the series (`StereoRig.cropped`).
    settings, t, extensometers, facts, progress
        As for `dic.full_field.measure.measure_plane`.
    mask
        Pixels of the surface in camera 0's reference picture, shape [rows, columns]; None: the whole picture.

    Returns
    -------
    FullField
        In the frame of the plane that fits the reference places best.

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
    """Measure a cylinder by two cameras: its surface, and radius and axis of the cylinder of each frame.

    The bias that the curvature inside the subsets gives is taken off (`dic.full_field.curvature`).

    Parameters
    ----------
    pictures, rig, settings, mask, t, extensometers, facts, progress
        As for `measure_surface`.
    radius
        Radius at the reference, if it was measured otherwise [m]: the axis then lies by so much behind the
        surface. The radii of the frames are free all the same.

    Returns
    -------
    FullField
        y along the axis, Z from the axis toward the cameras.

    Raises
    ------
    ValueError
        As `measure_surface`, or if the reference places lie on no cylinder.
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
    health = (frame_health(series[0]).outcome, frame_health(series[1]).outcome)
    usable_reference(health, settings)
    time, timed = times_of(series[0], t)
    region = whole(mask, series[0])
    noise, sigma, measured = _noise(series, rig, health, region, settings)
    body = follow_body(
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
        progress=progress,
    )
    at_rest = settings.reference < settings.static
    rest = list(range(settings.static)) if at_rest else [settings.reference]
    body = gated(rig, body, rest)
    correction, plain = 0.0, float("nan")
    if kind == "cylinder":
        body, correction, plain = corrected(rig, body, rest, settings, radius)
        frame = cylinder_frame(cylinder_of(body.reconstruction, rest, settings, body.points, radius), rig)
    else:
        frame = plane_frame(at_rest_of(body.reconstruction, rest)[0], rig)
    r = body.reconstruction
    taken = referenced(r, rest)
    surface = to_surface(r, frame, time, reference=rest, points=taken)
    variance = np.einsum("...ii->...i", frame.covariances(static_mean(r, rest)[1][taken]))
    reference_sigma = np.sqrt(variance)
    points = body.points[taken]
    cylinder = cylinders(r, frame, body.points, settings, correction, plain) if kind == "cylinder" else None
    return FullField(
        kind=kind,
        unit="m",
        timed=timed,
        frame_outcome=frame_outcomes(health, surface),
        surface=surface,
        strain=strains_of(surface, points, settings, reference_sigma),
        points=points,
        cell=body.cell[taken],
        pixels=np.stack([r.pixels[0][:, taken], r.pixels[1][:, taken]]),
        zncc=np.stack([body.tracks[0].zncc[:, taken], body.tracks[1].zncc[:, taken]]),
        epipolar=r.epipolar[:, taken],
        noise=np.array(sigma),
        extensions=extensions(
            surface,
            points,
            extensometers,
            step=settings.step,
            subset=settings.subset,
            reference_sigma=reference_sigma,
        ),
        cylinder=cylinder,
        remarks=tuple(of_findings(check_setup(rig, *r.pixels))),
        facts={
            **(facts or {}),
            **facts_of(settings, series, measured),
            "points_without_reference": int((~taken).sum()),
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
    known = [
        known_noise(own, outcome, mask if camera == 0 else None, settings)
        for camera, (own, outcome) in enumerate(zip(series, health, strict=True))
    ]
    if known[0] is not None and known[1] is not None:
        return (known[0][0], known[1][0]), [known[0][1], known[1][1]], True
    points, _ = grid_points(mask, settings.step, margin=settings.margin)
    points = points[np.unique(np.linspace(0, len(points) - 1, TRIED).astype(int))]
    pair = [own.frame(settings.reference) for own in series]
    rough = (Noise(0.01 * float(np.std(pair[0]))), Noise(0.01 * float(np.std(pair[1]))))
    match = match_stereo(
        pair[0], pair[1], points, rig, settings.stereo, noise=rough, mask=mask, device=settings.device
    )
    if not match.valid.any():
        raise ValueError(
            "no point was matched between the cameras: check which camera is which, the calibration, the "
            "crop offsets and the region"
        )
    places = (points[match.valid], points[match.valid] + match.warp[match.valid, :2])
    sigma = [
        noise_from_matches(picture, where, match.zncc[match.valid], settings.subset)
        for picture, where in zip(pair, places, strict=True)
    ]
    return (Noise(sigma[0]), Noise(sigma[1])), sigma, False

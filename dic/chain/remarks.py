"""Remarks on a test, with numbers and cures: declared values, flyer's travel, speckles, facts for the
report."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from dic.basics import FloatArray, IntArray
from dic.bodies.axial_displacement import AxialDisplacement
from dic.bodies.follow import TrackedBody
from dic.bodies.region import Region, polygon_mask
from dic.chain.inputs import Inputs
from dic.images import GreyNoise, PictureError, Pictures, SpeckleQuality, grey_noise, speckle_quality
from dic.outcome import FrameOutcome, PointOutcome, Remark
from dic.result import Body, Placement, StereoResult
from dic.stereo.diagnose import Finding

RADIUS_SIGMAS = 4.0
"""Smallest difference of measured and declared radius that gives a remark, in standard deviations."""
RADIUS_SHARE = 0.01
"""Smallest such difference relative to the radius. Calibration or calliper may cause a smaller one."""


def of_findings(findings: Iterable[Finding]) -> list[Remark]:
    """Remarks on faults that the epipolar distances show."""
    return [
        Remark(name=finding.fault.name.lower().replace("_", " "), text=finding.what, cure=finding.cure)
        for finding in findings
    ]


def of_radius(placement: Placement, declared: float | None) -> list[Remark]:
    """Remark on a measured radius at rest that differs from the declared one."""
    if declared is None:
        return []
    off = placement.radius - declared
    if abs(off) <= max(RADIUS_SIGMAS * placement.radius_sigma, RADIUS_SHARE * declared):
        return []
    return [
        Remark(
            name="another radius",
            text=(
                f"the specimen at rest has a radius of {1e3 * placement.radius:.4f} ± "
                f"{2e3 * placement.radius_sigma:.4f} mm (k = 2), declared are {1e3 * declared:.4f} mm"
            ),
            cure="measure the specimen again; check the calibration's unit and target, and the region",
        )
    ]


def of_edge(cameras: int) -> list[Remark]:
    """Remark on an end of the specimen that was not found in the pictures."""
    if cameras:
        return []
    return [
        Remark(
            name="no edge",
            text="the specimen's end at the transmission platen was not found in either camera within two "
            "pixels of the declared place; the declared place is used",
            cure="declare it more closely; an error of a tenth of a pixel shifts all heights y by as much",
        )
    ]


def of_flyer(required: bool, axial: AxialDisplacement | None) -> list[Remark]:
    """Remark on a flyer whose position at rest is not known, or which is not visible."""
    if required and axial is not None and axial.from_rim:
        sigma = 1e6 * axial.rest_sigma
        return [
            Remark(
                name="rest from the flyer's rim",
                text="no static frame shows enough of the flyer; its place at rest follows from the "
                f"specimen's declared length and the rim of its face in later frames, to {sigma:.1f} µm",
                cure="nothing to do; a few rows of the flyer in view at rest determine it to a micrometre",
            )
        ]
    if not required or axial is not None:
        return []
    return [
        Remark(
            name="no displacement of the flyer",
            text="no frame shows the flyer in both cameras, or it is not visible at rest and the rim of "
            "its face is not clear in enough frames",
            cure="declare a region of it, clear of its edge, in a frame that shows much of it",
        )
    ]


def of_rim(past: float, narrower: bool) -> list[Remark]:
    """Remark on a region of the flyer that reaches past the rim of its face. ``past``: distance past the rim
    [px]. ``narrower``: True if only the part before the rim was tracked."""
    if past <= 0.0:
        return []
    return [
        Remark(
            name="region of the flyer past its rim",
            text=f"the region of the flyer reaches {past:.1f} px past the rim of its face, where the face or "
            "the specimen is seen, and no longer its side; "
            + ("what lies past it was left out" if narrower else "too little of it lies before the rim"),
            cure="nothing to do; a region that ends before the rim is used unchanged"
            if narrower
            else "declare a region of it, clear of its edge, in a frame that shows more of it",
        )
    ]


def of_missing_points(outcome: IntArray) -> list[Remark]:
    """Remark on points that were not found by both cameras in any static frame, given their outcomes."""
    if outcome.size == 0:
        return []
    ends = _counted(outcome)
    words = ", ".join(f"{count} {_words(end.name)}" for end, count in ends)
    most = max(ends, key=lambda pair: pair[1])[0]
    return [
        Remark(
            name="points without a place at rest",
            text=f"{outcome.size} points of the region were found by both cameras in no static frame: "
            f"{words}",
            cure=most.cure,
        )
    ]


def of_uncertain_rows(count: int, largest: float | None) -> list[Remark]:
    """Remark on rows of the outline that were left out for their sigma."""
    if not count or largest is None:
        return []
    return [
        Remark(
            name="uncertain rows",
            text=f"{count} rows of the outline, over all frames, have a sigma above {1e6 * largest:.3g} µm "
            "and are left out of it",
            cure="nothing to do; a larger limit of sigma includes them",
        )
    ]


def of_frames(health: tuple[IntArray, IntArray]) -> list[Remark]:
    """Remarks on pictures that could not be used, camera by camera and kind by kind."""
    findings = []
    for camera, outcome in enumerate(health):
        for kind in FrameOutcome:
            frames = np.flatnonzero(outcome == kind)
            if kind.ok or not frames.size:
                continue
            listed = ", ".join(str(frame) for frame in frames[:10]) + (
                " and more" if frames.size > 10 else ""
            )
            findings.append(
                Remark(
                    name=f"{_words(kind.name)} pictures",
                    text=f"camera {camera}, frame {listed} (counted from 0): {kind.cause}",
                    cure=kind.cure,
                )
            )
    return findings


def of_material(body: TrackedBody, region: Region) -> list[Remark]:
    """Remark on a material picture that differs from the declared one."""
    if body.material == region.frame:
        return []
    return [
        Remark(
            name="another reference",
            text=f"the region is declared in frame {region.frame}, which cannot be used; points were "
            f"chosen in frame {body.material}",
            cure="see that the body lies in the region there too",
        )
    ]


def _counted(outcome: IntArray) -> list[tuple[PointOutcome, int]]:
    numbers, counts = np.unique(outcome, return_counts=True)
    return [(PointOutcome(int(number)), int(count)) for number, count in zip(numbers, counts, strict=True)]


def _words(name: str) -> str:
    return name.lower().replace("_", " ")


SIGMAS = 5.0
"""Smallest disagreement that gives a remark, in standard deviations."""
STEP_SHARE = 0.35
"""Smallest deviation of a frame-to-frame step that gives a remark, relative to the steps around it."""
STEADY = 0.2
"""The motion is steady if the steps before and after differ by less than this share [-]."""
AROUND = 3
"""Number of steps on either side with which a step is compared."""
MOST_AHEAD = 1.05
"""Largest displacement of the specimen's fastest points over that of the flyer that pushes them [-]."""
FASTEST = 95.0
"""Percentile of the points' displacements that represents the fastest points."""
FEWEST_POINTS = 10


def of_travel(axial: AxialDisplacement | None, specimen: Body) -> list[Remark]:
    """Remarks if the flyer's displacement contradicts its own steps, the specimen's end or the specimen's
    points.

    ``axial``: the displacement; None: nothing is checked.
    """
    if axial is None:
        return []
    remarks = []
    frames = uneven_steps(axial)
    if frames.size:
        listed = ", ".join(str(k) for k in frames[:10].tolist()) + (" and more" if frames.size > 10 else "")
        remarks.append(
            Remark(
                name="uneven steps of the flyer",
                text=f"up to frame {listed} (counted from 0) the flyer moved by a third less, or more, than "
                "in the frames around",
                cure="look for pictures that are missing or doubled in both series; the times after one are "
                "wrong by a frame",
            )
        )
    if axial.rim_disagreement is not None:
        off, sigma = axial.rim_disagreement
        if abs(off) > SIGMAS * sigma:
            remarks.append(
                Remark(
                    name="flyer off the specimen's end",
                    text=f"at rest the rim of the flyer's face stands {1e6 * off:.0f} ± {1e6 * sigma:.0f} µm "
                    "(k = 1) from the specimen's upper end by its declared length",
                    cure="check the specimen's length, the crop offsets of both cameras, the calibration, "
                    "the region flyer, and whether the flyer touched the specimen at rest",
                )
            )
    ahead = fastest_share(axial, specimen)
    if ahead is not None and ahead > MOST_AHEAD:
        remarks.append(
            Remark(
                name="specimen ahead of the flyer",
                text=f"the specimen's fastest points moved {ahead:.2f} times as far as the flyer that pushes "
                "them",
                cure="look where the region flyer lies in its frame: it must hold nothing of the specimen",
            )
        )
    return remarks


def uneven_steps(axial: AxialDisplacement) -> IntArray:
    """Frames whose step differs from the steady steps before and after it.

    Steps are compared as speeds, so that missing frames have no effect.
    """
    dt = np.diff(axial.t)
    speed = np.diff(axial.displacement) / dt
    noise = np.hypot(axial.sigma[1:], axial.sigma[:-1]) / dt
    uneven = []
    for k in range(AROUND, speed.size - AROUND):
        before = float(np.median(speed[k - AROUND : k]))
        after = float(np.median(speed[k + 1 : k + 1 + AROUND]))
        usual = 0.5 * (before + after)
        if abs(after - before) > STEADY * abs(usual):
            continue  # starting or at rest
        if abs(speed[k] - usual) > max(STEP_SHARE * abs(usual), SIGMAS * float(noise[k])):
            uneven.append(int(axial.frame[k + 1]))
    return np.array(uneven, dtype=np.int64)


def fastest_share(axial: AxialDisplacement, specimen: Body) -> float | None:
    """Ratio of the axial displacement of the specimen's fastest points to that of the flyer. Median over the
    later half.

    The flyer pushes the specimen against a platen, so no point of the specimen moves farther than the flyer.
    """
    surface = specimen.surface
    late = axial.displacement > 0.5 * float(axial.displacement.max(initial=0.0))
    shares = []
    for frame, travel in zip(axial.frame[late].tolist(), axial.displacement[late].tolist(), strict=True):
        fine = surface.outcome[frame] == PointOutcome.VALID
        if fine.sum() >= FEWEST_POINTS and travel > 0.0:
            shares.append(float(np.percentile(-surface.u[frame, fine, 1], FASTEST)) / travel)
    return float(np.median(shares)) if shares else None


WANTED = 0.02
"""A subset is reported as too small if the predicted standard deviation of its match is larger than this
[px]."""
MOST_AVERAGED = 50
"""Largest number of static pictures that are averaged."""


@dataclass(frozen=True)
class Speckles:
    """The speckles of one camera."""

    picture: FloatArray
    """Mean of the static pictures [grey], shape [rows, columns]."""
    quality: SpeckleQuality


def speckles(
    pictures: Pictures,
    frames: Sequence[int],
    noise: GreyNoise,
    pixels: FloatArray,
    *,
    subset: int,
    wanted: float = WANTED,
) -> Speckles:
    """Assess the speckles in the area of a body's points at rest, in one camera.

    ``frames``: static frames with a usable picture. ``pixels``: positions of the body's points at rest in its
    picture [px], shape [n, 2]; NaN where not visible. Their convex hull is assessed. ``subset``: side of the
    subsets [px]. ``wanted``: predicted standard deviation that a subset should reach [px]. Raises ValueError
    if there are fewer than three points, if all points are on one line, or if there is no contrast between
    them.
    """
    chosen = list(frames)[:MOST_AVERAGED]
    finite = pixels[np.isfinite(pixels).all(axis=1)]
    if len(finite) < 3 or np.linalg.matrix_rank(finite - finite[0]) < 2:
        raise ValueError(f"{len(finite)} points span no area whose speckles could be judged")
    corners = finite[ConvexHull(finite).vertices]
    total = np.zeros(pictures.shape)
    for frame in chosen:
        total += pictures.frame(frame)
    mean = total / len(chosen)
    mask = polygon_mask([(float(x), float(y)) for x, y in corners], pictures.shape)
    return Speckles(mean, speckle_quality(mean, mask, subset, noise, averaged=len(chosen), wanted=wanted))


def _quality_facts(quality: SpeckleQuality) -> dict[str, Any]:
    """Facts of the speckles for the reporting table, in JSON types: lengths in px, gradients in grey/px."""
    judged = ~np.any(np.isnan(quality.floor), axis=2)
    worst = quality.floor[judged].max(axis=1)
    subsets = np.zeros(0) if quality.needed is None else quality.needed[judged]
    return {
        "size": list(quality.size),
        "size_by_edges": quality.size_by_edges,
        "coverage": quality.coverage,
        "mean_gradient": quality.mean_gradient,
        "noise": quality.noise,
        "floor": quality.median_floor if worst.size else None,
        "wanted": quality.wanted,
        "too_small": float(quality.too_small[judged].mean()) if worst.size else None,
        # the subset that is large enough at nearly all places; none if no tried size is
        "needed": int(np.percentile(subsets, 95)) if subsets.size and np.mean(subsets > 0) > 0.95 else None,
    }


def speckles_of(
    result: StereoResult, pictures: tuple[Pictures, Pictures]
) -> tuple[Speckles | None, Speckles | None]:
    """The speckles of both cameras of a stereo result; None if they cannot be assessed.

    ``result``: the stereo result; its table gives the reason if a camera's speckles cannot be assessed.
    """
    by_camera: list[Speckles | None] = []
    rest_frames = np.flatnonzero(result.static & result.specimen.surface.valid.any(axis=1)).tolist()
    inputs = result.facts.get("speckle") or [{"problem": "not asked for"}] * len(pictures)
    for series, pixels, fact in zip(pictures, result.specimen.pixels, inputs, strict=True):
        if "problem" in fact:
            by_camera.append(None)
            continue
        noise = grey_noise(series, rest_frames)
        subset = result.facts["settings"]["subset"]
        by_camera.append(
            speckles(series, rest_frames, noise, pixels[rest_frames[0]], subset=subset, wanted=fact["wanted"])
        )
    return by_camera[0], by_camera[1]


def facts_of(inputs: Inputs) -> dict[str, Any]:
    """Facts on the pictures and settings, in JSON types."""
    pictures, settings = inputs.pictures, inputs.settings
    correlation = settings.tracking.correlation
    return {
        "pictures": {
            "shape": list(pictures[0].shape),
            "bits": pictures[0].bits,
            "crop_offset": [list(series.crop_offset) for series in pictures],
            "noise_grey": [grey.sigma for grey in inputs.grey],
        },
        "settings": {
            "subset": correlation.subset,
            "step": settings.step,
            "strain_window": settings.strain_window,
            "prefilter": correlation.prefilter,
            "shape": correlation.shape.name.lower(),
            "stereo_shape": settings.stereo.shape.name.lower(),
            "criterion": "ZNSSD, inverse-compositional Gauss-Newton",
            "interpolant": "quintic B-spline",
            "reference": "a point's own earlier picture, renewed where its correlation or stretch requires "
            "it",
            "strip_half_width_m": settings.strip_half_width,
            "toward_flyer": settings.toward_flyer,
            "zero_px": list(settings.zero),
        },
    }


def speckle_settings_facts(inputs: Inputs, specimen: Body, rest_frames: list[int]) -> list[dict[str, Any]]:
    """The speckle report of both cameras, or the reason why there is none."""
    settings_facts: list[dict[str, Any]] = []
    for series, noise, pixels in zip(inputs.pictures, inputs.grey, specimen.pixels, strict=True):
        try:
            judged = speckles(
                series, rest_frames, noise, pixels[rest_frames[0]], subset=inputs.settings.subset
            )
        except (PictureError, ValueError) as error:
            settings_facts.append({"problem": str(error)})
        else:
            settings_facts.append(_quality_facts(judged.quality))
    return settings_facts

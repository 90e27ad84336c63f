"""Correlation of a shot's pictures as declared in its file: regions, settings, and the call of `dic.chain`.

Before the correlation, the declared length of the specimen is compared with the scale of the calibrated
pictures.
"""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from time import perf_counter
from typing import Any, Literal

import numpy as np

from dic.bodies.region import Region, find_regions, polygon_mask
from dic.camera import Camera, StereoRig
from dic.chain import VERSION, ChainError, ChainSettings, inspect_pictures, measure
from dic.correlation import Correlation, Shape, load_kernels
from dic.images import of_colours
from dic.outcome import FrameOutcome
from dic.processes import background
from dic.result import StereoResult
from dic.tracking import Tracking
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.pictures.picture_set import PictureSet, Progress
from kolsky.pictures.rig import calibrate_in_background, refine_rig
from kolsky.schema.apparatus import SpecimenSection
from kolsky.schema.pictures import DicSection, RegionSection
from kolsky.schema.shot_file import ShotToml

LEAST_SHARE = 0.2
"""Smallest visible share of the specimen's length in its region. It is the same as for an exported
outline."""
LARGEST_SHARE = 1.5
"""Largest extent of the region divided by the specimen's length. A region may extend onto the platens."""
DISTANCES = 20_001
"""Number of trial distances along a ray, in geometric progression."""
NEAREST, FURTHEST = 1e-3, 1e3
"""Smallest and largest distance of a specimen from the camera [m]."""


def visible_lengths(
    rig: StereoRig,
    corners: FloatArray,
    toward: Literal["up", "down", "left", "right"],
    shapes: tuple[tuple[int, int], tuple[int, int]],
) -> tuple[float, float] | None:
    """Smallest and largest length that the extent of a region can have [m]."""
    first, second = rig.cameras
    along = 1 if toward in ("up", "down") else 0
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    ends = np.stack([middle, middle])
    ends[:, along] = corners[:, along].min(), corners[:, along].max()
    extent = float(np.linalg.norm(np.diff(first.undistort(ends), axis=0)))  # on the plane z = 1
    distances = visible_distances(first, second, middle, shapes[1])
    if distances.size == 0:
        return None
    return extent * float(distances.min()), extent * float(distances.max())


def visible_distances(first: Camera, second: Camera, pixel: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Distances along the ray of a pixel of camera 0 that are visible in camera 1 [m], shape [n]."""
    distances = np.geomspace(NEAREST, FURTHEST, DISTANCES)
    ray = np.append(first.undistort(pixel), 1.0)
    points = (distances[:, None] * ray - first.translation) @ first.rotation
    seen = second.project(points)
    with np.errstate(invalid="ignore"):
        inside = np.all((seen >= 0.0) & (seen <= np.array(shape[::-1]) - 1.0), axis=-1)
    return distances[inside]


def length_contradicts(length: float, seen: tuple[float, float] | None) -> bool:
    """True if the length of a region in the pictures contradicts the specimen's length; both in m."""
    if seen is None:
        return False
    return seen[1] < LEAST_SHARE * length or seen[0] > LARGEST_SHARE * length


def check_length(toml: ShotToml, seen: tuple[float, float] | None) -> None:
    """Reject a declared length that contradicts the pictures.

    ``seen``: smallest and largest length of the specimen's region, by `visible_lengths`. Raises InputError if
    `length_contradicts`.
    """
    length = toml.declared.specimen.length
    if seen is not None and length_contradicts(length, seen):
        raise toml.error(
            "specimen.length",
            f"contradicts the pictures: the specimen's region in them is {seen[0] * 1e3:.4g} to"
            f" {seen[1] * 1e3:.4g} mm long by the cameras' calibration",
            allowed=f"{seen[0] / LARGEST_SHARE * 1e3:.4g} to {seen[1] / LEAST_SHARE * 1e3:.4g} mm",
            cure="is the unit of specimen.length right, and that of the calibration target?",
        )


def key_of(pictures: PictureSet) -> str:
    """Key of a stereo result: SHA-256 of inputs, declarations and the version of the analysis."""
    declared = pictures.toml.declared
    parts: dict[str, Any] = {
        "version": VERSION,
        "inputs": pictures.inputs,
        "specimen": [declared.specimen.diameter, declared.specimen.length, length_sigma_of(pictures.toml)],
        "frames": [pictures.frames.sha256, declared.frames.model_dump(mode="json")],
        **{
            name: None if section is None else section.model_dump(mode="json")
            for name in ("pictures", "calibration", "dic", "reporting")
            for section in [getattr(declared, name)]
        },
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Places:
    """Regions of the bodies in the pictures of camera 0."""

    specimen: Region
    """The specimen."""
    flyer: Region
    """The flyer."""
    edge: tuple[float, float]
    """End of the specimen at the transmission platen [px]."""
    found: tuple[str, ...]
    """Keys of [dic] that were found in the pictures because they were not declared."""
    why: str = ""
    """Method that distinguished the flyer from the specimen, if regions were found."""

    @property
    def words(self) -> dict[str, Any]:
        """The regions as facts of a result, in JSON types."""
        return {
            "specimen": [list(corner) for corner in self.specimen.corners],
            "specimen_frame": self.specimen.frame,
            "flyer": [list(corner) for corner in self.flyer.corners],
            "flyer_frame": self.flyer.frame,
            "transmission_edge": list(self.edge),
            "found": list(self.found),
            "why": self.why,
        }


def places_of(pictures: PictureSet) -> Places:
    """The regions declared in the shot file, or else detected in the pictures.

    Raises InputError if a region is neither declared nor found.
    """
    section = pictures.toml.declared.dic
    assert section is not None  # shots with pictures have it
    specimen, flyer, edge = section.specimen, section.flyer, section.transmission_edge
    places: dict[str, Any] = {
        "specimen": specimen and region_of(specimen),
        "flyer": flyer and region_of(flyer),
        "transmission_edge": edge,
    }
    missing = tuple(key for key, place in places.items() if place is None)
    found = None
    if missing:
        static = np.arange(pictures.time.size) < pictures.toml.declared.frames.static
        usable = np.logical_and(*(health.outcome == FrameOutcome.VALID for health in pictures.health))
        try:
            found = find_regions(pictures.series[0], static, usable, toward=section.flyer_side)
        except ValueError as error:
            raise pictures.toml.error(
                f"dic.{missing[0]}",
                f"is not declared and cannot be found: {error}",
                cure="draw them over camera 0's pictures: "
                f"`kolsky dic {pictures.toml.path.parent} --regions`, or write their corners into [dic]",
            ) from error
        detected = {"specimen": found.specimen, "flyer": found.flyer, "transmission_edge": found.edge}
        places |= {key: detected[key] for key in missing}
    edge = places["transmission_edge"]
    return Places(places["specimen"], places["flyer"], edge, missing, "" if found is None else found.why)


def region_of(section: RegionSection) -> Region:
    """A declared region as the correlation needs it."""
    return Region(corners=section.corners, frame=section.frame)


def _chain_settings(
    section: DicSection,
    specimen: SpecimenSection,
    edge: tuple[float, float],
    device: str = "cpu",
    length_sigma: float = 0.0,
) -> ChainSettings:
    """The settings of `dic.chain`, with the specimen's end [px] and the sigma of its length [m]."""
    subset = Correlation(
        subset=section.subset, shape=Shape[section.shape.upper()], prefilter=section.prefilter
    )
    return ChainSettings(
        toward_flyer=section.flyer_side,
        zero=edge,
        strip_half_width=section.strip_half_width,
        radius=0.5 * specimen.diameter,
        length=specimen.length,
        length_sigma=length_sigma,
        largest_sigma=section.largest_sigma,
        step=section.step,
        strain_window=section.strain_window,
        tracking=Tracking(correlation=subset),
        stereo=Correlation(subset=section.subset, shape=Shape.QUADRATIC, prefilter=section.prefilter),
        device=device,
    )


def length_sigma_of(toml: ShotToml) -> float:
    """Standard deviation of the specimen's length that the shot file declares [m]."""
    declared = toml.declared
    share = 0.0 if declared.uncertainty is None else declared.uncertainty.specimen_length
    return share * declared.specimen.length


def length_in_pictures_of(toml: ShotToml) -> float:
    """Standard uncertainty of the length in the pictures that the shot file declares [m]."""
    declared = toml.declared.uncertainty
    return 0.0 if declared is None else declared.length_in_pictures


def _software() -> str:
    try:
        return f"kolsky {version('kolsky')}"
    except PackageNotFoundError:
        return "kolsky, not installed"


def correlate(pictures: PictureSet, device: str, progress: Progress) -> StereoResult:
    """The stereo result of a shot.

    ``pictures``, ``device``, ``progress``: as for `kolsky.shot.optical_data.surfaces`. Raises InputError for
    the same reasons.
    """
    toml, declared = pictures.toml, pictures.toml.declared
    section = declared.dic
    assert section is not None  # shots with pictures have it
    static = np.arange(pictures.time.size) < declared.frames.static
    with calibrate_in_background(pictures) as solved:
        # the message about the device comes from its first use
        with background(partial(load_kernels, device), fork=False):
            places = places_of(pictures)
            try:
                inspection = inspect_pictures(pictures.series, static, pictures.health)
            except ChainError as error:
                raise _no_surface(toml, error) from error
        started = perf_counter()
        found = solved(progress)
    calibrating = perf_counter() - started
    sizes = (pictures.series[0].shape, pictures.series[1].shape)
    seen = visible_lengths(found.rig, np.array(places.specimen.corners), section.flyer_side, sizes)
    check_length(toml, seen)
    settings = _chain_settings(section, declared.specimen, places.edge, device, length_sigma_of(toml))
    reporting = {} if declared.reporting is None else declared.reporting.model_dump(exclude_none=True)
    try:
        started = perf_counter()
        assert declared.calibration is not None  # shots with pictures have it
        rig, refinement = refine_rig(
            declared.calibration,
            found.rig,
            pictures.series,
            places.specimen.frame,
            polygon_mask(places.specimen.corners, pictures.series[0].shape),
            settings.stereo,
            step=section.step,
            device=device,
        )
        result = measure(
            pictures.series,
            rig,
            settings,
            t=pictures.time,
            static=static,
            specimen=places.specimen,
            flyer=places.flyer,
            facts={
                "reporting": reporting,
                "calibration": found.words,
                "software": _software(),
                "regions": places.words,
                **({"refinement": refinement} if refinement else {}),
            },
            progress=progress,
            inspection=inspection,
        )
        whole = {"calibration": calibrating, "correlation": perf_counter() - started}
        remarks = (*result.remarks, *of_colours(pictures.series))
        return replace(result, seconds={**whole, **result.seconds}, remarks=remarks)
    except ChainError as error:
        raise _no_surface(toml, error) from error
    except ValueError as error:
        raise toml.error("dic", f"does not fit the pictures: {error}") from error


def _no_surface(toml: ShotToml, error: ChainError) -> InputError:
    return InputError(
        toml.path,
        f"its pictures give no surface: {error}",
        cure="look at them with `kolsky dic --regions`: are specimen and cameras right?",
    )

"""The pictures of a shot correlated as its file declares: regions, settings, the chain of `dic.chain`."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from time import perf_counter
from typing import Any

import numpy as np

from dic.bodies.found_regions import FoundRegions, find_regions
from dic.bodies.region import Region, polygon_mask
from dic.bodies.second_camera import second_camera
from dic.chain import VERSION, ChainError, ChainSettings, inspect_pictures, measure
from dic.correlation import Correlation, Shape
from dic.images import frame_health
from dic.images.facts import of_colours
from dic.outcome import FrameOutcome
from dic.result import StereoResult
from dic.tracking import Tracking
from kolsky.base.errors import InputError
from kolsky.shot.picture_scale import check_length, lengths_seen
from kolsky.shot.picture_set import PictureSet
from kolsky.shot.refined_rig import refined
from kolsky.shot.rig import Calibrated, calibrated
from kolsky.shot.schema.apparatus import SpecimenSection
from kolsky.shot.schema.pictures import DicSection, RegionSection
from kolsky.shot.schema.reading import ShotToml

Progress = Callable[[str, int, int], None]


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
    """Where the specimen ends at the transmission platen [px]."""
    found: tuple[str, ...]
    """Keys of [dic] that were not declared and were found."""
    why: str = ""
    """How the flyer was told from the specimen, if anything was found."""

    @property
    def words(self) -> dict[str, Any]:
        """The same for the facts of a result, as JSON can hold it."""
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
    """The regions that the shot file declares, and those that it leaves to the pictures.

    Raises
    ------
    InputError
        If one that is not declared is not clear in the pictures.
    """
    section = pictures.toml.declared.dic
    assert section is not None  # shots with pictures have it
    missing = tuple(
        key for key in ("specimen", "flyer", "transmission_edge") if getattr(section, key) is None
    )
    found = None
    if missing:
        static = np.arange(pictures.time.size) < pictures.toml.declared.frames.static
        usable = np.ones(pictures.time.size, dtype=bool)
        for series in pictures.series:
            usable &= frame_health(series).outcome == FrameOutcome.VALID
        try:
            found = find_regions(pictures.series[0], static, usable, toward=section.flyer_side)
        except ValueError as error:
            raise pictures.toml.error(
                f"dic.{missing[0]}",
                f"is not declared and cannot be found: {error}",
                cure="draw them over camera 0's pictures: "
                f"`kolsky dic {pictures.toml.path.parent} --regions`, or offline with --grid",
            ) from error
    specimen, flyer, edge = section.specimen, section.flyer, section.transmission_edge
    return Places(
        specimen=_region(specimen) if specimen is not None else _known(found).specimen,
        flyer=_region(flyer) if flyer is not None else _known(found).flyer,
        edge=edge if edge is not None else _known(found).edge,
        found=missing,
        why="" if found is None else found.why,
    )


def _known(found: FoundRegions | None) -> FoundRegions:
    assert found is not None  # something was missing
    return found


def chain_settings(
    section: DicSection,
    specimen: SpecimenSection,
    edge: tuple[float, float],
    device: str = "cpu",
    length_sigma: float = 0.0,
) -> ChainSettings:
    """The chain's settings as a shot file declares them, of this specimen that ends at `edge` [px], its
    length known to `length_sigma` [m]."""
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


def correlated(
    pictures: PictureSet,
    device: str,
    progress: Progress,
    *,
    cameras: Callable[[Progress], Calibrated] | None = None,
    idle: Callable[[], None] = lambda: None,
) -> StereoResult:
    """The stereo result of a shot.

    Parameters
    ----------
    pictures, device, progress, cameras, idle
        As of `kolsky.shot.optical_data.surfaces`.

    Raises
    ------
    InputError
        As `kolsky.shot.optical_data.surfaces`.
    """
    toml, declared = pictures.toml, pictures.toml.declared
    section = declared.dic
    assert section is not None  # shots with pictures have it
    # others may be looking at the target meanwhile
    places = places_of(pictures)
    static = np.arange(pictures.time.size) < declared.frames.static
    try:
        inspection = inspect_pictures(pictures.series, static)
    except ChainError as error:
        raise _no_surface(toml, error) from error
    with second_camera(inspection.pictures, device) as second:
        started = perf_counter()
        found = calibrated(pictures, progress) if cameras is None else cameras(progress)
        calibrating = perf_counter() - started
        sizes = (pictures.series[0].shape, pictures.series[1].shape)
        seen = lengths_seen(found.rig, np.array(places.specimen.corners), section.flyer_side, sizes)
        check_length(toml, seen)
        settings = chain_settings(section, declared.specimen, places.edge, device, length_sigma_of(toml))
        reporting = {} if declared.reporting is None else declared.reporting.model_dump(exclude_none=True)
        try:
            started = perf_counter()
            assert declared.calibration is not None  # shots with pictures have it
            rig, refinement = refined(
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
                idle=idle,
                inspection=inspection,
                second=second,
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


def _region(section: RegionSection) -> Region:
    return Region(corners=section.corners, frame=section.frame)

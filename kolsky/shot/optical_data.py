"""Measurements of a shot's cameras: correlated once, kept in the results folder, read back
after."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from dic.bodies.found_regions import FoundRegions, find_regions
from dic.bodies.region import Region, polygon_mask
from dic.chain import VERSION, ChainError, ChainSettings, measure
from dic.correlation import Correlation, Shape
from dic.images import frame_health
from dic.outcome import FrameOutcome
from dic.result import StereoResult
from dic.tracking import Tracking
from kolsky.bars.flyer.flight_report import FlightOfSpecimen, add_to, flight_of
from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.base.process import infrequent_gc, single_threaded_libraries
from kolsky.base.records import CentreLine, FlyerMotion
from kolsky.shot.flyer_refusal import why_unknown
from kolsky.shot.picture_set import PictureSet
from kolsky.shot.records import OpticalData
from kolsky.shot.refined_rig import refined
from kolsky.shot.rig import calibrated
from kolsky.shot.schema.apparatus import SpecimenSection
from kolsky.shot.schema.pictures import DicSection, RegionSection
from kolsky.shot.schema.reading import ShotToml
from kolsky.shot.surfaces_file import read_stereo_result, stored_key, write_stereo_result

RESULT_FILE = "dic.h5"
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Surfaces:
    """The stereo result of a shot, and the file it is in."""

    result: StereoResult
    """What the pictures gave."""
    path: Path
    """Its file."""
    fresh: bool
    """True if it was computed now, False if it was read back."""
    flight: FlightOfSpecimen | str
    """The flyer's flight, or why it is not known."""

    @property
    def warnings(self) -> list[str]:
        """Warnings about the measurement."""
        from kolsky.shot import dic_summary

        return dic_summary.warnings(self.result)

    def rows(self) -> dict[str, str]:
        """Numbers of the measurement by name, as a terminal shows them."""
        from kolsky.bars.flyer import flight_report
        from kolsky.shot import dic_summary

        return {**dic_summary.printed(self.result), **flight_report.printed(self.flight)}

    def summary(self) -> dict[str, Any]:
        """Numbers of the measurement for JSON, SI."""
        from kolsky.bars.flyer import flight_report
        from kolsky.shot import dic_summary

        return {
            **dic_summary.summary(self.result),
            **flight_report.summary(self.flight),
            "remarks": self.warnings,
        }


def surfaces(
    pictures: PictureSet,
    folder: Path,
    *,
    device: str = "cpu",
    again: bool = False,
    progress: Progress = lambda stage, done, total: None,
) -> Surfaces:
    """Correlate the pictures of a shot, or read back what they gave.

    Parameters
    ----------
    pictures
        The pictures.
    folder
        Where `RESULT_FILE` is or will be. It is used again if inputs, declarations and the version of the
        chain are those it was made with.
    device
        Where pictures are correlated, "cpu" or a CUDA device.
    again
        Correlate even if there is such a file.
    progress
        Told of the frames done, stage by stage.

    Raises
    ------
    InputError
        If the cameras cannot be calibrated or nothing can be measured.
    """
    path, key = folder / RESULT_FILE, key_of(pictures)
    length = pictures.toml.declared.specimen.length
    if not again and stored_key(path) == key:
        try:
            result = read_stereo_result(path)
            return Surfaces(result=result, path=path, fresh=False, flight=flight_of(result, length))
        except InputError:
            pass  # damaged since it was written: made anew
    with single_threaded_libraries(), infrequent_gc():
        result = _correlated(pictures, device, progress)
        flight = flight_of(result, length)
    with filling(folder) as partial:
        write_stereo_result(partial / RESULT_FILE, result, key=key)
        if not isinstance(flight, str):
            add_to(partial / RESULT_FILE, flight)
    return Surfaces(result=result, path=path, fresh=True, flight=flight)


def measured(
    pictures: PictureSet,
    folder: Path | None = None,
    *,
    device: str = "cpu",
    progress: Progress = lambda stage, done, total: None,
) -> OpticalData:
    """Flyer and outline of a shot from its pictures.

    Parameters
    ----------
    pictures
        The pictures.
    folder
        Where the result is kept; by default the folder "results" of the shot.
    device
        Where pictures are correlated.
    progress
        Told of the frames done, stage by stage.

    Raises
    ------
    InputError
        As `surfaces`, or if the flyer was not found.
    """
    found = surfaces(
        pictures, folder or pictures.toml.path.parent / "results", device=device, progress=progress
    )
    result, number = found.result, pictures.frames.frame
    if result.axial_displacement is None or result.axial_displacement.t.size == 0:
        length = pictures.toml.declared.specimen.length
        problem, cure = why_unknown(result, length, _length_sigma(pictures.toml))
        draw = f"`kolsky dic {pictures.toml.path.parent} --regions` draws one"
        raise pictures.toml.error("dic.flyer", problem, cure=f"{cure}; {draw}")
    line = result.centre
    return OpticalData(
        flyer=FlyerMotion(
            time=result.axial_displacement.t,
            displacement=result.axial_displacement.displacement,
            sigma=result.axial_displacement.sigma,
            zero_sigma=result.axial_displacement.rest_sigma,
        ),
        centre_line=CentreLine(time=line.t, frame=number[line.frame], y=line.y, Z=line.Z, sigma=line.sigma),
        source=found.path,
        symmetry_end=None if isinstance(found.flight, str) else found.flight.end,
    )


def key_of(pictures: PictureSet) -> str:
    """Key of a stereo result: SHA-256 of inputs, declarations and the version of the analysis."""
    declared = pictures.toml.declared
    parts: dict[str, Any] = {
        "version": VERSION,
        "inputs": pictures.inputs,
        "specimen": [declared.specimen.diameter, declared.specimen.length, _length_sigma(pictures.toml)],
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


def _length_sigma(toml: ShotToml) -> float:
    """Standard deviation of the specimen's length that the shot file declares [m]."""
    declared = toml.declared
    share = 0.0 if declared.uncertainty is None else declared.uncertainty.specimen_length
    return share * declared.specimen.length


def _software() -> str:
    try:
        return f"kolsky {version('kolsky')}"
    except PackageNotFoundError:
        return "kolsky, not installed"


def _correlated(pictures: PictureSet, device: str, progress: Progress) -> StereoResult:
    toml, declared = pictures.toml, pictures.toml.declared
    section = declared.dic
    assert section is not None  # shots with pictures have it
    started = perf_counter()
    cameras = calibrated(pictures, progress)
    calibrating = perf_counter() - started
    places = places_of(pictures)
    static = np.arange(pictures.time.size) < declared.frames.static
    settings = chain_settings(section, declared.specimen, places.edge, device, _length_sigma(toml))
    reporting = {} if declared.reporting is None else declared.reporting.model_dump(exclude_none=True)
    try:
        started = perf_counter()
        assert declared.calibration is not None  # shots with pictures have it
        rig, refinement = refined(
            declared.calibration,
            cameras.rig,
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
                "calibration": cameras.words,
                "software": _software(),
                "regions": places.words,
                **({"refinement": refinement} if refinement else {}),
            },
            progress=progress,
        )
        whole = {"calibration": calibrating, "correlation": perf_counter() - started}
        return replace(result, seconds={**whole, **result.seconds})
    except ChainError as error:
        raise InputError(
            toml.path,
            f"its pictures give no surface: {error}",
            cure="look at them with `kolsky dic --regions`: are specimen and cameras right?",
        ) from error
    except ValueError as error:
        raise toml.error("dic", f"does not fit the pictures: {error}") from error


def _region(section: RegionSection) -> Region:
    return Region(corners=section.corners, frame=section.frame)

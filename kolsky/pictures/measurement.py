"""A measurement by image correlation only: from dic.toml to a `dic.full_field` result."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.bodies.region import polygon_mask
from dic.correlation import Correlation, Shape
from dic.files import regular
from dic.full_field.measure import Extensometer, FullFieldSettings
from dic.images import PictureError, Pictures, of_colours
from dic.result import FullField
from dic.tracking import Tracking
from kolsky.base.errors import InputError, refuse
from kolsky.base.process import infrequent_gc, single_threaded_libraries
from kolsky.base.toml import TomlFile, parse_toml
from kolsky.pictures.picture_set import CAMERAS, Progress, digests, open_source
from kolsky.pictures.rig import Calibrated, cropped, refine_rig, rig_of
from kolsky.schema.pictures import MeasuredSeries, MeasurementFile


@dataclass(frozen=True)
class Measurement:
    """A dic.toml and its opened pictures, before correlation."""

    toml: TomlFile
    """The file."""
    declared: MeasurementFile
    """Content of the file, in SI."""
    series: tuple[Pictures, ...]
    """One series per camera."""
    inputs: dict[str, str]
    """SHA-256 of every file that was read, by name or pattern."""

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.toml.path.parent.resolve().name


def read_measurement(path: Path) -> Measurement:
    """Read a dic.toml and open its pictures.

    ``path``: the file. Raises InputError if it declares anything unknown, incomplete or impossible, or if a
    series cannot be opened.
    """
    toml = parse_toml(path)
    dic = toml.content.get("dic")
    if isinstance(dic, dict) and dic.get("kind") == "flyer test":
        raise toml.error(
            "dic.kind", "is measured with a shot around it", cure="declare it in a shot.toml: `kolsky new`"
        )
    declared = toml.validated(MeasurementFile)
    opened = [
        (name, section, _open(toml, name, section, declared.pictures.bits))
        for name, section in zip(
            CAMERAS, (declared.pictures.camera_0, declared.pictures.camera_1), strict=True
        )
        if section is not None
    ]
    refuse([found for _, _, found in opened if isinstance(found, InputError)])
    series = tuple(found for _, _, found in opened if not isinstance(found, InputError))
    if len({own.n_frames for own in series}) > 1:
        counts = " and ".join(str(own.n_frames) for own in series)
        raise toml.error("pictures", f"has {counts} pictures", cure="export both series frame by frame")
    sources: list[tuple[str, Any]] = [section.source for _, section, _ in opened]
    files = (declared.calibration and declared.calibration.file, declared.dic.mask)
    sources += [("file", file) for file in files if file is not None]
    inputs = {toml.path.name: toml.sha256, **digests(path.parent, sources)}
    return Measurement(toml, declared, series, inputs)


def _open(toml: TomlFile, name: str, section: MeasuredSeries, bits: int | None) -> Pictures | InputError:
    """The series of a camera, or the reason why there is none."""
    from dic.images import declared

    kind, source = section.source
    try:
        own = open_source(toml.path.parent, kind, source)
        offset = section.crop_offset
        if "crop_offset" not in section.model_fields_set and own.crop_offset != (0.0, 0.0):
            offset = own.crop_offset  # as stated in the file
        return declared(own, bits=bits, crop_offset=offset)
    except (PictureError, ValueError) as error:
        return toml.error(f"pictures.{name}.{kind}", f"cannot be used: {error}")


def measure_file(
    measurement: Measurement, *, device: str = "cpu", progress: Progress = lambda stage, done, total: None
) -> FullField:
    """Correlate the pictures of a measurement.

    ``device``: device of the correlation, "cpu" or a CUDA device. ``progress``: called with the number of
    frames done in each stage. Raises InputError if region, mask, calibration or settings do not match the
    pictures, or if nothing can be measured.
    """
    from dic.full_field.measure import measure_plane
    from dic.full_field.stereo import measure_cylinder, measure_surface

    toml, section = measurement.toml, measurement.declared.dic
    n = measurement.series[0].n_frames
    shared: dict[str, Any] = {
        "mask": mask_of(measurement),
        "t": None if section.interval is None else section.interval * np.arange(n),
        "extensometers": [
            Extensometer(name, (one.ends[0], one.ends[1]), one.window)
            for name, one in measurement.declared.extensometers.items()
        ],
        "progress": progress,
    }
    settings = _settings_of(measurement, device)
    with single_threaded_libraries(), infrequent_gc():
        if section.kind != "plane":
            found = _rig(measurement, progress)
        try:
            if section.kind == "plane":
                result = measure_plane(measurement.series[0], settings, scale=section.scale, **shared)
            else:
                pair = (measurement.series[0], measurement.series[1])
                calibration = measurement.declared.calibration
                assert calibration is not None  # the schema saw to it
                rig, refinement = refine_rig(
                    calibration,
                    found.rig,
                    pair,
                    settings.reference,
                    shared["mask"],
                    settings.stereo,
                    step=settings.step,
                    noise=settings.noise,
                    device=device,
                )
                shared["facts"] = {"calibration": found.words, "refinement": refinement}
                if section.kind == "surface":
                    result = measure_surface(pair, rig, settings, **shared)
                else:
                    result = measure_cylinder(pair, rig, settings, radius=section.radius, **shared)
        except (PictureError, ValueError) as error:
            raise toml.error("dic", f"does not fit the pictures: {error}") from error
    return replace(result, remarks=(*result.remarks, *of_colours(measurement.series)))


def _settings_of(measurement: Measurement, device: str = "cpu") -> FullFieldSettings:
    """The settings declared for a measurement."""
    section = measurement.declared.dic
    subset = Correlation(
        subset=section.subset, shape=Shape[section.shape.upper()], prefilter=section.prefilter
    )
    return FullFieldSettings(
        step=section.step,
        tracking=Tracking(correlation=subset),
        stereo_shape=Shape[(section.stereo_shape or "quadratic").upper()],
        strain_window=section.strain_window,
        strain_order=section.strain_order,
        reference=section.reference,
        static=section.static,
        noise=section.noise,
        device=device,
    )


def mask_of(measurement: Measurement) -> NDArray[np.bool_]:
    """Pixels in the region, white in the mask, and not excluded, shape [rows, columns]."""
    toml, section = measurement.toml, measurement.declared.dic
    shape = measurement.series[0].shape
    mask = np.ones(shape, dtype=bool)
    with toml.refusing("dic.region", "does not fit the pictures"):
        if section.region is not None:
            mask &= polygon_mask(section.region.corners, shape)
        for gone in section.exclude:
            mask &= ~polygon_mask(gone.corners, shape)
    if section.mask is not None:
        from dic.basics import cv2

        path = toml.path.parent / section.mask
        try:
            picture = cv2.imread(str(regular(path)), cv2.IMREAD_GRAYSCALE)
        except OSError as error:
            raise InputError(
                path, f"cannot be read ({error.strerror})", cure="export the mask as PNG"
            ) from None
        if picture is None:
            raise InputError(path, "is not a picture that can be read", cure="export the mask as PNG")
        if picture.shape != shape:
            raise InputError(
                path,
                f"is {picture.shape[1]} x {picture.shape[0]} px, the pictures are {shape[1]} x {shape[0]} px",
                cure="export it with the size of the pictures",
            )
        mask &= picture > 127
    if not mask.any():
        raise toml.error(
            "dic",
            "leaves no pixel to measure",
            cure=f"look at region, exclude and mask; `kolsky dic {toml.path.parent} --regions` draws them",
        )
    return mask


def _rig(measurement: Measurement, progress: Progress) -> Calibrated:
    """The cameras for the cropped pictures."""
    toml, declared = measurement.toml, measurement.declared
    assert declared.calibration is not None  # the schema saw to it
    found = rig_of(toml, declared.calibration, progress)
    for camera, own, name in zip(found.rig.cameras, measurement.series, CAMERAS, strict=True):
        stated = "crop_offset" in getattr(declared.pictures, name).model_fields_set
        if camera.sensor is None or stated or own.crop_offset != (0.0, 0.0):
            continue
        if own.shape != camera.sensor[::-1]:
            raise toml.error(
                f"pictures.{name}.crop_offset",
                f"is missing: the pictures are {own.shape[1]} x {own.shape[0]} px of a sensor of "
                f"{camera.sensor[0]} x {camera.sensor[1]} px",
                cure="declare where the crop lies on the sensor",
            )
    return cropped(toml, found, measurement.series)

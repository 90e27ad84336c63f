"""The tables about pictures: [pictures], [calibration], [dic], [reporting]; also dic.toml without a shot."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.schema import fields as f
from kolsky.schema.fields import Section


class SeriesSection(Section):
    """The pictures of one camera."""

    file: f.FileName | None = None
    pattern: f.FilePattern | None = None
    crop_offset: f.Pixel

    @model_validator(mode="after")
    def _one_source(self) -> "SeriesSection":
        self.exactly_one(
            ("file", "pattern"),
            'give either file = "cam0.tif" or, for numbered pictures, pattern = "cam0/*.png"',
        )
        return self

    @property
    def source(self) -> tuple[str, Any]:
        """Key and value of the path of the pictures."""
        key = next(key for key in ("file", "pattern", "files") if getattr(self, key, None) is not None)
        return key, getattr(self, key)


class PicturesSection(Section):
    """[pictures]: two series; picture k of each was taken at the frame in row k of [frames]."""

    camera_0: SeriesSection
    camera_1: SeriesSection
    bits: Annotated[int, Field(ge=1, le=16)] | None = None

    @property
    def cameras(self) -> tuple[SeriesSection, SeriesSection]:
        """Both series."""
        return self.camera_0, self.camera_1


class TargetSection(Section):
    """[calibration.target]: the calibration target; its required keys depend on its kind."""

    kind: f.TargetName
    columns: Annotated[int, Field(ge=2, le=1000)]
    rows: Annotated[int, Field(ge=2, le=1000)]
    pitch: f.Length | None = None
    step: f.Length | None = None
    diameter: f.Length | None = None
    hole: f.Length | None = None
    hollow: f.Places | None = None
    radius: f.Length | None = None
    arc: f.Length | None = None
    size: f.Length | None = None
    square: bool | None = None
    anchors_0: f.Anchors | None = None
    anchors_1: f.Anchors | None = None
    marker: f.Length | None = None
    dictionary: f.Name | None = None
    legacy: bool | None = None
    dark: bool | None = None


class CalibrationSection(Section):
    """[calibration]: a calibration file, or pictures of a target."""

    file: f.FileName | None = None
    length_unit: f.LengthUnit = 1e-3
    camera_0: f.FilePattern | None = None
    camera_1: f.FilePattern | None = None
    target: TargetSection | None = None
    distortion: (
        Literal["none", "k1", "k1 k2", "k1 k2 k3", "k1 p1 p2", "k1 k2 p1 p2", "k1 k2 p1 p2 k3"] | None
    ) = None
    square_pixels: bool = False
    refine: bool | Literal["auto"] = False

    @model_validator(mode="after")
    def _one_source(self) -> "CalibrationSection":
        pictures = {
            key: getattr(self, key) for key in ("camera_0", "camera_1", "target", "distortion")
        }  # all or none of them
        given = [key for key, value in pictures.items() if value is not None]
        if self.file is not None and given:
            raise f.problem(
                "is given in addition to file, so it would have no effect",
                key=given[0],
                cure="remove it, or remove file to calibrate from the pictures",
            )
        if self.file is None and len(given) < len(pictures):
            first = next(key for key in pictures if key not in given)
            raise f.problem(
                "is missing",
                key=first if given else "file",
                cure='give file = "rig.xml", or camera_0, camera_1, target and distortion',
            )
        return self


class RegionSection(Section):
    """Region of a body in a picture of camera 0 [px]: a rectangle, or a polygon."""

    x: f.PixelRange | None = None
    y: f.PixelRange | None = None
    polygon: f.Polygon | None = None
    frame: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _one_shape(self) -> "RegionSection":
        rectangle = self.x is not None and self.y is not None
        if rectangle == (self.polygon is not None) or (self.x is None) != (self.y is None):
            raise f.problem(
                "is not a region",
                cure="give either x = [first, last] and y = [first, last], or polygon = [[x, y], ...], "
                "in pixels",
            )
        return self

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """Corners (x, y) [px]."""
        if self.x is not None and self.y is not None:
            (x0, x1), (y0, y1) = self.x, self.y
            return (x0, y0), (x1, y0), (x1, y1), (x0, y1)
        assert self.polygon is not None  # checked by the validator
        return self.polygon


def _flyer_test(value: object) -> object:
    """The kind of calibration in a shot; other kinds need a separate file."""
    if value != "flyer test":
        raise f.problem(
            "is not allowed",
            allowed='"flyer test" in a shot.toml',
            cure="write plane, surface and cylinder into a separate dic.toml",
        )
    return value


def _outline(value: object) -> object:
    """None for "outline": the region is found in the pictures."""
    return None if value == "outline" else value


class DicSection(Section):
    """[dic]: regions and settings of the correlation. Regions not given are found in the pictures."""

    kind: Annotated[str, BeforeValidator(_flyer_test)] = "flyer test"
    specimen: Annotated[RegionSection | None, BeforeValidator(_outline)] = None
    flyer: Annotated[RegionSection | None, BeforeValidator(_outline)] = None
    flyer_side: Literal["up", "down", "left", "right"]
    transmission_edge: Annotated[f.Pixel | None, BeforeValidator(_outline)] = None
    strip_half_width: f.Length
    largest_sigma: f.Length | None = None
    subset: f.Subset = 21
    step: Annotated[int, Field(ge=1, le=100)] = 4
    shape: Literal["rigid", "affine", "quadratic"] = "affine"
    prefilter: f.Prefilter = 0.0
    strain_window: f.StrainWindow = 5


class ReportingSection(Section):
    """[reporting]: data for the reporting table of a publication that no file contains."""

    camera: f.Name | None = None
    lens: f.Name | None = None
    aperture: f.Name | None = None
    exposure: f.Name | None = None
    lighting: f.Name | None = None
    pattern: f.Name | None = None


class PlainRegion(RegionSection):
    """A region of the reference picture, without a frame number."""

    @model_validator(mode="after")
    def _in_the_reference(self) -> "PlainRegion":
        if "frame" in self.model_fields_set:
            raise f.problem(
                "has no effect here", key="frame", cure="remove it: regions are those of dic.reference"
            )
        return self


class MeasurementSection(Section):
    """[dic]: the measured quantity and the settings."""

    kind: Literal["plane", "surface", "cylinder"]
    region: PlainRegion | None = None
    exclude: list[PlainRegion] = Field(default_factory=list)
    mask: f.FileName | None = None
    reference: Annotated[int, Field(ge=0)] = 0
    static: Annotated[int, Field(ge=1)] = 1
    noise: Annotated[float, Field(gt=0.0)] | None = None
    subset: f.Subset = 21
    step: Annotated[int, Field(ge=1, le=100)] = 5
    shape: Literal["rigid", "affine", "quadratic"] = "affine"
    stereo_shape: Literal["affine", "quadratic"] | None = None
    prefilter: f.Prefilter = 0.0
    strain_window: f.StrainWindow = 5
    strain_order: Annotated[int, Field(ge=1, le=2)] = 1
    scale: f.Length | None = None
    radius: f.Length | None = None
    interval: f.PositiveTime | None = None

    @model_validator(mode="after")
    def _keys_of_the_kind(self) -> "MeasurementSection":
        only = {"scale": ("plane",), "radius": ("cylinder",), "stereo_shape": ("surface", "cylinder")}
        for key, kinds in only.items():
            if getattr(self, key) is not None and self.kind not in kinds:
                raise f.problem(
                    f'has no effect on the kind "{self.kind}"',
                    key=key,
                    cure=f"remove it: it belongs to {f.alternatives(kinds)}",
                )
        return self


class MeasuredSeries(SeriesSection):
    """The pictures of one camera. Without `crop_offset` they show the whole sensor."""

    files: Annotated[list[f.FileName], Field(min_length=1)] | None = None
    crop_offset: f.Pixel = (0.0, 0.0)

    @model_validator(mode="after")
    def _one_source(self) -> "MeasuredSeries":
        self.exactly_one(
            ("file", "pattern", "files"),
            'give one of file = "cam0.tif", pattern = "cam0/*.png" for numbered pictures, or '
            'files = ["a.png", "b.png"] in their order',
        )
        return self


class MeasurementPictures(Section):
    """[pictures]: the series of one camera, or of two."""

    camera_0: MeasuredSeries
    camera_1: MeasuredSeries | None = None
    bits: Annotated[int, Field(ge=1, le=16)] | None = None


class ExtensometerSection(Section):
    """[extensometers.NAME]: a virtual extensometer between two places of the reference picture."""

    ends: Annotated[list[f.Pixel], Field(min_length=2, max_length=2)]
    window: f.StrainWindow = 3


class MeasurementFile(Section):
    """A whole dic.toml."""

    dic: MeasurementSection
    pictures: MeasurementPictures
    calibration: CalibrationSection | None = None
    extensometers: dict[str, ExtensometerSection] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _cameras_of_the_kind(self) -> "MeasurementFile":
        one = self.dic.kind == "plane"
        if one and self.pictures.camera_1 is not None:
            raise f.problem(
                "is given, but a plane is measured by one camera",
                key="pictures",
                cure='remove camera_1, or write kind = "surface"',
            )
        if not one and self.pictures.camera_1 is None:
            raise f.problem(
                "has no camera_1", key="pictures", cure='add it, or write kind = "plane" for one camera'
            )
        if one and self.calibration is not None:
            raise f.problem(
                "has no effect on a plane", key="calibration", cure="remove it; dic.scale gives lengths"
            )
        if not one and self.calibration is None:
            raise f.problem("is missing", key="calibration", cure='add it, e.g. file = "rig.xml"')
        return self


MEASUREMENT_FILE = "dic.toml"


def find_measurement_file(source: Path) -> Path | None:
    """The dic.toml at this path; None for anything else, and for a folder that also has a shot.toml."""
    path = Path(source)
    if path.is_dir():
        here = path / MEASUREMENT_FILE
        return here if here.is_file() and not (path / "shot.toml").exists() else None
    return path if path.is_file() and path.name != "shot.toml" and path.suffix == ".toml" else None

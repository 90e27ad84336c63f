"""The tables of a specification about pictures: [cameras], [optics], [speckle] and [calibration]."""

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section
from kolsky.virtual import fields as v

SMALLEST, LARGEST = 64, 1024
"""Sides of a picture [px]."""


def _side_lengths(values: object) -> tuple[int, int]:
    """Columns and rows."""
    if not isinstance(values, list | tuple) or len(values) != 2:
        raise f.problem("is not a size", cure="write columns and rows, e.g. [128, 128]")
    columns, rows = (int(f.number(value)) for value in values)
    if not (SMALLEST <= columns <= 4096 and SMALLEST <= rows <= 4096):
        raise f.problem("is not allowed", allowed=f"[columns, rows], each from {SMALLEST} to 4096")
    return columns, rows


Size = Annotated[tuple[int, int], BeforeValidator(_side_lengths)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Pixels = Annotated[float, Field(ge=0.0, le=100.0)]


def _part(low: float, high: float, words: str) -> BeforeValidator:
    """A validator of a written-out ratio within bounds."""

    def validate(text: object) -> float:
        value = f.physical("1", what=words)(text)
        if not low <= value <= high:
            raise f.problem("is not allowed", allowed=f'from "{low:.0%}" to "{high:.0%}"')
        return value

    return BeforeValidator(validate)


class CamerasTable(Section):
    """[cameras]: two cameras, their sensors, the crop and the view."""

    write: bool = False
    """Whether pictures are made."""
    sensor: Size = (512, 512)
    """Columns and rows of the whole sensor, which the calibration pictures show [px]."""
    picture: Size = (128, 128)
    """Columns and rows of the pictures of the test, a crop of it [px]."""
    field: f.Length = 7.2e-3
    """Length along the axis that a picture shows at the distance of the axis [m]."""
    distance_0: f.Length = 0.305
    distance_1: f.Length = 0.305
    """Of the cameras from the point they look at [m]."""
    angle: v.Angle = math.radians(12.5)
    """Between their views [rad]."""
    baseline: Literal["across", "along"] = "across"
    """How the cameras stand to each other: on both sides of the axis, or one behind the other along it."""
    elevation: v.Angle = 0.0
    """Of both cameras above the plane across the axis, toward the flyer [rad]."""
    flyer_side: Literal["up", "down", "left", "right"] = "up"
    """Where in the pictures the flyer comes from."""
    flyer_share: Annotated[float, _part(-0.4, 0.6, "a share of the picture")] = 0.03
    """Share of a picture's length that the flyer takes at rest; below 0 it is so far out of view [-]."""
    aside: f.Offset = 0.0
    """Place across the axis that they look at [m]."""
    misalignment: v.Angle = 3e-3
    """Standard deviation of the roll and of the aim's error, each camera its own [rad]."""
    distortion_0: v.Numbers = (-0.17, 0.0, 0.0, 0.0, 0.0)
    distortion_1: v.Numbers = (-0.16, 0.0, 0.0, 0.0, 0.0)
    """Brown's k1, k2, p1, p2, k3 [-]."""
    format: Literal["tiff", "png", "cine", "mraw"] = "tiff"
    """16-bit TIFF stack, series of 8-bit PNG files, Phantom cine or Photron mraw."""

    @model_validator(mode="after")
    def _fits(self) -> "CamerasTable":
        if max(self.picture) > LARGEST:
            raise f.problem("is not allowed", key="picture", allowed=f"sides from {SMALLEST} to {LARGEST}")
        if self.sensor[0] < self.picture[0] or self.sensor[1] < self.picture[1]:
            raise f.problem("is smaller than the picture", key="sensor", cure="enlarge it")
        for key in ("distortion_0", "distortion_1"):
            if len(getattr(self, key)) != 5:
                raise f.problem("is not a lens", key=key, cure="write k1, k2, p1, p2, k3")
        if not 0.02 <= self.angle <= 1.2:
            raise f.problem("is not allowed", key="angle", allowed='from "1.2 deg" to "68 deg"')
        if abs(self.elevation) > 0.5:
            raise f.problem("is not allowed", key="elevation", allowed='from "-28 deg" to "28 deg"')
        if min(self.distance_0, self.distance_1) < 0.05:
            raise f.problem("is not allowed", key="distance_0", allowed='at least "50 mm"')
        return self

    @property
    def along(self) -> int:
        """Pixels of a picture along the axis."""
        return self.picture[1] if self.flyer_side in ("up", "down") else self.picture[0]

    @property
    def pixel(self) -> float:
        """Length that a pixel shows at the distance of the axis [m]."""
        return self.field / self.along


class OpticsTable(Section):
    """[optics]: light, lens, air and sensor."""

    exposure: f.PositiveTime = 2e-6
    """How long the shutter is open [s]."""
    spread: Annotated[float, Field(ge=0.0, le=5.0)] = 0.6
    """Standard deviation of the point spread in focus [px]."""
    aperture: v.Width = 0.0
    """Diameter of the entrance pupil; 0: sharp at every distance [m]."""
    defocus: f.Offset = 0.0
    """How far the plane of focus lies behind the axis [m]."""
    white: Share = 0.7
    """Grey value of white paint over the largest one [-]."""
    black: Share = 0.02
    """Grey value without light over the largest one [-]."""
    bits: Annotated[int, Field(ge=8, le=16)] = 12
    full_well: Annotated[float, Field(gt=0.0, le=1e7)] = 15_000.0
    """Electrons of the largest grey value."""
    read_noise: Annotated[float, Field(ge=0.0, le=1e5)] = 30.0
    """Standard deviation without light [electrons]."""
    flicker: Annotated[float, _part(0.0, 0.5, "a standard deviation")] = 0.005
    """Standard deviation of the lamp's brightness from frame to frame [-]."""
    fixed_pattern: Annotated[float, _part(0.0, 0.5, "a standard deviation")] = 0.003
    """Standard deviation of the pixels' gains [-]."""
    lamp_gradient: Annotated[float, _part(-0.9, 0.9, "a relative difference")] = 0.06
    """Brightness at the right edge of the picture over that at its left, less 1 [-]."""
    ambient: Share = 0.7
    """Share of the light that comes from all sides; the rest shades the surface [-]."""
    highlight: Share = 0.0
    """Height of the specular highlight over white paint [-]."""
    gloss: Annotated[float, Field(ge=1.0, le=1e4)] = 80.0
    """Exponent of the highlight: the larger, the smaller [-]."""
    lamp_height: v.Angle = math.radians(11.0)
    """Of the lamp above the plane across the axis, toward the flyer [rad]."""
    lamp_side: v.Angle = math.radians(6.0)
    """Of the lamp out of the plane between the cameras [rad]."""
    haze: Pixels = 0.0
    """Standard deviation of the displacement of the picture by warm air [px]."""
    haze_length: Annotated[float, Field(ge=2.0, le=1000.0)] = 25.0
    """Distance over which it is smooth [px]."""
    haze_memory: f.PositiveTime = 100e-6
    """Time after which 1/e of it is left [s]."""
    rays: Annotated[int, Field(ge=2, le=16)] = 4
    """Rays of a pixel along each axis."""

    @model_validator(mode="after")
    def _bright_enough(self) -> "OpticsTable":
        if not self.black < self.white:
            raise f.problem("is not allowed", key="white", allowed=f"above black = {self.black}")
        return self


class SpeckleTable(Section):
    """[speckle]: paint on specimen, flyer and transmission platen."""

    kind: Literal["sprayed", "printed"] = "sprayed"
    """Drops of random places and sizes, or even dots close to a lattice."""
    size: Annotated[float, Field(ge=0.5, le=60.0)] = 6.0
    """Mean diameter of a drop [px]; below 3 too fine, above 10 too coarse for most subsets."""
    size_spread: Annotated[float, Field(ge=0.0, le=1.0)] = 0.25
    """Standard deviation of a drop's diameter over its mean; sprayed only [-]."""
    coverage: Annotated[float, Field(gt=0.0, lt=0.95)] = 0.5
    """Share of the surface that is dark; below 0.2 sparse [-]."""
    jitter: Annotated[float, Field(ge=0.0, le=0.5)] = 0.2
    """How far a printed dot may lie from its place of the lattice, over the lattice's step [-]."""
    dark: Share = 0.16
    bright: Share = 0.97
    """Reflectance of drops and ground [-]."""
    softness: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3
    """Width of a drop's rim over its diameter [-]."""
    flyer: bool = True
    platen: bool = False
    """Whether flyer and transmission platen are painted."""
    bare: Share = 0.3
    """Reflectance of what is not painted [-]."""
    scratch: v.Width = 0.0
    """Width of a scratch down to the bare specimen; 0: none [m]."""
    flake: v.Width = 0.0
    """Radius of a patch whose paint has flaked off; 0: none [m]."""
    loose: v.Width = 0.0
    """Radius of a patch whose paint has come loose; 0: none [m]."""
    loose_slip: f.Offset = 0.0
    """How far its middle has slid against the axis by the last frame [m]."""


class CalibrationTable(Section):
    """[calibration]: a series of a target in many poses, seen by the whole sensors."""

    target: Literal["fiducial_dots", "chessboard", "charuco"] = "fiducial_dots"
    columns: Annotated[int, Field(ge=5, le=60)] = 14
    rows: Annotated[int, Field(ge=5, le=60)] = 10
    """Dots, inner corners or squares (charuco)."""
    share: Annotated[float, Field(ge=0.2, le=0.9)] = 0.58
    """Width of the target over that of the sensor's field [-]."""
    poses: Annotated[int, Field(ge=4, le=200)] = 20
    tilt: v.Angle = math.radians(20.0)
    """Largest tilt out of the plane of the view [rad]."""
    bits: Annotated[int, Field(ge=8, le=16)] = 8
    noise: Annotated[float, _part(0.0, 0.2, "a standard deviation")] = 0.004
    """Standard deviation of a grey value over the largest one [-]."""

    @model_validator(mode="after")
    def _one_way_up(self) -> "CalibrationTable":
        if self.target == "fiducial_dots" and self.columns == self.rows:
            raise f.problem("is as large as rows", key="columns", cure="make one of them larger")
        if not 0.05 <= self.tilt <= 0.8:
            raise f.problem("is not allowed", key="tilt", allowed='from "3 deg" to "45 deg"')
        return self

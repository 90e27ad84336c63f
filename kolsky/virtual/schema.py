"""The tables of a specification: true quantities, cameras, and [imperfections] of the test.

If all imperfections are zero, the declarations have no errors.
"""

import math
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.base.apparatus import HOLDING_LAW
from kolsky.schema import fields as f
from kolsky.schema.apparatus import TransmissionSection, UncertaintySection
from kolsky.schema.fields import Section
from kolsky.schema.material import RelaxationSection

if TYPE_CHECKING:
    from explicit.relaxation.base import RateDependence


Angle = Annotated[float, BeforeValidator(f.physical("rad"))]
"""An angle of any sign [rad]."""
Drift = Annotated[float, BeforeValidator(f.physical("V/s"))]
"""Volts per time of any sign [V/s]."""
Frequency = Annotated[float, BeforeValidator(f.physical("1/s", "> 0", "a frequency"))]
"""A frequency or a rate of repetition [1/s]."""
Relative = Annotated[float, BeforeValidator(f.physical("1"))]
"""A relative difference of any sign [-]."""
Noise = Annotated[float, BeforeValidator(f.physical("V", ">= 0", "a standard deviation"))]
"""Standard deviation of a voltage [V]."""
Width = Annotated[float, BeforeValidator(f.physical("m", ">= 0", "a length"))]
"""A length that may be zero, for a feature that is absent [m]."""


def _numbers(values: object) -> tuple[float, ...]:
    """A list of numbers."""
    if not isinstance(values, list | tuple) or len(values) > 100:
        raise f.problem("is not a list of numbers", cure="write e.g. [0.1, 0.2]")
    return tuple(map(f.number, values))


def _pair(words: str, cure: str, names: str, least: int, most: int) -> BeforeValidator:
    """A validator of two whole numbers within bounds."""

    def validate(values: object) -> tuple[int, int]:
        if not isinstance(values, list | tuple) or len(values) != 2:
            raise f.problem(f"is not a {words}", cure=cure)
        first, second = (int(f.number(value)) for value in values)
        if not (least <= first <= most and least <= second <= most):
            raise f.problem("is not allowed", allowed=f"[{names}], each from {least} to {most}")
        return first, second

    return BeforeValidator(validate)


SMALLEST, LARGEST = 64, 1024
"""Sides of a picture [px]."""
Numbers = Annotated[tuple[float, ...], BeforeValidator(_numbers)]
Mesh = Annotated[
    tuple[int, int],
    _pair("mesh", "write elements across and along, e.g. [96, 129]", "across, along", 4, 1000),
]
Size = Annotated[
    tuple[int, int], _pair("size", "write columns and rows, e.g. [128, 128]", "columns, rows", SMALLEST, 4096)
]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Pixels = Annotated[float, Field(ge=0.0, le=100.0)]


def _within(low: float, high: float, unit: str = "1", allowed: str = "") -> BeforeValidator:
    """A validator of a written-out quantity within bounds, of a ratio if no unit is given."""

    def validate(text: object) -> float:
        value = f.physical(unit)(text)
        if not low <= value <= high:
            raise f.problem("is not allowed", allowed=allowed or f'from "{low:.0%}" to "{high:.0%}"')
        return value

    return BeforeValidator(validate)


Distance = Annotated[float, _within(0.05, math.inf, "m", 'at least "50 mm"')]


class CamerasTable(Section):
    """[cameras]: two cameras, their sensors, the crop and the view."""

    write: bool = False
    sensor: Size = (512, 512)
    """Columns and rows of the whole sensor, which the calibration pictures show [px]."""
    picture: Size = (128, 128)
    """Columns and rows of the pictures of the test [px]. They are a crop of the sensor."""
    field: f.Length = 7.2e-3
    """Length along the axis that a picture shows at the distance of the axis [m]."""
    distance_0: Distance = 0.305
    distance_1: Distance = 0.305
    """Distances of the cameras from the point at which they look [m]."""
    angle: Annotated[float, _within(0.02, 1.2, "rad", 'from "1.2 deg" to "68 deg"')] = math.radians(12.5)
    """Angle between their viewing directions [rad]."""
    baseline: Literal["across", "along"] = "across"
    """Arrangement of the cameras: on both sides of the axis, or one after the other along it."""
    elevation: Annotated[float, _within(-0.5, 0.5, "rad", 'from "-28 deg" to "28 deg"')] = 0.0
    """Elevation of both cameras above the plane across the axis, toward the flyer [rad]."""
    flyer_side: Literal["up", "down", "left", "right"] = "up"
    """Side of the pictures on which the flyer enters."""
    flyer_share: Annotated[float, _within(-0.4, 0.6)] = 0.03
    """Share of a picture's length covered by the flyer at rest [-]. A negative value is a distance out of
    view."""
    aside: f.Offset = 0.0
    """Lateral position at which the cameras look, across the axis [m]."""
    misalignment: Angle = 3e-3
    """Standard deviation of roll and aiming error, independent for each camera [rad]."""
    distortion_0: Numbers = (-0.17, 0.0, 0.0, 0.0, 0.0)
    distortion_1: Numbers = (-0.16, 0.0, 0.0, 0.0, 0.0)
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
        return self

    @property
    def along(self) -> int:
        """Pixels of a picture along the axis."""
        return self.picture[1] if self.flyer_side in ("up", "down") else self.picture[0]

    @property
    def pixel(self) -> float:
        """Length of a pixel at the distance of the axis [m]."""
        return self.field / self.along


class OpticsTable(Section):
    """[optics]: light, lens, air and sensor."""

    exposure: f.PositiveTime = 2e-6
    """Exposure time [s]."""
    spread: Annotated[float, Field(ge=0.0, le=5.0)] = 0.6
    """Standard deviation of the point spread in focus [px]."""
    aperture: Width = 0.0
    """Diameter of the entrance pupil [m]; 0: sharp at every distance."""
    defocus: f.Offset = 0.0
    """Distance of the plane of focus behind the axis [m]."""
    white: Share = 0.7
    """Grey value of white paint divided by the largest one [-]."""
    black: Share = 0.02
    """Grey value without light divided by the largest one [-]."""
    bits: Annotated[int, Field(ge=8, le=16)] = 12
    full_well: Annotated[float, Field(gt=0.0, le=1e7)] = 15_000.0
    """Electrons of the largest grey value."""
    read_noise: Annotated[float, Field(ge=0.0, le=1e5)] = 30.0
    """Standard deviation without light [electrons]."""
    flicker: Annotated[float, _within(0.0, 0.5)] = 0.005
    """Standard deviation of the lamp's brightness between frames [-]."""
    fixed_pattern: Annotated[float, _within(0.0, 0.5)] = 0.003
    """Standard deviation of the pixels' gains [-]."""
    lamp_gradient: Annotated[float, _within(-0.9, 0.9)] = 0.06
    """Brightness at the right edge of the picture divided by that at its left edge, minus 1 [-]."""
    ambient: Share = 0.7
    """Share of the light that comes from all sides [-]. The rest shades the surface."""
    highlight: Share = 0.0
    """Height of the specular highlight divided by white paint [-]."""
    gloss: Annotated[float, Field(ge=1.0, le=1e4)] = 80.0
    """Exponent of the highlight [-]. A larger exponent gives a smaller highlight."""
    lamp_height: Angle = math.radians(11.0)
    """Elevation of the lamp above the plane across the axis, toward the flyer [rad]."""
    lamp_side: Angle = math.radians(6.0)
    """Angle of the lamp out of the plane between the cameras [rad]."""
    haze: Pixels = 0.0
    """Standard deviation of the displacement of the picture by warm air [px]."""
    haze_length: Annotated[float, Field(ge=2.0, le=1000.0)] = 25.0
    """Correlation length of the haze displacement [px]."""
    haze_memory: f.PositiveTime = 100e-6
    """Time in which its correlation decays to 1/e [s]."""
    rays: Annotated[int, Field(ge=2, le=16)] = 4

    @model_validator(mode="after")
    def _bright_enough(self) -> "OpticsTable":
        if not self.black < self.white:
            raise f.problem("is not allowed", key="white", allowed=f"above black = {self.black}")
        return self


class SpeckleTable(Section):
    """[speckle]: paint on specimen, flyer and transmission platen."""

    kind: Literal["sprayed", "printed"] = "sprayed"
    """Drops at random positions with random sizes, or equal dots close to a lattice."""
    size: Annotated[float, Field(ge=0.5, le=60.0)] = 6.0
    """Mean diameter of a drop [px]. Below 3 it is too fine, above 10 too coarse for most subsets."""
    size_spread: Annotated[float, Field(ge=0.0, le=1.0)] = 0.25
    """Standard deviation of a drop's diameter divided by its mean [-]; sprayed only."""
    coverage: Annotated[float, Field(gt=0.0, lt=0.95)] = 0.5
    """Share of the surface that is dark [-]; below 0.2 the pattern is sparse."""
    jitter: Annotated[float, Field(ge=0.0, le=0.5)] = 0.2
    """Largest distance of a printed dot from its lattice point, divided by the lattice step [-]."""
    dark: Share = 0.16
    bright: Share = 0.97
    """Reflectance of drops and ground [-]."""
    softness: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3
    """Width of a drop's rim divided by its diameter [-]."""
    flyer: bool = True
    platen: bool = False
    bare: Share = 0.3
    """Reflectance of unpainted surfaces [-]."""
    scratch: Width = 0.0
    """Width of a scratch down to the bare specimen [m]; 0: none."""
    flake: Width = 0.0
    """Radius of a patch with flaked paint [m]; 0: none."""
    loose: Width = 0.0
    """Radius of a patch with loose paint [m]; 0: none."""
    loose_slip: f.Offset = 0.0
    """Axial slip of the patch's middle at the last frame [m]."""


class CalibrationTable(Section):
    """[calibration]: a series of pictures of a target in many poses, on the whole sensors."""

    target: Literal["fiducial_dots", "chessboard", "charuco"] = "fiducial_dots"
    columns: Annotated[int, Field(ge=5, le=60)] = 14
    rows: Annotated[int, Field(ge=5, le=60)] = 10
    """Numbers of dots, inner corners or squares (charuco)."""
    share: Annotated[float, Field(ge=0.2, le=0.9)] = 0.58
    """Width of the target divided by that of the sensor's field [-]."""
    poses: Annotated[int, Field(ge=4, le=200)] = 20
    tilt: Annotated[float, _within(0.05, 0.8, "rad", 'from "3 deg" to "45 deg"')] = math.radians(20.0)
    """Largest tilt out of the plane of the view [rad]."""
    bits: Annotated[int, Field(ge=8, le=16)] = 8
    noise: Annotated[float, _within(0.0, 0.2)] = 0.004
    """Standard deviation of a grey value divided by the largest grey value [-]."""

    @model_validator(mode="after")
    def _one_way_up(self) -> "CalibrationTable":
        if self.target == "fiducial_dots" and self.columns == self.rows:
            raise f.problem("is as large as rows", key="columns", cure="make one of them larger")
        return self


class Imperfections(Section):
    """[imperfections]: errors of the synthetic test."""

    length: Relative = 0.0
    """Declared length divided by the true one, minus 1 [-]."""
    diameter: Relative = 0.0
    """Declared diameter divided by the true one, minus 1 [-]."""
    density: Relative = 0.0
    """Declared density divided by the true one, minus 1 [-]."""
    sensitivity: Relative = 0.0
    """Declared sensitivity of the transmitted force divided by the nominal one, minus 1 [-]."""
    curve: Relative = 0.0
    """Stresses in the quasi-static table divided by the true ones, minus 1 [-]."""
    poisson: f.Number = 0.0
    """Declared Poisson's ratio minus the true one [-]."""
    damping: f.Time = 0.0
    """Declared beta minus the true one [s]."""
    trigger: f.Time = 0.0
    """Delay of the cameras' times on the shot's clock: given frame times minus the true ones [s]."""
    y_offset: f.Offset = 0.0
    """Given heights of the outline minus the true ones [m]."""
    Z_offset: f.Offset = 0.0
    """Given radii of the outline minus the true ones [m]."""
    gain: Relative = 0.0
    """Voltage of the transmitted force divided by the value from its sensitivity, minus 1 [-]."""
    baseline: f.SignedVoltage = 0.0
    """Offset of the transmitted signal [V], beginning at the flyer's start."""
    slip_friction: f.Friction = 0.0
    """Coulomb coefficient of faces that the shot file declares as bonded; 0: they are bonded [-]."""
    tilt: Angle = 0.0
    """Final pitch of the flyer in the cameras' plane [rad]. It increases with the flyer's path, with the
    camera side ahead."""
    off_centre: f.Offset = 0.0
    """Distance of the specimen from the flyer's axis, toward the cameras [m]."""


class SpecimenTable(Section):
    """[specimen]: a right circular cylinder."""

    diameter: f.Length = 9.5e-3
    length: f.Length = 6.5e-3
    density: f.Density = 870.0


class MaterialTable(Section):
    """[material]: a hyperelastic law times m, damped, and the relaxation in parallel."""

    law: f.Name = "yeoh"
    """A name of `explicit.materials.laws.LAWS`."""
    parameters: dict[str, f.Number] = Field(
        default={"C10": 1.0, "C20": 0.1, "C30": 0.02}, validate_default=True
    )
    """The law's constants [-]. Moduli may have any common factor, because `shear_modulus` scales them."""
    shear_modulus: f.Modulus = 24.7e3
    """mu_0 of the quasi-static curve [Pa]."""
    stiffness_factor: f.Number = 1.0
    """m, dynamic over quasi-static stress [-]."""
    poisson: f.Poisson = 0.499
    damping: f.Damping = 25e-6
    """beta: deviatoric stress = 2 beta m mu_0 x deviatoric rate of deformation [s]."""
    mass_damping: f.Rate = 0.0

    @model_validator(mode="after")
    def _a_law(self) -> "MaterialTable":
        from kolsky.virtual.material import law_of

        try:
            law_of(self.law, self.parameters, self.shear_modulus)
        except ValueError as error:
            raise f.problem(f"does not fit: {error}", key="parameters", cure="give each a number") from None
        if not 0.0 < self.stiffness_factor <= 1e3:
            raise f.problem("is not allowed", key="stiffness_factor", allowed="above 0, at most 1000")
        return self


class QuasiStaticTable(Section):
    """[quasi_static]: the slow uniaxial test of the same material. It gives the curve."""

    largest_strain: Annotated[float, _within(0.01, 0.9)] = 0.64
    """Nominal compressive strain of the last point [-]."""
    points: Annotated[int, Field(ge=8, le=10_000)] = 65
    sigma: f.Share = 0.002
    """Standard deviation of a stress, relative to it [-]."""


class InterfaceTable(Section):
    """[interface]: contact of the specimen with the platens. The declared contact is the true one."""

    faces: f.ContactLawName = HOLDING_LAW
    side: f.ContactLawName = HOLDING_LAW
    friction: f.Friction = 0.3
    """Coulomb coefficient, if a law reads it [-]."""


class MotionTable(Section):
    """[motion]: the flyer's motion: a smooth ramp, or a sampled motion."""

    kind: Literal["ramp", "sampled"] = "ramp"
    speed: f.Velocity = 2.6
    """Final speed of the ramp [m/s]."""
    rise: f.PositiveTime = 60e-6
    """Time of the ramp from rest to `speed` [s]."""
    start: f.Time = 37.5e-6
    """Start time of the flyer on the shot's clock [s]."""
    compression: Annotated[float, _within(0.02, 0.75)] = 0.5
    """Nominal compression of the specimen at the end of the record [-]."""
    slowdown: Annotated[float, _within(0.0, 0.9)] = 0.0
    """Share of the speed lost between the end of the ramp and the end of the record [-]; ramp only."""
    file: f.FileName | None = None
    """Table of a sampled motion in the folder of the specification: time (s), displacement (m)."""
    flyer_mass: f.Mass = 0.026
    """Mass of the flying platen and transducer together [kg]."""
    flyer_diameter: f.Length = 15e-3
    flyer_length: f.Length = 20e-3
    duration: f.PositiveTime | None = None
    """Longest recorded time after the start [s], for motions that never reach `compression`."""

    @model_validator(mode="after")
    def _ranges(self) -> "MotionTable":
        if (self.kind == "sampled") != (self.file is not None):
            raise f.problem('is for kind = "sampled" only', key="file", cure="add it, or remove it")
        return self


class ScopeTable(Section):
    """[scope]: the recorder of both forces."""

    format: Literal["csv", "csv semicolon", "xlsx", "tdms"] = "csv"
    interval: f.PositiveTime = 0.5e-6
    start: f.Time = -200e-6
    """First sample on the shot's clock [s]."""
    full_scale: f.Voltage = 1.0
    bits: Annotated[int, Field(ge=4, le=24)] = 12
    jitter: f.TimeDeviation = 0.0
    """Standard deviation of a sample's time [s]."""
    clock_offset: f.Time = 0.0
    """Shot's clock = the recorder's + this; declared correctly [s]."""


class ChannelTable(Section):
    """[transmitted]: a force transducer, its amplifier and its cable."""

    sensitivity: f.Sensitivity = 0.0112
    compression: Literal["positive", "negative"] = "positive"
    platen_mass: f.Mass = 0.0071
    """Mass between the sensing plane and the specimen [kg]. The transducer also measures its inertia."""
    time_constant: f.PositiveTime | None = None
    """Time constant of the droop [s]; none: no droop."""
    bandwidth: Frequency | None = None
    """-3 dB frequency of a first-order low-pass [Hz]; none: unlimited."""
    delay: f.Time = 0.0
    """Delay of the signal [s]; not declared."""
    baseline: f.SignedVoltage = 0.003
    """Recorder signal at rest [V]."""
    drift: Drift = 0.0
    """Change of the baseline with time [V/s]."""
    noise: Noise = 0.0016
    """Standard deviation of a sample before quantisation [V]."""


class IncidentTable(ChannelTable):
    """[incident]: the flying transducer behind the flyer's platen."""

    sensitivity: f.Sensitivity = 0.00112


class FramesTable(Section):
    """[frames]: frame times of the cameras."""

    rate: Frequency = 120e3
    static: Annotated[int, Field(ge=3, le=1000)] = 12
    """Number of frames before the flyer starts."""
    phase: Relative = 0.0
    """Time from the last frame before the start until the start, in frames [-], from 0 to below 1."""
    clock_offset: f.Time = 0.0
    """Shot's clock = the cameras' + this; declared correctly [s]."""

    @model_validator(mode="after")
    def _phase_range(self) -> "FramesTable":
        if not 0.0 <= self.phase < 1.0:
            raise f.problem("is not allowed", key="phase", allowed="from 0 to below 1")
        return self


class ExportsTable(Section):
    """[exports]: outline and flyer displacement, as exported by a correlation program."""

    write: bool = True
    """True to write them. Without them the shot needs pictures."""
    flyer_sigma: f.Length = 1e-6
    outline_sigma: f.Length = 4e-6
    points: Annotated[int, Field(ge=4, le=1000)] = 14
    """Number of outline points in a frame."""
    lowest: Relative = 0.08
    """Height of the first point divided by the current height of the specimen [-]."""
    highest: Relative = 0.92

    @model_validator(mode="after")
    def _in_order(self) -> "ExportsTable":
        if not 0.0 < self.lowest < self.highest < 1.0:
            raise f.problem("is not allowed", key="highest", allowed="0 < lowest < highest < 1")
        return self


class TruthTable(Section):
    """[truth]: the solver run that the instruments measure. It is finer than any analysis."""

    mesh: Mesh = (96, 129)
    grading: f.Number = 2.0
    element: Literal["fbar", "one_point", "middle"] = "fbar"
    """An element of the solver, or the mean of both elements. The mean is closer to the limit of fine
    meshes."""


class Specification(Section):
    """A specification of one shot, in SI. Every table has defaults, which give a shot like `runs/open-01`."""

    format: Literal[1] = 1
    name: f.Name = "virtual"
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 1
    specimen: SpecimenTable = SpecimenTable()
    material: MaterialTable = MaterialTable()
    relaxation: RelaxationSection | None = None
    """True relaxation, with the same keys in the shot file. None: no relaxation."""
    quasi_static: QuasiStaticTable = QuasiStaticTable()
    interface: InterfaceTable = InterfaceTable()
    transmission: TransmissionSection = TransmissionSection(support="rigid")
    motion: MotionTable = MotionTable()
    scope: ScopeTable = ScopeTable()
    transmitted: ChannelTable = ChannelTable()
    incident: IncidentTable = IncidentTable()
    frames: FramesTable = FramesTable()
    exports: ExportsTable = ExportsTable()
    cameras: CamerasTable = CamerasTable()
    optics: OpticsTable = OpticsTable()
    speckle: SpeckleTable = SpeckleTable()
    calibration: CalibrationTable = CalibrationTable()
    imperfections: Imperfections = Imperfections()
    uncertainty: UncertaintySection | None = None
    """Copied to the shot file's [uncertainty]."""
    truth: TruthTable = TruthTable()

    @property
    def relaxing(self) -> "tuple[RateDependence, ...]":
        """Relaxation laws of the solver; empty without relaxation."""
        from kolsky.virtual.material import relaxing

        return relaxing(self.relaxation)

    @model_validator(mode="after")
    def _no_transducer_in_the_bar(self) -> "Specification":
        if self.transmission.transducer_depth is not None:
            raise f.problem(
                "is not available: the transducer of a virtual shot is behind a mass",
                key="transmission",
                cure="give [transmitted] platen_mass, the mass before it",
            )
        if self.transmission.support == "mesh":
            raise f.problem(
                'with support = "mesh" is not made here',
                key="transmission",
                cure='write support = "bar", a bar of the parts\' length',
            )
        return self

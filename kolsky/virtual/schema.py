"""The tables of a specification: the true quantities that the virtual laboratory makes a shot of."""

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from kolsky.base.apparatus import HOLDING_LAW
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.apparatus import TransmissionSection
from kolsky.shot.schema.relaxation import RelaxationSection
from kolsky.shot.schema.section import Section
from kolsky.shot.schema.uncertainty import UncertaintySection
from kolsky.virtual import fields as v
from kolsky.virtual.cameras import CalibrationTable, CamerasTable, OpticsTable, SpeckleTable
from kolsky.virtual.imperfections import Imperfections

if TYPE_CHECKING:
    from explicit.relaxation.base import RateDependence


class SpecimenTable(Section):
    """[specimen]: a right circular cylinder."""

    diameter: f.Length = 9.5e-3
    length: f.Length = 6.5e-3
    density: f.Density = 870.0


class MaterialTable(Section):
    """[material]: a hyperelastic law times m, damped, and what relaxes beside it."""

    law: f.Name = "yeoh"
    """A name of `explicit.materials.laws.LAWS`."""
    parameters: dict[str, f.Number] = Field(
        default={"C10": 1.0, "C20": 0.1, "C30": 0.02}, validate_default=True
    )
    """The law's constants; moduli as any multiple of each other, for `shear_modulus` scales them [-]."""
    shear_modulus: f.Modulus = 24.7e3
    """mu_0 of the quasi-static curve [Pa]."""
    stiffness_factor: f.Number = 1.0
    """m, dynamic over quasi-static stress [-]."""
    poisson: f.Poisson = 0.499
    damping: f.Damping = 25e-6
    """beta: deviatoric stress = 2 beta m mu_0 x deviatoric rate of deformation [s]."""
    mass_damping: f.Rate = 0.0
    prony_strengths: v.Numbers = ()
    """Modulus of each branch over that of the long-term law [-]; empty: nothing relaxes."""
    prony_times: v.Times = ()
    """Relaxation time of each branch [s]."""

    @model_validator(mode="after")
    def _a_law(self) -> "MaterialTable":
        from kolsky.virtual.material import law_of, relaxation_of

        try:
            law_of(self.law, self.parameters, self.shear_modulus)
        except ValueError as error:
            raise f.problem(f"does not fit: {error}", key="parameters", cure="give each a number") from None
        try:
            relaxation_of(self.prony_strengths, self.prony_times)
        except ValueError as error:
            raise f.problem(f"does not fit: {error}", key="prony_strengths") from None
        if not 0.0 < self.stiffness_factor <= 1e3:
            raise f.problem("is not allowed", key="stiffness_factor", allowed="above 0, at most 1000")
        return self


class QuasiStaticTable(Section):
    """[quasi_static]: the slow uniaxial test of the same material, which gives the curve."""

    largest_strain: v.Relative = 0.64
    """Nominal compressive strain of the last point [-]."""
    points: Annotated[int, Field(ge=8, le=10_000)] = 65
    sigma: f.Share = 0.002
    """Standard deviation of a stress, relative to it [-]."""

    @model_validator(mode="after")
    def _strain(self) -> "QuasiStaticTable":
        if not 0.01 <= self.largest_strain <= 0.9:
            raise f.problem("is not allowed", key="largest_strain", allowed='from "1 %" to "90 %"')
        return self


class InterfaceTable(Section):
    """[interface]: how the specimen holds to the platens, truly and by the shot file."""

    faces: f.ContactLawName = HOLDING_LAW
    side: f.ContactLawName = HOLDING_LAW
    friction: f.Friction = 0.3
    """Coulomb coefficient, where a law reads it [-]."""


class MotionTable(Section):
    """[motion]: the flyer's motion: a smooth ramp, one that was sampled, or that of the whole test."""

    kind: Literal["ramp", "sampled", "bars"] = "ramp"
    speed: f.Velocity = 2.6
    """Of the ramp; of the striker for "bars" [m/s]."""
    rise: f.PositiveTime = 60e-6
    """Time of the ramp from rest to `speed` [s]."""
    start: f.Time = 37.5e-6
    """When the flyer starts, on the shot's clock [s]."""
    compression: v.Relative = 0.5
    """Nominal compression of the specimen at the end of the record [-]."""
    slowdown: v.Relative = 0.0
    """Share of the speed that is lost from the ramp's end to the record's end [-]; ramp only."""
    file: f.FileName | None = None
    """Table of a sampled motion, beside the specification: time (s), displacement (m)."""
    flyer_mass: f.Mass = 0.026
    """Platen and transducer together, which fly [kg]."""
    flyer_diameter: f.Length = 15e-3
    flyer_length: f.Length = 20e-3
    striker_length: f.Length = 0.25
    """Of the striker, for "bars" [m]."""
    duration: f.PositiveTime | None = None
    """Longest time that is recorded from the start on, for motions that never reach `compression` [s]."""

    @model_validator(mode="after")
    def _ranges(self) -> "MotionTable":
        if not 0.02 <= self.compression <= 0.75:
            raise f.problem("is not allowed", key="compression", allowed='from "2 %" to "75 %"')
        if not 0.0 <= self.slowdown <= 0.9:
            raise f.problem("is not allowed", key="slowdown", allowed='from "0 %" to "90 %"')
        if (self.kind == "sampled") != (self.file is not None):
            raise f.problem(
                'goes with kind = "sampled", and with that alone', key="file", cure="add it, or remove it"
            )
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
    """Shot's clock = the recorder's + this; declared rightly [s]."""


class ChannelTable(Section):
    """[transmitted]: a force transducer, its amplifier and its cable."""

    sensitivity: f.Sensitivity = 0.0112
    compression: Literal["positive", "negative"] = "positive"
    platen_mass: f.Mass = 0.0071
    """Mass between the sensing plane and the specimen, whose inertia the transducer feels [kg]."""
    time_constant: f.PositiveTime | None = None
    """Of the droop; none: a constant force stays [s]."""
    bandwidth: v.Frequency | None = None
    """Where a first-order low-pass has -3 dB; none: unlimited [Hz]."""
    delay: f.Time = 0.0
    """How late the signal arrives [s]; not declared."""
    baseline: f.SignedVoltage = 0.003
    """What the recorder shows at rest [V]."""
    drift: v.Drift = 0.0
    """Change of the baseline with time [V/s]."""
    noise: v.Noise = 0.0016
    """Standard deviation of a sample before it is quantised [V]."""


class IncidentTable(ChannelTable):
    """[incident]: the transducer that flies, behind the flyer's platen."""

    sensitivity: f.Sensitivity = 0.00112


class FramesTable(Section):
    """[frames]: when the cameras look."""

    rate: v.Frequency = 120e3
    static: Annotated[int, Field(ge=3, le=1000)] = 12
    """Frames before the flyer starts."""
    phase: v.Relative = 0.0
    """How far the start lies behind the frame nearest before it, in frames [-], from 0 to below 1."""
    clock_offset: f.Time = 0.0
    """Shot's clock = the cameras' + this; declared rightly [s]."""

    @model_validator(mode="after")
    def _phase_range(self) -> "FramesTable":
        if not 0.0 <= self.phase < 1.0:
            raise f.problem("is not allowed", key="phase", allowed="from 0 to below 1")
        return self


class ExportsTable(Section):
    """[exports]: the outline and the flyer's displacement as a correlation program would give them."""

    write: bool = True
    """Whether they are written; without them the shot needs pictures."""
    flyer_sigma: f.Length = 1e-6
    outline_sigma: f.Length = 4e-6
    points: Annotated[int, Field(ge=4, le=1000)] = 14
    """Points of the outline in a frame."""
    lowest: v.Relative = 0.08
    """Height of the first point over the height of the specimen at the time [-]."""
    highest: v.Relative = 0.92

    @model_validator(mode="after")
    def _in_order(self) -> "ExportsTable":
        if not 0.0 < self.lowest < self.highest < 1.0:
            raise f.problem("is not allowed", key="highest", allowed="0 < lowest < highest < 1")
        return self


class TruthTable(Section):
    """[truth]: the solver's run that the instruments look at, finer than any analysis."""

    mesh: v.Mesh = (96, 129)
    grading: f.Number = 2.0
    element: Literal["fbar", "one_point", "middle"] = "fbar"
    """An element of the solver, or the middle of both, which is nearer to the limit of fine meshes."""


class Specification(Section):
    """A specification of one shot, in SI; every table has defaults, a shot like `runs/open-01`."""

    format: Literal[1] = 1
    name: f.Name = "virtual"
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 1
    specimen: SpecimenTable = SpecimenTable()
    material: MaterialTable = MaterialTable()
    relaxation: RelaxationSection | None = None
    """What truly relaxes beside the law, declared in the shot file with the same keys; none: nothing, or what
    [material] says, of which the shot file says nothing."""
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
        """What relaxes in the solver; empty if nothing does."""
        from kolsky.virtual.material import what_relaxes

        declared = None if self.relaxation is None else self.relaxation.declared()
        return what_relaxes(declared, self.material.prony_strengths, self.material.prony_times)

    @model_validator(mode="after")
    def _no_transducer_in_the_bar(self) -> "Specification":
        if self.transmission.transducer_depth is not None:
            raise f.problem(
                "is not made here: the made transducer sits behind a mass",
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

    @model_validator(mode="after")
    def _relaxes_once(self) -> "Specification":
        if self.relaxation is not None and self.material.prony_times:
            raise f.problem(
                "is given, and so is material.prony_times",
                key="relaxation",
                cure="keep one: [relaxation] is declared in the shot file too, [material] is not",
            )
        return self

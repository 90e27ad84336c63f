"""A shot in SI on one clock: one test, its apparatus, its measurements, and the path of the front face."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dic.views import ResultViews
from kolsky.bars.flyer.events import second_impact
from kolsky.bars.flyer.front_path import BarForce, front_path
from kolsky.bars.flyer.path import FlyerPath, fit_flyer
from kolsky.bars.signals.transducers import force_history, noise_correlation
from kolsky.base.apparatus import Bar, ElasticBody, Interface, Relaxation, Specimen, Transducer
from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine, FlyerMotion, ForceHistory, FrontVelocity, MaterialCurve, Recording
from kolsky.base.toml import TomlFile
from kolsky.pictures.picture_set import PictureSet
from kolsky.pictures.specimen_length import LengthByPictures, RimAtRest

FEWEST_MOVING_FRAMES = 24
"""Smallest number of moving frames for the search for a second impact."""


def fit_front_path(motion: FlyerMotion | FrontVelocity, *, start: float) -> FlyerPath:
    """The smooth path of a motion. Its scale is taken as exact."""
    if isinstance(motion, FlyerMotion):
        restart = second_impact_time(motion, start)
        return fit_flyer(motion, start=start, covariance=_with_zero_start(motion, start), restart=restart)
    return front_path(replace(motion, sigma_gain=0.0))


def second_impact_time(motion: FlyerMotion, start: float) -> float | None:
    """Time one frame and two sigmas before the second impact [s]; None if no second impact is visible."""
    moving = motion.time > start
    if int(moving.sum()) < FEWEST_MOVING_FRAMES or int((~moving).sum()) < 1:
        return None
    impact = second_impact(motion, rest=start)
    if impact.time is None:
        return None
    return impact.time - 2.0 * (impact.sigma or 0.0) - float(np.median(np.diff(motion.time)))


def _with_zero_start(motion: FlyerMotion, start: float) -> FloatArray | None:
    """Covariance of the displacements with their common zero error after rest [m²]. None if it is zero."""
    if motion.zero_sigma == 0.0:
        return None
    moved = (motion.time > start).astype(np.float64)
    return np.asarray(np.diag(motion.sigma**2) + motion.zero_sigma**2 * np.outer(moved, moved))


@dataclass(frozen=True)
class ModelSettings:
    """Material constants that the quasi-static curve does not give."""

    poisson: float
    """Poisson's ratio of the initial state [-]."""
    damping: float
    """Stiffness-proportional damping beta, Eq. (M.2) [s]."""
    damping_kind: str
    """Part of the stiffness that beta multiplies: "deviatoric" or "full"."""
    mass_damping: float
    """Mass-proportional damping alpha [1/s]."""


@dataclass(frozen=True)
class ForceChannel:
    """The transmitted force as recorded volts, and the transducer that converts them to newtons."""

    recording: Recording
    """The channel on the recorder's clock."""
    transducer: Transducer
    """Sensitivity, sign and full scale."""
    baseline: tuple[float, float]
    """Time span for zero and noise, on the shot's clock [s]."""
    clock_offset: float
    """Shot's clock minus recorder's clock [s]."""
    sigma_gain: float = 0.0
    """Standard uncertainty of the sensitivity, relative to it [-]."""

    @property
    def time(self) -> FloatArray:
        """Sample times on the shot's clock [s], shape [n_samples]."""
        return self.recording.time + self.clock_offset

    def baseline_volts(self) -> FloatArray:
        """The samples of the baseline window [V], shape [n]."""
        time = self.time
        return self.recording.value[(time >= self.baseline[0]) & (time <= self.baseline[1])]

    def raw_force(self) -> FloatArray:
        """Force at every sample minus the baseline's mean, compression-positive [N], shape [n_samples]."""
        volts = self.recording.value - self.baseline_volts().mean()
        return self.transducer.compression_sign * volts / self.transducer.sensitivity

    def history(self) -> ForceHistory:
        """The force with its noise; see `kolsky.bars.signals.transducers.force_history`.

        Raises ValueError if the recording, the baseline or the transducer cannot be used.
        """
        return force_history(
            self.recording, self.transducer, baseline=self.baseline, clock_offset=self.clock_offset
        )

    def noise_checks(self) -> dict[str, float]:
        """Numbers for checking the noise of the force: its correlation and the number of baseline samples."""
        return {
            "force_noise_correlation": noise_correlation(self.history(), self.baseline),
            "force_baseline_samples": int(self.baseline_volts().size),
        }


@dataclass(frozen=True)
class IncidentForce:
    """The force at the flyer's transducer, for comparison with simulations."""

    channel: ForceChannel
    """Its channel."""
    mass: float
    """Mass between the sensing plane and the specimen, which moves as one rigid body [kg]."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ShotBase(ResultViews):
    """A shot without its optical measurements (SI, one clock)."""

    name: str
    """Name of the shot; by default its folder's."""
    folder: Path
    """The folder of its files."""
    specimen: Specimen
    """The specimen before the test."""
    interface: Interface
    """Contact between specimen and platens."""
    support: str
    """Support behind the specimen: "rigid", "bar" or "mesh"."""
    transmission_bar: Bar | None
    """The bar if support is "bar". For "mesh", a bar like the longest part, with the length of all parts."""
    transducer_depth: float = 0.0
    """Distance of the transmitted force's transducer behind the platen's face, on that bar [m]."""
    model: ModelSettings
    """Material constants that the curve does not give."""
    force: ForceChannel | BarForce
    """The transmitted force, measured by a transducer or by the bar."""
    curve: MaterialCurve
    """The quasi-static curve, from rest outward."""
    file: TomlFile | None = field(default=None, compare=False)
    """Its parsed shot file; None if the shot was not read from a file."""
    inputs: dict[str, str]
    """SHA-256 of every file that was read: name in the folder -> hex digest."""
    behind: ElasticBody | None = None
    """The elastic parts behind the specimen if support is "mesh"."""
    flyer_body: ElasticBody | None = None
    """The flyer's elastic parts; None for a rigid flyer."""
    incident: IncidentForce | None = None
    """The force at the flyer's transducer; None if it is not compared."""
    relaxation: Relaxation | None = None
    """Viscoelastic terms added to the long-term curve; None for none."""
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Declared standard uncertainties by their keys, SI or relative; undeclared ones are absent."""

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {len(self.inputs)} files in {str(self.folder)!r})"


def fields_of(base: ShotBase) -> dict[str, Any]:
    """The fields of `ShotBase` in a record, as arguments for another record with more fields."""
    return {field.name: getattr(base, field.name) for field in fields(ShotBase)}


@dataclass(frozen=True, kw_only=True, repr=False)
class Shot(ShotBase):
    """One test, ready to be identified."""

    flyer: FlyerMotion | FrontVelocity
    """Motion of the front face. It is the flyer's displacement at the frames, with the zero of its file, or
    the velocity of the incident bar's face."""
    centre_line: CentreLine | None
    """The specimen's outline at the frames; None if it was not measured."""
    window: tuple[float, float]
    """First and last time that is simulated and compared, on the shot's clock [s]."""
    notes: tuple[str, ...] = ()
    """Anomalies in the recordings and their treatment, one sentence each."""
    symmetry_end: float | None = None
    """Time at which the flyer leaves its first direction, from pictures [s]; None if unknown."""
    axis_by_radius: bool = False
    """True if the outline's axis, and so Z, was placed with the declared radius at rest."""
    length_by_pictures: LengthByPictures | None = None
    """The specimen's length as declared, as measured in pictures and as used. None without a measurement."""

    @cached_property
    def flyer_path(self) -> FlyerPath:
        """The smooth path of the front face, fitted at first use.

        Raises
        ------
        ValueError
            If the record cannot be used.
        """
        return fit_front_path(self.flyer, start=self.window[0])


@dataclass(frozen=True, kw_only=True, repr=False)
class PicturedShot(ShotBase):
    """One test with pictures that are not yet correlated."""

    pictures: PictureSet
    """Its pictures and frames."""


@dataclass(frozen=True)
class OpticalData:
    """Optical measurements: the flyer and the outline at the frames."""

    flyer: FlyerMotion
    """The flyer's displacement at the frames."""
    centre_line: CentreLine
    """The specimen's outline at the frames."""
    source: Path
    """The file named by error messages about these measurements."""
    symmetry_end: float | None = None
    """Time at which the flyer leaves its first direction, on the shot's clock [s]; None if it does not."""
    offsets: Mapping[str, float] = field(default_factory=dict)
    """Standard uncertainties of the outline's position by keys of [uncertainty] [m]; empty if unknown."""
    rim: RimAtRest | None = None
    """Height of the flyer's rim at rest above the specimen's lower end; None if unknown."""

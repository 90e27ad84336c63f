"""The input of a batch: the model, the parameters of each simulation, and the quantities to record."""

from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray
from explicit.contact import contact_law
from explicit.elements import element
from explicit.materials import MaterialLaw, bulk_modulus
from explicit.materials.volumetric import Form, checked_form
from explicit.mesh import Mesh
from explicit.platens import RIGID, MovingSupport, PlatenMotion, Support
from explicit.relaxation.base import RateDependence, Relaxation


@dataclass(frozen=True)
class Model:
    """One specimen between two platens. It does not change while a batch runs."""

    mesh: Mesh
    """The specimen."""
    density: float
    """Mass density [kg/m^3]."""
    materials: tuple[MaterialLaw, ...]
    """Material laws that samples refer to (all of one class)."""
    motions: tuple[PlatenMotion, ...]
    """Flyer motions that samples refer to (all with the same start)."""
    faces: str = "bonded"
    """Contact law of the end faces."""
    side: str = "bonded"
    """Contact law of the side surface where it rolls onto a platen."""
    support: Support = RIGID
    """The support behind the transmission platen."""
    damping_kind: Literal["deviatoric", "full"] = "deviatoric"
    """Stiffness-proportional damping acts on the deviator only, or on the whole elastic tensor."""
    hourglass: float = 0.3
    """Size of hourglass control [-]. An element without hourglass control ignores it. "stiffness": relative
    to full integration of the initial shear stiffness. "viscous": share of the pattern's critical damping."""
    hourglass_form: Literal["stiffness", "viscous"] = "stiffness"
    """Resistance to the hourglass patterns. It is a stiffness with the damping of the solid, or only a
    viscosity that scales with the shear wave speed (Flanagan and Belytschko 1981)."""
    element: str = "one_point"
    """The element: a name of `explicit.elements.ELEMENTS`."""
    past_data: Literal["continue", "stop"] = "continue"
    """Behaviour when an element is strained beyond the data of its material law. Either the law continues on
    its last tangent and `Response.extrapolated_share` counts the element, or the simulation ends as
    TABLE_EXCEEDED."""
    volumetric: Form = "quadratic"
    """Form of the volumetric law, see `explicit.materials.volumetric`."""

    relaxation: tuple[RateDependence, ...] = ()
    """Viscoelastic models that are added to the material law. The material law is then the long-term law. A
    sample refers to one of them (all of one class, e.g. `explicit.relaxation.PronySeries`). Empty: no
    relaxation."""

    def __post_init__(self) -> None:
        if not 0.0 < self.density < float("inf"):
            raise ValueError(f"density must be > 0 kg/m^3 and finite, got {self.density}")
        if not self.materials or len({type(law) for law in self.materials}) != 1:
            raise ValueError("a model needs material laws, all of one class")
        if not self.motions or len({motion.start for motion in self.motions}) != 1:
            raise ValueError("a model needs flyer motions, all with one start time")
        if isinstance(self.support, MovingSupport):
            starts = {motion.start for motion in self.support.motions}
            if starts != {self.start}:
                raise ValueError(f"a moving support must start at {self.start} s as the flyer, got {starts}")
        if self.damping_kind not in ("deviatoric", "full"):
            raise ValueError(f"damping_kind must be 'deviatoric' or 'full', got {self.damping_kind!r}")
        if self.past_data not in ("continue", "stop"):
            raise ValueError(f"past_data must be 'continue' or 'stop', got {self.past_data!r}")
        if len({type(branches) for branches in self.relaxation}) > 1:
            raise ValueError("all relaxation laws in a model must be of one class")
        if not self.hourglass >= 0.0:
            raise ValueError(f"hourglass must be >= 0, got {self.hourglass}")
        if self.hourglass_form not in ("stiffness", "viscous"):
            raise ValueError(f"hourglass_form must be 'stiffness' or 'viscous', got {self.hourglass_form!r}")
        checked_form(self.volumetric)
        contact_law(self.faces)
        contact_law(self.side)
        element(self.element)

    @property
    def relaxation_kind(self) -> Relaxation | None:
        """Generator of the kernels of `relaxation`; None without relaxation."""
        if not self.relaxation:
            return None
        return self.relaxation[0].kind(max(len(branches) for branches in self.relaxation))

    @property
    def start(self) -> float:
        """Time at which the specimen is at rest [s]."""
        return self.motions[0].start


@dataclass(frozen=True)
class Samples:
    """The parameters that differ between the simulations of a batch; every field has shape [n_samples]."""

    stiffness_factor: FloatArray
    """Factor m on the whole material law [-], shape [n_samples]."""
    poisson: FloatArray
    """Poisson's ratio of the initial state [-], shape [n_samples]."""
    damping: FloatArray
    """Stiffness-proportional damping beta [s], shape [n_samples]."""
    friction: FloatArray
    """Coulomb coefficient f, used where a contact law is "coulomb" [-], shape [n_samples]."""
    mass_damping: FloatArray
    """Mass-proportional damping alpha [1/s], shape [n_samples]."""
    material: NDArray[np.int64]
    """Index into `Model.materials`, shape [n_samples]."""
    motion: NDArray[np.int64]
    """Index into `Model.motions`, shape [n_samples]."""
    release_stress: FloatArray
    """Tensile contact stress at which a node is released [Pa], shape [n_samples]. Infinity: never. Used where
    a contact law is "bonded_release"."""
    contact_stiffness: FloatArray
    """Pressure per penetration, used where a contact law is "penalty" [Pa/m], shape [n_samples]."""
    relaxation: NDArray[np.int64]
    """Index into `Model.relaxation`, 0 where that is empty, shape [n_samples]."""

    def __post_init__(self) -> None:
        if len({len(getattr(self, f.name)) for f in fields(self)}) != 1:
            raise ValueError("every parameter of a batch needs one value per sample")
        _require(self.stiffness_factor, self.stiffness_factor > 0.0, "stiffness_factor must be > 0")
        _require(self.damping, self.damping >= 0.0, "damping must be >= 0 s")
        _require(self.friction, self.friction >= 0.0, "friction must be >= 0")
        _require(self.mass_damping, self.mass_damping >= 0.0, "mass_damping must be >= 0 1/s")
        _require(self.release_stress, self.release_stress >= 0.0, "release_stress must be >= 0 Pa")
        _require(self.contact_stiffness, self.contact_stiffness > 0.0, "contact_stiffness must be > 0 Pa/m")
        for name in ("stiffness_factor", "damping", "friction", "mass_damping", "contact_stiffness"):
            _require(getattr(self, name), np.isfinite(getattr(self, name)), f"{name} must be finite")
        bulk_modulus(1.0, self.poisson)

    def __len__(self) -> int:
        return len(self.stiffness_factor)

    @classmethod
    def of(
        cls,
        *,
        stiffness_factor: FloatArray | float = 1.0,
        poisson: FloatArray | float = 0.499,
        damping: FloatArray | float = 0.0,
        friction: FloatArray | float = 0.0,
        mass_damping: FloatArray | float = 0.0,
        material: NDArray[np.int64] | int = 0,
        motion: NDArray[np.int64] | int = 0,
        release_stress: FloatArray | float = float("inf"),
        contact_stiffness: FloatArray | float = 1e13,
        relaxation: NDArray[np.int64] | int = 0,
    ) -> "Samples":
        """Broadcast scalars and arrays to one batch."""
        values = (stiffness_factor, poisson, damping, friction, mass_damping, material, motion)
        contact = (release_stress, contact_stiffness)
        columns = (*values, *contact, relaxation)
        shape = np.broadcast_shapes((1,), *(np.shape(value) for value in columns))
        real = [np.array(np.broadcast_to(x, shape), dtype=np.float64) for x in (*values[:5], *contact)]
        index = [
            np.array(np.broadcast_to(value, shape), dtype=np.int64) for value in (*values[5:], relaxation)
        ]
        arguments = dict(
            zip((f.name for f in fields(cls)), (*real[:5], *index[:2], *real[5:], index[2]), strict=True)
        )
        return cls(**arguments)  # type: ignore[arg-type]


def _require(values: FloatArray, good: NDArray[np.bool_], message: str) -> None:
    if not np.all(good):
        raise ValueError(f"{message}, got {values[~good][0]}")


@dataclass(frozen=True)
class Sampling:
    """Recorded quantities of a batch and their times."""

    force_times: FloatArray
    """Times of forces and impulses [s], ascending, shape [n_force_times]."""
    surface_times: FloatArray
    """Times of the side surface and the energy ledger [s], ascending, shape [n_surface_times]."""
    all_nodes: bool = False
    """Record every node at the surface times, for meshes and pictures."""
    ledger_every: int = 1
    """Number of surface times from one entry of the energy ledger to the next. The ledger is NaN at the times
    between. The last time always has an entry. An entry takes most of the time of a step."""

    def __post_init__(self) -> None:
        for name in ("force_times", "surface_times"):
            times = getattr(self, name)
            if len(times) == 0 or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
                raise ValueError(f"{name} must be finite and strictly ascending, with at least one time")
        if self.ledger_every < 1:
            raise ValueError(f"ledger_every must be >= 1, got {self.ledger_every}")

    @property
    def end(self) -> float:
        """The last requested time [s]."""
        return float(max(self.force_times[-1], self.surface_times[-1]))


@dataclass(frozen=True)
class Stepping:
    """Numerical choices of the time loop."""

    safety: float = 0.9
    """Ratio of a step to the element-by-element stability bound, in (0, 1]."""
    measure_every: int = 8
    """Steps between two measurements of the bound."""
    bound: Literal["trace", "eigenvalue"] = "trace"
    """Estimate of the non-volumetric part of an element's stiffness and damping in the bound. It uses the
    trace of |grad v|^2, or its largest eigenvalue. Both are safe. The second allows longer steps, especially
    on fine meshes, with a larger time error ({doc}`/theory/solver`)."""
    largest_step: float = float("inf")
    """Upper limit of the step [s]."""
    floor: float = 1e-3
    """A step below this share of the first one ends the simulation as STEP_COLLAPSED."""
    max_steps: int = 10_000_000
    """Steps after which a simulation ends as STEP_LIMIT."""
    precision: Literal["fp32", "fp64"] = field(default="fp64")
    """Arithmetic of state and elements; clocks, motion and impulses are always fp64."""

    def __post_init__(self) -> None:
        if not 0.0 < self.safety <= 1.0:
            raise ValueError(f"safety must be in (0, 1], got {self.safety}")
        if self.measure_every < 1:
            raise ValueError(f"measure_every must be >= 1, got {self.measure_every}")
        if not self.largest_step > 0.0:
            raise ValueError(f"largest_step must be > 0 s, got {self.largest_step}")
        if not 0.0 <= self.floor < 1.0:
            raise ValueError(f"floor must be in [0, 1), got {self.floor}")
        if self.max_steps < 1:
            raise ValueError(f"max_steps must be >= 1, got {self.max_steps}")
        if self.bound not in ("trace", "eigenvalue"):
            raise ValueError(f"bound must be 'trace' or 'eigenvalue', got {self.bound!r}")
        if self.precision not in ("fp32", "fp64"):
            raise ValueError(f"precision must be 'fp32' or 'fp64', got {self.precision!r}")


LEAST_SCALE = {"damping": 1e-5, "friction": 0.1, "mass_damping": 10.0}
"""Smallest scale of a parameter whose value may be zero [s, 1, 1/s]. A change of this size has a visible
effect in a test."""


def scale_of(name: str, value: float) -> float:
    """Scale of a relative step of a parameter.

    For the stiffness factor, damping, friction and drag the scale is the value. For the last three it is at
    least `LEAST_SCALE`. For Poisson's ratio it is the distance from 1/2, because the bulk modulus depends on
    this distance.
    """
    if name == "poisson":
        return 0.5 - value
    return max(value, LEAST_SCALE.get(name, 0.0))

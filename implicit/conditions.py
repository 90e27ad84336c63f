"""Supports and loads of a model; histories are given by name when it is solved."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray


@dataclass(frozen=True)
class Fixed:
    """Displacements held at zero."""

    where: str
    """Set of points."""
    axes: tuple[int, ...] | None = None
    """Components held; None: all."""


@dataclass(frozen=True)
class Prescribed:
    """One displacement component that follows a history."""

    where: str
    """Set of points."""
    axis: int
    """The component."""
    history: str
    """Name of the history [m]."""
    factor: float | FloatArray = 1.0
    """Factor of the history [-], one for all points of the set or one for each, in its order."""


@dataclass(frozen=True)
class Coupled:
    """Points that move together along an axis (a rigid interface that slides), under a force or none.

    This is the coupling of Schumacher and others (2020), Eq. (6): the component is one unknown.
    """

    where: str
    """Set of points."""
    axis: int
    """The component they share."""
    force: str | None = None
    """Name of the history of the force on them [N]; None: no force."""


@dataclass(frozen=True)
class NodalForce:
    """A dead force, shared equally by the points of a set."""

    where: str
    """Set of points."""
    axis: int
    """Its direction."""
    history: str
    """Name of the history [N]."""


@dataclass(frozen=True)
class Traction:
    """A dead load on the faces whose points all belong to a set, per undeformed area."""

    where: str
    """Set of points."""
    axis: int
    """Its direction."""
    history: str
    """Name of the history [Pa]."""


@dataclass(frozen=True)
class Gravity:
    """Weight (Schumacher and others 2020, Eq. 11)."""

    density: float
    """In the reference state [kg/m3]."""
    acceleration: tuple[float, ...]
    """Acceleration of free fall [m/s2], shape [d]."""
    history: str | None = None
    """Name of a history of its factor [-]; None: it acts from the first step on."""


@dataclass(frozen=True)
class Pressure:
    """A pressure that stays normal to the deformed faces whose points all belong to a set."""

    where: str
    """Set of points."""
    history: str
    """Name of the history [Pa], positive where it presses."""


@dataclass(frozen=True)
class RigidPlane:
    """A frictionless rigid plane that points of a set cannot pass.

    The multipliers of the points in contact are found by augmentation: a penalty force stiffness * depth + a
    multiplier, which is raised by the penalty force until no point is deeper than the tolerance.
    """

    where: str
    """Set of points that may touch."""
    normal: tuple[float, ...]
    """Direction out of the plane, towards the body [-], shape [d]; its length does not matter."""
    position: tuple[float, ...]
    """A point of the plane at history value 0 [m], shape [d]."""
    history: str | None = None
    """Name of the history of the plane's travel along its normal [m]; None: it stays."""
    stiffness: float | None = None
    """Penalty of a point [N/m]; None: from the shear modulus and the spacing of the points."""
    tolerance: float = 1e-6
    """Largest depth, as a share of the mesh's size [-]."""


@dataclass(frozen=True)
class SelfContact:
    """Two surfaces of the body that cannot pass through each other, without friction.

    Points of integration of each are pushed out of the other by a penalty; an equilibrium in which one
    is deeper than `depth` is none.
    """

    where: str
    """Set of points of the first surface."""
    other: str
    """Set of points of the second surface."""
    penalty: float = 500.0
    """Pressure over depth, in shear moduli over the size of a face [-]."""
    depth: float | None = None
    """Largest depth of an equilibrium [m]; None: a hundredth of the size of a face."""
    reach: float | None = None
    """Distance within which a surface is looked for [m], less than the body is thick behind it; None: the
    size of a face."""

    def __post_init__(self) -> None:
        for name in ("penalty", "depth", "reach"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} of a contact must be > 0, got {value}")


Load = NodalForce | Traction | Gravity | Pressure
Condition = Fixed | Prescribed | Coupled | RigidPlane | SelfContact | Load


def histories_of(conditions: tuple[Condition, ...]) -> tuple[str, ...]:
    """Names of the histories that the conditions ask for, in their order, each once."""
    names: list[str] = []
    for condition in conditions:
        name = condition.force if isinstance(condition, Coupled) else getattr(condition, "history", None)
        if name is not None and name not in names:
            names.append(name)
    return tuple(names)


def unit(normal: tuple[float, ...]) -> FloatArray:
    """A direction of length 1, shape [d]."""
    vector = np.asarray(normal, dtype=float)
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise ValueError("the normal of a plane must not be zero")
    return np.asarray(vector / length)

"""What a loop needs of the whole model, as one HDF5 file a direction of gravity.

It has the basis, the chosen elements, the bends that judge them, and the plant's. A file belongs to one
actuator, gravity and set of options, which its key says; with another key it is made anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from implicit.reduction.model import ReducedModel
from implicit.reduction.pod import Basis
from implicit.reduction.sampling import Sample
from kolsky.actuator.controller import Plant
from kolsky.actuator.model import WEIGHT, Actuator
from kolsky.actuator.reduced import ReducedActuator, Reduction
from kolsky.actuator.schema import ControlSection
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.hdf5 import Format, reading, writing
from kolsky.base.hdf5_items import COLLECTION, Flags, Floats, Integers, Text
from kolsky.base.hdf5_records import Record

FORMAT = Format("kolsky actuator basis")
CURE = "delete it: it is made anew from the SPEC"


@dataclass(frozen=True)
class StoredBasis:
    """A reduced actuator and its plant as they are stored."""

    key: str
    """SHA-256 of what they follow from."""
    modes: FloatArray
    """Orthonormal columns [-], shape [n_dofs, r]."""
    singular: FloatArray
    """Singular values [m], shape [n_snapshots]."""
    cells: IntArray
    """Chosen elements, shape [s]."""
    weights: FloatArray
    """Their weights [-], shape [s]."""
    residual: float
    """Share of the forces that they leave [-]."""
    reached: bool
    """Whether that is within the tolerance."""
    pressure: FloatArray
    """Pressures that the basis has not seen [Pa], shape [k]."""
    angle: FloatArray
    """Angle of the whole model there [rad], shape [k]."""
    error: FloatArray
    """Angle of the reduced model less that [rad], shape [k]."""
    gap: float
    """Smallest distance of neighbouring chambers at any of the pressures [m]; NaN without gaps."""
    plant_pressure: FloatArray
    """Pressures at which the plant was simulated [Pa], shape [p]."""
    plant_angle: FloatArray
    """Its angle there [rad], shape [p]."""


BASIS = Record(
    StoredBasis,
    COLLECTION,
    {
        "key": Text(),
        "modes": Floats("1", "components modes"),
        "singular": Floats("m", "snapshots"),
        "cells": Integers("1", "elements"),
        "weights": Floats("1", "elements"),
        "residual": Floats("1"),
        "reached": Flags("1"),
        "pressure": Floats("Pa", "unseen"),
        "angle": Floats("rad", "unseen"),
        "error": Floats("rad", "unseen"),
        "gap": Floats("m"),
        "plant_pressure": Floats("Pa", "plant"),
        "plant_angle": Floats("rad", "plant"),
    },
)


def basis_key(
    actuator: Actuator, gravity: Sequence[float] | FloatArray, section: ControlSection, steps: int
) -> str:
    """SHA-256 of all that a reduction and its plant, simulated at `steps` pressures, follow from."""
    digest = sha256()
    mesh, solid = actuator.mesh, actuator.solid
    words = (
        mesh.kind, type(solid).__name__, repr(solid), repr(actuator.cavities), repr(actuator.mixed),
        repr(float(actuator.density)), repr([float(g) for g in gravity]), repr(steps),
        repr((section.most, section.modes, section.tolerance, section.snapshots, section.plant_stiffness)),
    )  # fmt: skip
    for word in words:
        digest.update(word.encode() + b"\0")
    arrays = [mesh.points, mesh.cells, solid.parameters()]
    for name in sorted(mesh.sets):
        digest.update(name.encode() + b"\0")
        arrays.append(mesh.nodes(name))
    for array in arrays:
        digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def stored(key: str, made: Reduction, plant: Plant) -> StoredBasis:
    """What is stored of a reduction and a plant."""
    reduced = made.model.reduced
    sample, basis = reduced.sample, reduced.basis
    return StoredBasis(
        key, basis.modes, basis.values, sample.cells, sample.weights, sample.residual, sample.reached,
        made.pressure, made.angle, made.error, made.gap, plant.pressure, plant.angle,
    )  # fmt: skip


def write_basis(path: Path, found: StoredBasis) -> None:
    """Write the file, and its folder where there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with writing(path, FORMAT) as place:
        BASIS.write(place, found)


def read_basis(path: Path, key: str) -> StoredBasis | None:
    """Read a file back; None where there is none, or one of another key.

    Raises
    ------
    InputError
        If the file is damaged or of another format.
    """
    if not Path(path).exists():
        return None
    with reading(path, FORMAT, cure=CURE) as place:
        found = BASIS.read(place)
    return found if found.key == key else None


def restored(
    found: StoredBasis, actuator: Actuator, gravity: Sequence[float] | FloatArray
) -> tuple[Reduction, FloatArray, FloatArray]:
    """The reduction of an actuator, and pressure and angle of the plant.

    Raises
    ------
    ValueError
        If the file's modes or elements are not those of the actuator's mesh.
    """
    model = actuator.model(gravity)
    if len(found.modes) != model.n_dofs or not (found.cells < len(model.mesh.cells)).all():
        raise ValueError("the stored basis is of another mesh: delete it")
    sample = Sample(found.cells, found.weights, found.residual, found.reached)
    reduced = ReducedModel(model, Basis(found.modes, found.singular), sample, gravity=WEIGHT)
    made = Reduction(ReducedActuator(reduced), found.pressure, found.angle, found.error, found.gap)
    return made, found.plant_pressure, found.plant_angle

"""Measured markers of a SPEC, beside what was simulated at their pressures."""

from collections.abc import Sequence

import numpy as np

from kolsky.actuator.marker_fit import MarkerComparison, StiffnessFit, compare, fit_stiffness
from kolsky.actuator.reading import ActuatorSpec
from kolsky.actuator.study import Direction
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.table import Column, read_table

SAME = 1e-6
"""Difference of pressures that are the same, as a share of the largest [-]."""


def compared_markers(
    spec: ActuatorSpec, directions: Sequence[Direction]
) -> tuple[list[MarkerComparison], StiffnessFit | None, dict[str, str]]:
    """Compare the markers that a SPEC names, fit the stiffness to them; with the hash of their file.

    Raises
    ------
    InputError
        If the file names a direction or pressure that the SPEC does not declare, or markers are missing.
    ValueError
        If an equilibrium of the fit is not found.
    """
    section = spec.declared.markers
    if section is None:
        return [], None, {}
    measured, sha256 = read_markers(spec)
    known = {one.name: one for one in directions}
    found = []
    for name, sets in measured.items():
        one = known[name]
        for pressure, places in sets.items():
            step = int(np.argmin(np.abs(one.pristine.pressures.max(axis=1) - pressure)))
            found.append(compare(one.pristine, name, step, places, section.sigma))
    stiffness = fit_stiffness(spec.actuator, spec.gravities, measured, section.sigma)
    return found, stiffness, {section.file: sha256}


def read_markers(spec: ActuatorSpec) -> tuple[dict[str, dict[float, FloatArray]], str]:
    """Markers [m] of shape [n, 2] by direction of gravity and pressure [Pa], and the hash of their file."""
    section = spec.declared.markers
    assert section is not None  # asked for only then
    path = spec.toml.path.parent / section.file
    if "line" not in spec.actuator.mesh.sets:
        raise spec.toml.error(
            "markers", 'need the set "line" of the mesh', cure="name the base's middle line"
        )
    table = read_table(path, layout=None if section.layout is None else section.layout.as_layout())
    numbers = table.integers(Column(section.marker))
    pressures = table.values(section.pressure.as_column())
    named = Column(section.gravity)
    names = [table.field(named, row).strip() for row in range(len(numbers))]
    x, z = table.values(section.x.as_column()), table.values(section.z.as_column())
    declared = spec.pressures
    found: dict[str, dict[float, FloatArray]] = {}
    for name in dict.fromkeys(names):
        if name not in spec.gravities:
            raise InputError(path, f"names the direction {name!r}", allowed=", ".join(spec.gravities))
        found[name] = {}
        rows = np.array([other == name for other in names])
        for pressure in np.unique(pressures[rows]):
            if np.abs(declared - pressure).min() > SAME * declared.max():
                raise InputError(
                    path,
                    f"has a pressure of {pressure:g} Pa, which SPEC does not declare",
                    allowed=", ".join(f"{p:g}" for p in declared),
                )
            own = np.flatnonzero(rows & (pressures == pressure))
            own = own[np.argsort(numbers[own], kind="stable")]
            if not np.array_equal(numbers[own], np.arange(1, len(own) + 1)):
                raise InputError(
                    path,
                    f"has the markers {numbers[own].astype(int).tolist()} of {name} at {pressure:g} Pa",
                    allowed="1, 2, ..., each once, from the clamped end on",
                )
            found[name][float(pressure)] = np.column_stack([x[own], z[own]])
    return found, table.sha256

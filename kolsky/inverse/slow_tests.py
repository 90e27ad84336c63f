"""Slow tests of one material: their file and their prediction."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from explicit.materials import AnyLaw, MaterialLaw
from explicit.relaxation import BergstromBoyce, PronySeries, bergstrom_boyce_stress
from kolsky.base.apparatus import NETWORK_CONSTANTS, Relaxation, prony_names
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError, refused
from kolsky.base.toml import TomlFile, parse_toml
from kolsky.inverse.joint_result import Slow
from kolsky.inverse.parameters import MOVED
from kolsky.material.relaxation.rate_fit import DynamicTest, Evidence, HistoryTest, RateModel, ScaledLaw
from kolsky.material.relaxation.temperature import Superposition, TemperatureSweep, superpose
from kolsky.readers.table import Column, Table, read_table
from kolsky.schema import fields as f
from kolsky.schema.fields import (
    ColumnSection,
    RatioColumn,
    Section,
    StressColumn,
    TextLayoutSection,
    TimeColumn,
)
from kolsky.schema.material import LawSection

NEEDED = {
    "relaxation": ("time", "stress", "strain"),
    "history": ("time", "stress", "strain_column"),
    "oscillation": ("frequency", "storage", "loss"),
    "sweep": ("frequency", "storage", "loss", "temperature", "reference"),
}
"""Keys that a kind of test needs."""
_TEST_KEYS = (
    *("time", "stress", "strain", "strain_column", "frequency", "storage", "loss", "rise"),
    *("temperature", "reference"),
)
_OPTIONAL: dict[str, tuple[str, ...]] = {"relaxation": ("rise",)}
_ZEROS = {"degC": 273.15, "°C": 273.15, "K": 0.0}
"""Unit of a temperature -> offset to kelvin."""


def _frequency(text: object) -> float:
    factors = {"Hz": 2.0 * np.pi, "rad/s": 1.0}
    if not isinstance(text, str) or text not in factors:
        raise f.problem("is not a unit of a frequency", allowed='"Hz", "rad/s"')
    return float(factors[text])


class FrequencyColumn(ColumnSection):
    """A column of frequencies; after reading, `unit` is the factor to rad/s."""

    unit: Annotated[float, BeforeValidator(_frequency)]


def _temperature_unit(text: object) -> float:
    if not isinstance(text, str) or text not in _ZEROS:
        raise f.problem("is not a unit of temperatures", allowed='"degC", "K"')
    return _ZEROS[text]


def _temperature(text: object) -> float:
    number, _, unit = text.strip().partition(" ") if isinstance(text, str) else ("", "", "")
    try:
        value = float(number) + _ZEROS[unit.strip()]
    except (ValueError, KeyError):
        raise f.problem("is not a temperature", cure='write e.g. "25 degC" or "298 K"') from None
    if not 0.0 < value < 2000.0:
        raise f.problem("is not allowed", allowed="above absolute zero, below 2000 K")
    return value


class TemperatureColumn(ColumnSection):
    """A column of temperatures; after reading, `unit` is the offset to kelvin."""

    unit: Annotated[float, BeforeValidator(_temperature_unit)]


class SlowTest(Section):
    """[test.NAME]: one slow test of the material. Its file is in the folder of the list."""

    kind: Literal["relaxation", "history", "oscillation", "sweep"]
    file: f.FileName
    layout: TextLayoutSection | None = None
    time: TimeColumn | None = None
    stress: StressColumn | None = None
    strain: f.Ratio | None = None
    """Absolute value of the constant nominal strain; its sign is that of `branch`."""
    strain_column: RatioColumn | None = None
    rise: f.Time = 0.0
    branch: Literal["compression", "tension"] = "compression"
    convention: Literal["tension positive", "compression positive"] = "tension positive"
    frequency: FrequencyColumn | None = None
    storage: StressColumn | None = None
    loss: StressColumn | None = None
    temperature: TemperatureColumn | None = None
    reference: Annotated[float, BeforeValidator(_temperature)] | None = None
    """Reference temperature of a sweep [K]."""
    relative_sigma: f.Share = 0.0
    sigma_floor: f.Stress = 0.0

    @model_validator(mode="after")
    def _complete(self) -> "SlowTest":
        needed = NEEDED[self.kind]
        for name in needed:
            if getattr(self, name) is None:
                raise f.problem(f'is missing; kind = "{self.kind}" needs it', key=name, cure="add it")
        for name in _TEST_KEYS:
            if name in self.model_fields_set and name not in (*needed, *_OPTIONAL.get(self.kind, ())):
                raise f.problem(
                    f'is given, but kind = "{self.kind}" does not read it, so it would have no effect',
                    key=name,
                    cure="remove it",
                )
        if self.relative_sigma == 0.0 and self.sigma_floor == 0.0:
            raise f.problem(
                "is zero and so is sigma_floor, as if the test had no uncertainty",
                key="relative_sigma",
                cure='write the noise of the test, e.g. "1 %", or sigma_floor = "50 Pa"',
            )
        if self.strain is not None and not (
            0.0 < self.strain < (1.0 if self.branch == "compression" else 20.0)
        ):
            raise f.problem("is not allowed", key="strain", allowed="above 0, in compression below 100 %")
        return self


class SlowFile(Section):
    """A list of slow tests, and the material law for the comparison."""

    format: Literal[1]
    law: LawSection | None = None
    test: dict[str, SlowTest] = Field(min_length=1)


@dataclass(frozen=True)
class SlowList:
    """Slow tests as read."""

    tests: Slow
    """The tests. A sweep is given as its master curve at the reference temperature."""
    sweeps: Mapping[str, Superposition]
    """Temperature sweeps by name, including those with undetermined shifts."""
    files: Mapping[str, str]
    law: AnyLaw | None


def read_slow_tests(path: Path) -> Slow:
    """Read a list of slow tests for shots, which declare the law; InputError with file, line, key, remedy."""
    toml = parse_toml(path)
    if "law" in toml.content:
        message = "is that of the shots, so [law] would have no effect"
        raise InputError(path, message, key="law", cure="remove it")
    made = read_slow_list(toml)
    for name, sweep in made.sweeps.items():
        if not sweep.determined:
            with refused(path, key=f"test.{name}", cure="leave it out"):
                sweep.reduced()
    return made.tests


def read_slow_list(source: Path | TomlFile) -> SlowList:
    """Read a list of slow tests and their files, its law, and the superposition of its sweeps.

    Raises InputError for the reasons of `read_slow_tests`. A sweep with undetermined shifts is not among the
    tests.
    """
    toml = source if isinstance(source, TomlFile) else parse_toml(source)
    declared = toml.validated(SlowFile)
    tests: list[Evidence] = []
    sweeps: dict[str, Superposition] = {}
    files = {str(toml.path): toml.sha256}
    for name, test in declared.test.items():
        layout = None if test.layout is None else test.layout.as_layout()
        table = read_table(toml.path.parent / test.file, layout=layout)
        files[str(table.path)] = table.sha256
        cure = "correct the table or its columns in the list"
        with refused(table.path, f"cannot be used as the slow test {name}: ", cure=cure):
            if test.kind == "sweep":
                sweeps[name] = _sweep(name, test, table)
                if sweeps[name].determined:
                    tests.append(sweeps[name].reduced())
            elif test.kind == "oscillation":
                tests.append(_oscillation(name, test, table))
            else:
                tests.append(_history(name, test, table))
    return SlowList(tuple(tests), sweeps, files, None if declared.law is None else declared.law.law)


def _column(section: ColumnSection | None) -> Column:
    assert section is not None  # checked by the schema
    return section.as_column()


def _sigma(test: SlowTest, size: FloatArray) -> FloatArray:
    return np.hypot(test.relative_sigma * np.abs(size), test.sigma_floor)


def _history(name: str, test: SlowTest, table: Table) -> HistoryTest:
    time, stress = table.values(_column(test.time)), table.values(_column(test.stress))
    sign = 1.0 if test.convention == "tension positive" else -1.0
    stress = sign * stress
    sigma = _sigma(test, stress)
    if test.kind == "relaxation":
        assert test.strain is not None  # checked by the schema
        stretch = 1.0 + (test.strain if test.branch == "tension" else -test.strain)
        made = HistoryTest.relaxation(time, stress, sigma, stretch=stretch, rise=test.rise)
        return replace(made, label=name)
    strain = sign * table.values(_column(test.strain_column))
    # samples at zero strain give no information on the law; they only define the history
    told = np.where(stress == 0.0, np.inf, sigma) if test.sigma_floor == 0.0 else sigma
    return HistoryTest(time, 1.0 + strain, stress, told, label=name)


def _oscillation(name: str, test: SlowTest, table: Table) -> DynamicTest:
    parts: dict[str, Any] = {
        "angular_frequency": table.values(_column(test.frequency)),
        "storage": table.values(_column(test.storage)),
        "loss": table.values(_column(test.loss)),
    }
    sigma_storage = _sigma(test, parts["storage"])
    sigma_loss = _sigma(test, parts["loss"])
    return DynamicTest(**parts, sigma_storage=sigma_storage, sigma_loss=sigma_loss, label=name)


def _sweep(name: str, test: SlowTest, table: Table) -> Superposition:
    column = test.temperature
    assert column is not None  # checked by the schema
    assert test.reference is not None
    kelvin = table.values(Column(column.column, 1.0)) + column.unit
    return superpose(TemperatureSweep(kelvin, _oscillation(name, test, table), test.reference))


def slow_measured(slow: Slow) -> tuple[FloatArray, FloatArray]:
    """Values of all tests in one vector and their standard uncertainties, without samples that have none."""
    if not slow:
        return np.zeros(0), np.zeros(0)
    known = [np.isfinite(one.sigma) for one in slow]
    values = [one.values[k] for one, k in zip(slow, known, strict=True)]
    sigma = [one.sigma[k] for one, k in zip(slow, known, strict=True)]
    return np.concatenate(values), np.concatenate(sigma)


def slow_predicted(
    slow: Slow, law: MaterialLaw, relaxation: Relaxation | None, values: Mapping[str, float]
) -> FloatArray:
    """The predicted values for a material, shape [n].

    ``law``: the long-term law at factor 1. ``relaxation``: the declared one, or None. ``values``: constants
    by parameter name; a missing constant keeps its declared value, a missing factor is 1. Raises ValueError
    if a Bergstrom-Boyce network is to be compared with an oscillation.
    """
    if not slow:
        return np.zeros(0)
    factor = float(values.get(MOVED, 1.0))
    rows = []
    for one in slow:
        if relaxation is not None and relaxation.kind == "bergstrom_boyce":
            if not isinstance(one, HistoryTest):
                raise ValueError(
                    f"{one.label}: an oscillation has no storage and loss modulus in a network that flows as "
                    "a power of the stress: leave the test out, or fit a Prony series"
                )
            network = BergstromBoyce(*(float(values.get(n, relaxation.values[n])) for n in NETWORK_CONSTANTS))
            whole = bergstrom_boyce_stress(ScaledLaw(law, factor), network, one.time, one.stretch)[0]
        else:
            whole = one.predict(law, [RateModel(factor, _series(relaxation, values))])[0]
        rows.append(whole[np.isfinite(one.sigma)])
    return np.concatenate(rows)


def _series(relaxation: Relaxation | None, values: Mapping[str, float]) -> PronySeries:
    if relaxation is None:
        return PronySeries((), ())
    n = relaxation.branches
    constants = [float(values.get(name, relaxation.values[name])) for name in prony_names(n)]
    return PronySeries(tuple(constants[:n]), tuple(constants[n:]))

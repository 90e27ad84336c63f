"""The tables of shot.toml about the material: [curve], [law] and [relaxation]."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, model_validator

from kolsky.base.apparatus import MOST_BRANCHES, NETWORK_DEFAULTS, Relaxation, prony_names
from kolsky.base.records import MaterialCurve
from kolsky.base.units import UnitError, quantity
from kolsky.schema import fields as f
from kolsky.schema.apparatus import UncertaintySection
from kolsky.schema.fields import ModeColumns, RatioColumn, Section, StressColumn, TextLayoutSection

if TYPE_CHECKING:
    import explicit.materials


BASELINE_POINTS = 41
"""Number of points, rest included, of the curve that represents the law in figures and counts."""


class LawSection(Section):
    """[law]: name and constants of a law, the range of its data, and the uncertainty of its stress."""

    name: f.Name
    parameters: dict[str, Any]
    branch: Literal["compression", "tension"]
    largest_strain: f.Ratio
    relative_sigma: f.Share
    baseline: bool = True
    strain_rate: f.StrainRate | None = None

    @model_validator(mode="after")
    def _is_a_law(self) -> "LawSection":
        if self.branch == "compression" and self.largest_strain >= 1.0:
            raise f.problem("is not allowed", key="largest_strain", allowed="below 1 in compression")
        if self.relative_sigma == 0.0:
            raise f.problem(
                "is zero, as if the law had no uncertainty",
                key="relative_sigma",
                cure='write the standard uncertainty that all its stresses share, e.g. "3 %"',
            )
        self.law  # noqa: B018 (a law that cannot be is refused when the file is read)
        return self

    @cached_property
    def law(self) -> "explicit.materials.AnyLaw":
        """The law, with the range of the data of its constants."""
        from explicit.materials import LAWS
        from explicit.materials.law import not_positive

        if self.name not in LAWS:
            raise f.problem("is not a law", key="name", allowed=", ".join(sorted(LAWS)))
        made = LAWS[self.name]
        names = [spec.name for spec in made.PARAMETERS]
        unknown = sorted(set(self.parameters) - set(names))
        missing = [name for name in names if name not in self.parameters]
        if unknown or missing:
            what = f"has no constant {unknown[0]}" if unknown else f"needs the constant {missing[0]}"
            raise f.problem(
                f'are not those of the law: "{self.name}" {what}', key="parameters", allowed=", ".join(names)
            )
        values = [_law_constant(spec.name, self.parameters[spec.name], spec.unit) for spec in made.PARAMETERS]
        try:
            law = made.of(values)
        except ValueError as error:
            raise f.problem(f"make no law: {error}", key="parameters") from None
        found = not_positive(law)
        if found is not None:
            raise f.problem(
                f"give an energy that is not positive in {found[0]} at the stretch {found[1]:.3g}",
                key="parameters",
                allowed="energies > 0 at stretches of 0.2 to 5",
                cure="fit with bounds, or choose a law with fewer constants",
            )
        lam = self._end
        return replace(law, fitted_s=abs(lam - 1.0) * float(np.sqrt((lam + 2.0) / lam)))

    @property
    def _end(self) -> float:
        """Stretch at the end of the data [-]."""
        return 1.0 - self.largest_strain if self.branch == "compression" else 1.0 + self.largest_strain

    def curve(self) -> MaterialCurve:
        """The uniaxial curve of the law, incompressible, with one uncertainty common to all points."""
        lam = np.linspace(1.0, self._end, BASELINE_POINTS)
        slope, side, _ = self.law.principal(lam, lam**-0.5, lam**-0.5)
        stress = slope - side * lam**-1.5
        stress[0] = 0.0  # at rest, to the last bit
        return MaterialCurve(
            stretch=lam,
            stress=stress,
            sigma=np.zeros(BASELINE_POINTS),
            modes=self.relative_sigma * stress[None, :],
            law=self.law,
        )


def _law_constant(name: str, value: object, unit: str) -> float:
    """A constant in SI: a quantity with its unit, or a plain number if it has none."""
    if unit == "1" and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    try:
        return quantity(value, unit)  # type: ignore[arg-type]  # it refuses what is no text
    except UnitError as error:
        example = '"12.5 kPa"' if unit == "Pa" else "2.5"
        raise f.problem(
            f"hold no value of {name}: {value!r} {error.problem}",
            key="parameters",
            cure=f"write {name} = {example}",
        ) from None


def one_baseline(curve: object, law: LawSection | None) -> None:
    """Check that a file declares [curve] or [law], and with both which of them is the baseline."""
    if curve is None and law is None:
        raise f.problem(
            "is missing", key="curve", cure="add [curve] with a quasi-static test, or [law] with a fitted law"
        )
    if curve is not None and law is not None and "baseline" not in law.model_fields_set:
        raise f.problem(
            "is given, and so is [curve]",
            key="law",
            cure="name the baseline: write baseline = true in [law], or false if the curve counts",
        )
    if curve is None and law is not None and not law.baseline:
        raise f.problem(
            "is false, but there is no [curve] that would be the baseline",
            key="law.baseline",
            cure="remove it, or add [curve]",
        )


class CurveSection(Section):
    """[curve]: the quasi-static uniaxial curve."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    strain: RatioColumn
    stress: StressColumn
    convention: Literal["tension positive", "compression positive"]
    branch: Literal["compression", "tension"]
    relative_sigma: f.Share = 0.0
    sigma_floor: f.Stress = 0.0
    sigma: StressColumn | None = None
    modes: ModeColumns | None = None
    conditioned: f.FileName | None = None
    strain_rate: f.StrainRate | None = None

    @model_validator(mode="after")
    def _some_sigma(self) -> "CurveSection":
        columns = self.sigma is not None or self.modes is not None
        if "relative_sigma" not in self.model_fields_set and not columns:
            raise f.problem(
                "is missing",
                key="relative_sigma",
                cure='write the noise of the quasi-static test, e.g. "0.2 %"',
            )
        if self.relative_sigma == 0.0 and self.sigma_floor == 0.0 and not columns:
            raise f.problem(
                "is zero and so is sigma_floor, as if the curve had no uncertainty",
                key="relative_sigma",
                cure='write the noise of the quasi-static test, e.g. "0.2 %"',
            )
        return self


def chosen_baseline(curve: CurveSection | None, law: LawSection | None) -> CurveSection | LawSection:
    """[law] if it is declared and is the baseline, otherwise [curve]. `one_baseline` has checked both."""
    if law is not None and law.baseline:
        return law
    assert curve is not None  # checked by the schema
    return curve


_PRONY = ("strengths", "times", "sigma_strengths", "sigma_times")
_CONSTANTS = ("ratio", "resistance", "exponent", "chain_exponent", "first_creep")
_NETWORK = (*_CONSTANTS, "sigma_ratio", "sigma_resistance")
_EXAMPLES = {"strengths": "[0.3]", "times": '["400 us"]', "ratio": "0.5", "resistance": '"10 kPa"'}


def _branches(
    entry: Callable[[object], float], what: str, cure: str
) -> Callable[[object], tuple[float, ...]]:
    """A validator for a list with one entry per branch."""

    def validate(values: object) -> tuple[float, ...]:
        if not isinstance(values, list | tuple) or not 1 <= len(values) <= MOST_BRANCHES:
            raise f.problem(f"is not a list of 1 to 3 {what}", cure=cure)
        return tuple(entry(value) for value in values)

    return validate


_Numbers = Annotated[
    tuple[float, ...], BeforeValidator(_branches(f.number, "numbers", "write e.g. [0.3], a number a branch"))
]
_Times = Annotated[
    tuple[float, ...],
    BeforeValidator(_branches(f.seconds, "times", 'write e.g. ["400 us"], a time a branch')),
]


class RelaxationSection(Section):
    """[relaxation]: a Prony series or the network of Bergstrom and Boyce, relative to the long-term law."""

    kind: Literal["prony", "bergstrom_boyce"]
    free: bool = False
    strengths: _Numbers | None = None
    times: _Times | None = None
    sigma_strengths: _Numbers | None = None
    sigma_times: _Times | None = None
    ratio: f.Number | None = None
    resistance: f.Stress | None = None
    exponent: f.Number | None = None
    chain_exponent: f.Number | None = None
    first_creep: f.Number | None = None
    sigma_ratio: f.Number | None = None
    sigma_resistance: f.Stress | None = None

    @model_validator(mode="after")
    def _complete(self) -> "RelaxationSection":
        own, other = (_PRONY, _NETWORK) if self.kind == "prony" else (_NETWORK, _PRONY)
        kind = f'kind = "{self.kind}"'
        self.without(other, f"{kind} does not have it", f"remove it; the keys here are {', '.join(own)}")
        for name in own[:2]:
            if getattr(self, name) is None:
                raise f.problem(
                    f"is missing; {kind} needs it, free or not: a search starts there",
                    key=name,
                    cure=f"add e.g. {name} = {_EXAMPLES[name]}",
                )
        if self.kind == "prony":
            self.alike(("times", "sigma_strengths", "sigma_times"), "strengths", "give one a branch")
        self._possible()
        return self

    def _possible(self) -> None:
        """Check the constants by the laws of the solver, and check the uncertainties."""
        from explicit.relaxation import relaxation_of

        record = self.declared()
        try:
            relaxation_of(record.kind, list(record.values.values()))
        except ValueError as error:
            key = "strengths" if "strength" in str(error) else "times"
            if record.kind != "prony":
                key = next((name for name in _CONSTANTS if str(error).startswith(name)), "ratio")
            raise f.problem(f"is not allowed: {error}", key=key) from None
        for name, sigma in record.sigmas.items():
            if not sigma >= 0.0:
                raise f.problem(
                    f"is not allowed: the standard uncertainty of {name} is {sigma:g}",
                    allowed=">= 0",
                    cure="write 0 for a constant that is exact",
                )

    def declared(self) -> Relaxation:
        """The record for a shot."""
        if self.kind == "prony":
            strengths, times = self.strengths or (), self.times or ()
            names = prony_names(len(strengths))
            sigmas: dict[str, float] = {}
            if self.sigma_strengths is not None:
                sigmas |= zip(names, self.sigma_strengths, strict=False)
            if self.sigma_times is not None:
                sigmas |= zip(names[len(strengths) :], self.sigma_times, strict=False)
            return Relaxation("prony", dict(zip(names, (*strengths, *times), strict=True)), sigmas, self.free)
        given = {
            "creep_ratio": self.ratio,
            "creep_resistance": self.resistance,
            "creep_exponent": self.exponent,
            "creep_chain_exponent": self.chain_exponent,
            "creep_first": self.first_creep,
        }
        values = {name: NETWORK_DEFAULTS[name] if x is None else x for name, x in given.items()}
        own = {"creep_ratio": self.sigma_ratio, "creep_resistance": self.sigma_resistance}
        sigmas = {name: sigma for name, sigma in own.items() if sigma is not None}
        return Relaxation("bergstrom_boyce", values, sigmas, self.free)


def declared_relaxation(
    section: RelaxationSection | None, uncertainty: UncertaintySection | None
) -> dict[str, Any]:
    """Fields `relaxation` and `uncertainty` of a shot; the latter includes the sigmas of the constants."""
    known = {} if uncertainty is None else uncertainty.for_identify()
    if section is None:
        return {"relaxation": None, "uncertainty": known}
    record = section.declared()
    return {"relaxation": record, "uncertainty": {**known, **record.sigmas}}

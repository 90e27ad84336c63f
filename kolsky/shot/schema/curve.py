"""[curve] and [law] of shot.toml: the quasi-static test or fitted law that the stiffness refers to."""

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import model_validator

from kolsky.base.records import MaterialCurve
from kolsky.base.units import UnitError, quantity
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import ModeColumns, RatioColumn, Section, StressColumn, TextLayoutSection

if TYPE_CHECKING:
    import explicit.materials

POINTS = 41
"""Points of the curve that stands for the law where one is drawn or counted, rest included."""


class LawSection(Section):
    """[law]: name and constants of a law, how far its data went, and how well its stress is known."""

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
        """The law, which knows how far the data of its constants went."""
        from explicit.materials import LAWS
        from explicit.materials.positive import not_positive

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
        values = [_constant(spec.name, self.parameters[spec.name], spec.unit) for spec in made.PARAMETERS]
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
        """The law's own uniaxial curve, incompressible, with one uncertainty that all its points share."""
        lam = np.linspace(1.0, self._end, POINTS)
        slope, side, _ = self.law.principal(lam, lam**-0.5, lam**-0.5)
        stress = slope - side * lam**-1.5
        stress[0] = 0.0  # at rest, to the last bit
        return MaterialCurve(
            stretch=lam,
            stress=stress,
            sigma=np.zeros(POINTS),
            modes=self.relative_sigma * stress[None, :],
            law=self.law,
        )


def _constant(name: str, value: object, unit: str) -> float:
    """A constant in SI: a quantity with its unit, or a plain number where it has none."""
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
    """Refuse a file that says nothing of the quasi-static material, or two things and not which counts.

    Raises
    ------
    pydantic_core.PydanticCustomError
        If there is neither [curve] nor [law], or both and [law] does not say whether it is the baseline.
    """
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
    """[law] if it is there and is the baseline, else [curve]; `law.one_baseline` has seen both."""
    if law is not None and law.baseline:
        return law
    assert curve is not None  # the schema saw to it
    return curve

"""[curve] of shot.toml: the quasi-static test that the stiffness is compared with."""

from typing import Literal

from pydantic import model_validator

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.columns import ModeColumns, RatioColumn, StressColumn
from kolsky.shot.schema.law import LawSection
from kolsky.shot.schema.section import Section


class CurveSection(Section):
    """[curve]: the quasi-static uniaxial curve."""

    file: f.FileName
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

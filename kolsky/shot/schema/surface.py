"""[surface] of shot.toml: the exports of a DIC program, and where its axes lie in the test."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, model_validator

from kolsky.readers.dic_export.layouts import LAYOUTS
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section

Axis = Literal["+X", "-X", "+Y", "-Y", "+Z", "-Z"]


def _place(values: object) -> tuple[float, float, float]:
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise f.problem("is not a place", cure='write three lengths, e.g. ["0 mm", "-3.2 mm", "0 mm"]')
    x, y, z = (f.length(text) for text in values)
    return x, y, z


def _program(name: object) -> str:
    if name not in LAYOUTS:
        raise f.problem("is not known", allowed="one of " + ", ".join(f'"{known}"' for known in LAYOUTS))
    return str(name)


class FlyerAreaSection(Section):
    """[surface.flyer]: the export of an area on the flyer."""

    pattern: f.FilePattern
    sigma: f.Length


class SurfaceSection(Section):
    """[surface]: the specimen's surface, one file a frame."""

    pattern: f.FilePattern
    program: Annotated[str, BeforeValidator(_program)]
    unit: Literal["m", "mm", "um", "µm", "in"] = "mm"
    delimiter: str | None = None
    decimal: str | None = None
    y: Axis
    Z: Axis
    frame: Literal["declared", "cylinder"]
    origin: Annotated[tuple[float, float, float], BeforeValidator(_place)]
    half_width: f.Length
    sigma: f.Length
    flyer: FlyerAreaSection | None = None

    @model_validator(mode="after")
    def _two_axes(self) -> "SurfaceSection":
        if self.y[1] == self.Z[1]:
            raise f.problem(
                "is the axis of y too",
                key="Z",
                allowed=f"another axis than {self.y[1]}",
                cure="they are across",
            )
        return self

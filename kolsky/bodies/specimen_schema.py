"""SPEC.toml: a material and the slow tests of whole specimens to which it is fitted."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.schema import fields as f
from kolsky.schema.fields import ColumnSection, LengthColumn, Section, TextLayoutSection

ForceDeviation = Annotated[float, BeforeValidator(f.physical("N", "> 0", "a standard deviation"))]
Acceleration = Annotated[float, BeforeValidator(f.number)]


class ForceColumn(ColumnSection):
    """A column of forces."""

    unit: Annotated[float, BeforeValidator(f.factor("N"))]


class MaterialSection(Section):
    """[material]: a law, its constants, and the names of the fitted ones."""

    law: f.Name
    constants: dict[str, Any]
    poisson: f.Poisson
    free: Annotated[list[f.Name], Field(min_length=1)]
    density: f.Density | None = None

    @model_validator(mode="after")
    def _known(self) -> "MaterialSection":
        from kolsky.bodies.specimen_constants import constants_of

        try:
            specs = constants_of(self.law)
        except ValueError as error:
            raise f.problem(f"is not known: {error}", key="law") from None
        names = [spec.name for spec in specs]
        for name in self.free:
            if name not in names:
                raise f.problem(
                    f"names {name!r}, which the law does not have", key="free", allowed=", ".join(names)
                )
        return self


class NumericsSection(Section):
    """[numerics]: the elements."""

    element: Literal["hex27", "hex8"] = "hex27"


class TestSection(Section):
    """[tests.NAME]: a specimen, its supports, and its measurements."""

    shape: Literal["strip", "dog_bone", "cross", "block", "mesh"] = "strip"
    load: Literal["axial", "shear"] = "axial"
    size: Annotated[list[f.Length], Field(min_length=3, max_length=3)] | None = None
    bond: f.Length | None = None
    elements: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=3, max_length=3)] | None = None
    mesh: f.FileName | None = None
    mesh_unit: f.LengthUnit | None = None
    moving: f.Name | None = None
    fixed: f.Name | None = None
    axis: Literal["x", "y", "z"] = "x"
    frictionless: bool = False
    sphere: f.Length | None = None
    arm: f.Length | None = None
    waist: f.Length | None = None
    straight: f.Length | None = None
    gravity: Annotated[list[Acceleration], Field(min_length=3, max_length=3)] | None = None
    file: f.FileName | None = None
    layout: TextLayoutSection | None = None
    displacement: LengthColumn | list[LengthColumn] | None = None
    force: ForceColumn | list[ForceColumn] | None = None
    samples: Annotated[int, Field(ge=4, le=400)] = 20
    stroke: f.Length | None = None
    sigma_force: ForceDeviation
    sigma_displacement: f.LengthDeviation = 0.0

    @model_validator(mode="after")
    def _of_the_shape(self) -> "TestSection":
        only = {"arm": "cross", "waist": "dog_bone", "straight": "dog_bone", "sphere": "mesh"}
        only |= dict.fromkeys(("mesh", "mesh_unit", "moving", "fixed"), "mesh")
        only |= dict.fromkeys(("size", "elements"), "no mesh")
        meshed, sheared = self.shape == "mesh", self.load == "shear"
        for key, shape in only.items():
            belongs = self.shape == shape or (shape == "no mesh" and not meshed)
            optional = key == "sphere" and belongs
            if not optional and (getattr(self, key) is not None) != belongs:
                problem = "is missing" if belongs else f'has no effect on a "{self.shape}"'
                home = "every other shape" if shape == "no mesh" else f'shape = "{shape}"'
                raise f.problem(problem, key=key, cure=f"it belongs to {home}")
        for key in ("displacement", "force") if self.file is not None else ():
            given = getattr(self, key) is not None
            wrong = given and len(self.columns(key)) != self.ends
            f.reject(
                (not given, key, "is missing", 'write e.g. { column = "force", unit = "N" }'),
                (wrong, key, f"must name {self.ends} column(s)", "a cross has one an axis"),
            )
        glued, slides = meshed or self.shape == "block", self.frictionless and self.sphere is not None
        planned = self.file is not None or self.stroke is not None
        f.reject(
            (not planned, "file", "is missing", 'add the file of the test, or stroke = "60 mm" to plan one'),
            (slides, "sphere", "slides without friction", "remove the key frictionless"),
            (self.bond is not None and glued, "bond", f'has no effect on a "{self.shape}"', "remove it"),
            (self.bond is None and not glued, "bond", "is missing", 'write e.g. "10 mm"'),
            (sheared and self.shape != "block", "load", 'is "shear"', 'it belongs to shape = "block"'),
        )
        if self.size is not None and self.bond is not None and 2.0 * self.bond >= self.size[0]:
            raise f.problem("leaves no free length", key="bond", allowed=f"below {0.5 * self.size[0]:g} m")
        return self

    @property
    def ends(self) -> int:
        """Number of independent moving ends: 2 for a cross, otherwise 1."""
        return 2 if self.shape == "cross" else 1

    def columns(self, key: str) -> list[ColumnSection]:
        """Columns of the displacement or the force, one for each end."""
        found = getattr(self, key)
        return found if isinstance(found, list) else [found]


class PointsSection(Section):
    """[field.points]: the measured displacements, one row per frame and point."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    frame: f.Name = "frame"
    x: LengthColumn
    y: LengthColumn
    ux: LengthColumn
    uy: LengthColumn
    gate: Annotated[float, Field(gt=2.0, le=100.0)] = 6.0
    gated: bool = True


class PadSection(Section):
    """[field.pad]: displacement and force of the moving pad, one row per frame."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    frame: f.Name = "frame"
    displacement: LengthColumn
    force: ForceColumn


class RegionSection(Section):
    """[field.regions.NAME]: another material of the sheet, with the same law and other constants."""

    constants: dict[str, Any]
    poisson: f.Poisson
    free: list[f.Name] = Field(default_factory=list)


Groups = Annotated[
    list[f.Name],
    Field(min_length=1),
    BeforeValidator(lambda given: [given] if isinstance(given, str) else given),
]
"""One group of a mesh, or a list of them."""


class FieldSection(Section):
    """[field]: a sheet pulled between two pads, its displacement field and the force on a pad."""

    mesh: f.FileName
    mesh_unit: f.LengthUnit
    thickness: f.Length
    kinematics: Literal["plane_stress", "plane_strain"]
    moving: Groups
    fixed: Groups
    axis: Literal["x", "y"] = "x"
    relative_to: Literal["fixed_pad", "camera"] = "fixed_pad"
    points: PointsSection
    pad: PadSection
    frames: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1)]
    sigma_displacement: f.LengthDeviation | None = None
    sigma_force: ForceDeviation
    region: f.Name | None = None
    regions: dict[f.Name, RegionSection] = Field(default_factory=dict)


class FitSection(Section):
    """[fit]: the tests that are fitted together, and the number of starts."""

    together: dict[str, list[f.Name]] = Field(default_factory=dict)
    starts: Annotated[int, Field(ge=1, le=50)] = 1
    seed: Annotated[int, Field(ge=0)] = 1


class PlanSection(Section):
    """[plan]: the constants of interest, and the shapes to compare."""

    wanted: list[f.Name] = Field(default_factory=list)
    compare: Annotated[list[list[f.Name]], Field(min_length=1)] | None = None


class SpecimenFile(Section):
    """A whole SPEC.toml."""

    NEW: ClassVar[str] = "kolsky specimen new"
    material: MaterialSection
    numerics: NumericsSection = Field(default_factory=NumericsSection)
    tests: dict[str, TestSection] = Field(default_factory=dict)
    field: FieldSection | None = None
    fit: FitSection = Field(default_factory=FitSection)
    plan: PlanSection = Field(default_factory=PlanSection)

    @model_validator(mode="after")
    def _something_to_fit(self) -> "SpecimenFile":
        both = bool(self.tests) and self.field is not None
        nothing = not self.tests and self.field is None
        f.reject(
            (nothing, "tests", "is missing", "add [tests.NAME], or [field] for a sheet"),
            (both, "field", "is given beside [tests]", "fit each from a separate file"),
        )
        named = [("fit.together", names) for names in self.fit.together.values()]
        named += [("plan.compare", names) for names in self.plan.compare or []]
        for key, names in named:
            for name in names:
                if name not in self.tests:
                    raise f.problem(f"names {name!r}", key=key, allowed=", ".join(self.tests))
        for name, test in self.tests.items():
            if test.gravity is not None and self.material.density is None:
                raise f.problem("is missing", key="material.density", cure=f"[tests.{name}] has gravity")
        return self

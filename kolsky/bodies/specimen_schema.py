"""SPEC.toml: a material and the slow tests of whole specimens to which it is fitted."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.schema import fields as f
from kolsky.schema.fields import ColumnSection, LengthColumn, Section, TextLayoutSection

ForceDeviation = Annotated[float, BeforeValidator(f.physical("N", "> 0", "a standard deviation"))]
Displacement = Annotated[float, BeforeValidator(f.physical("m"))]
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
    apex: Annotated[list[Displacement], Field(min_length=3, max_length=3)] | None = None
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
        only = {"arm": "cross", "waist": "dog_bone", "straight": "dog_bone"}
        only |= dict.fromkeys(("mesh", "mesh_unit", "moving", "fixed", "sphere", "apex"), "mesh")
        for key, shape in only.items():
            optional = key in ("sphere", "apex") and self.shape == shape
            if not optional and (getattr(self, key) is not None) != (self.shape == shape):
                problem = "is missing" if self.shape == shape else f'has no effect on a "{self.shape}"'
                raise f.problem(problem, key=key, cure=f'it belongs to shape = "{shape}"')
        if self.file is None and self.stroke is None:
            raise f.problem(
                "is missing", key="file", cure='add the file of the test, or stroke = "60 mm" to plan one'
            )
        if self.file is not None:
            for key in ("displacement", "force"):
                if getattr(self, key) is None:
                    raise f.problem("is missing", key=key, cure='write e.g. { column = "force", unit = "N" }')
                if len(self.columns(key)) != self.ends:
                    raise f.problem(
                        f"must name {self.ends} column(s)", key=key, cure="a cross has one an axis"
                    )
        if self.shape == "mesh":
            return self._of_a_mesh()
        for key in ("size", "elements"):
            if getattr(self, key) is None:
                raise f.problem("is missing", key=key, cure='write three of it, or shape = "mesh"')
        if (self.bond is None) != (self.shape == "block"):
            problem = "has no effect on a block, whose end faces are glued" if self.bond else "is missing"
            raise f.problem(problem, key="bond", cure="remove it" if self.bond else 'write e.g. "10 mm"')
        if self.load == "shear" and self.shape != "block":
            raise f.problem('is "shear"', key="load", cure='it belongs to shape = "block"')
        length = 0.0 if self.size is None else self.size[0]
        if self.bond is not None and 2.0 * self.bond >= length:
            raise f.problem("leaves no free length", key="bond", allowed=f"below {0.5 * length:g} m")
        return self

    def _of_a_mesh(self) -> "TestSection":
        """Reject keys that belong to other shapes."""
        given = [key for key in ("size", "elements", "bond") if getattr(self, key) is not None]
        if self.load == "shear":
            given.append("load")
        if given:
            cure = "remove it; axis, moving and fixed say how the body is loaded"
            raise f.problem('has no effect on shape = "mesh"', key=given[0], cure=cure)
        if self.apex is not None and self.sphere is None:
            raise f.problem(
                "has no effect without a sphere", key="apex", cure='add sphere = "5 mm", its radius'
            )
        if self.frictionless and self.sphere is not None:
            raise f.problem("slides without friction", key="sphere", cure="remove the key frictionless")
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
        if not self.tests and self.field is None:
            raise f.problem("is missing", key="tests", cure="add [tests.NAME], or [field] for a sheet")
        if self.tests and self.field is not None:
            raise f.problem("is given beside [tests]", key="field", cure="fit each from a separate file")
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

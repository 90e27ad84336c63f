"""A shot whose bars are its only instruments: bar waves drive the simulation, and the force identifies."""

from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, model_validator

from kolsky.bars.reduction.analyse import analyse
from kolsky.base.apparatus import Bar, Interface, Specimen
from kolsky.base.errors import InputError
from kolsky.shot.bar_waves import bar_force, driven_by_waves
from kolsky.shot.bars import load_waves
from kolsky.shot.curve import read_curve
from kolsky.shot.find import find_shot_file
from kolsky.shot.records import ModelSettings, Shot, ShotBase
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.apparatus import InterfaceSection, ModelSection, SpecimenSection, WindowSection
from kolsky.shot.schema.curve import CurveSection, chosen_baseline
from kolsky.shot.schema.law import LawSection, one_baseline
from kolsky.shot.schema.reading import read_declared
from kolsky.shot.schema.section import Section
from kolsky.shot.schema.uncertainty import UncertaintySection


class BarDrivenShotFile(Section):
    """What `identify` needs of a shot.toml beside bars and gauges; those are `kolsky.shot.schema.bars`'s."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    format: Literal[1]
    name: f.Name | None = None
    specimen: SpecimenSection
    interface: InterfaceSection
    curve: CurveSection | None = None
    law: LawSection | None = None
    model: ModelSection
    window: WindowSection = WindowSection()
    uncertainty: UncertaintySection = UncertaintySection()

    @model_validator(mode="after")
    def _one_baseline(self) -> "BarDrivenShotFile":
        one_baseline(self.curve, self.law)
        return self


def load_bar_driven(folder_or_toml: str | Path) -> Shot:
    """Reduce the gauges of a shot and make it ready for `identify`.

    Parameters
    ----------
    folder_or_toml
        The shot's folder with its shot.toml, or the path of such a file.

    Returns
    -------
    Shot
        Without a centre line: the force alone identifies.

    Raises
    ------
    InputError
        If a file is missing or damaged, a declaration is impossible, or the signals hold no such test.
    """
    file, declared = read_declared(find_shot_file(Path(folder_or_toml)), lambda content: BarDrivenShotFile)
    given = load_waves(folder_or_toml)
    folder = file.path.parent
    curve, curve_hashes = read_curve(folder, chosen_baseline(declared.curve, declared.law))
    if declared.window.start is not None:
        raise file.error(
            "window.start",
            "has no effect where bar waves drive the test: it begins with their arrival",
            cure="remove it",
        )
    try:
        result = analyse(given)
        base = ShotBase(
            name=given.name,
            folder=folder,
            specimen=Specimen(**declared.specimen.model_dump()),
            interface=Interface(
                faces=declared.interface.faces,
                side=declared.interface.side,
                friction=declared.interface.friction or 0.0,
                release_stress=declared.interface.release_stress or 0.0,
            ),
            support="bar",
            transmission_bar=Bar(**vars(given.bars["transmission"])),
            model=ModelSettings(**declared.model.model_dump()),
            force=bar_force(result.reduction, result.faces),
            curve=curve,
            inputs={**given.inputs, **curve_hashes},
            uncertainty=declared.uncertainty.for_identify(),
        )
        return driven_by_waves(base, result.reduction, result.faces, end=declared.window.end)
    except ValueError as error:
        raise InputError(folder, str(error)) from error

"""`kolsky actuator invert`: pressures for wanted bends."""

from time import perf_counter

from kolsky.cli import texts
from kolsky.cli.actuator_simulate import ActuatorPath, OutOfActuator
from kolsky.cli.options import AsJson, Device, Figures


def actuator_invert(
    spec: ActuatorPath,
    out: OutOfActuator = None,
    device: Device = "cpu",
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Find the pressures for the bends of `invert`, by Newton's method on the exact slope of the bend.

    Separate chambers have a pressure each, found by bounded least squares with a wanted tip. Writes
    actuator.html and actuator.json.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.actuator.inverse import Inversion, Reached, pressure_for, pressures_for
    from kolsky.actuator.output import inversions_json
    from kolsky.actuator.reading import read_actuator
    from kolsky.base.files import usable_folder
    from kolsky.cli.actuator_result import write_result
    from kolsky.report.actuator_view import ActuatorView

    read = read_actuator(spec, device=device)
    section = read.declared.invert
    if section is None:
        raise read.toml.error("invert", "is missing", cure='add [invert] with angles = ["20 deg"] and most')
    folder = usable_folder(out or read.toml.path.with_suffix("") / "invert")
    found: dict[str, list[Inversion]] = {}
    for name, g in read.gravities.items():
        found[name] = []
        for angle in section.angles:
            if len(read.actuator.cavities) == 1 and section.tip is None:
                one = pressure_for(read.actuator, g, angle, most=section.most)
            else:
                one = pressures_for(read.actuator, g, angle=angle, tip=section.tip, most=section.most)
            found[name].append(one)
    warnings = [
        f"{name}: the pressure for {57.29577951308232 * one.angle:.4g}° is not a solution: {one.ended.value}"
        for name, each in found.items()
        for one in each
        if one.ended is not Reached.YES
    ]
    view = ActuatorView(read.name, inversions=found, warnings=warnings)
    said = inversions_json(found, read.inputs)
    write_result(folder, view, said, read.inputs, formats=formats, as_json=as_json, started=started)

"""`kolsky specimen plan`: which slow tests, and which shapes, would tell most of the constants."""

from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.cli import texts
from kolsky.cli.options import AsJson, Device
from kolsky.cli.specimen_fit import OutOfSpec, SpecPath

if TYPE_CHECKING:
    from kolsky.specimen.planning import Expected
    from kolsky.specimen.reading import Specification


def specimen_plan(
    spec: SpecPath,
    out: OutOfSpec = None,
    wanted: Annotated[
        str,
        typer.Option(metavar="NAMES", help="Constants that count.", show_default="those of the SPEC, or all"),
    ] = "",
    device: Device = "cpu",
    as_json: AsJson = False,
) -> None:
    """Compare the tests of a SPEC before they are made, alone and together, by the intervals they would give.

    Every test is simulated once at the declared constants; no data are needed. Shapes to compare are tests
    of one SPEC. Of a sheet, field and force are compared alone and together; its points and the motion of its
    pad are those of the SPEC's files. Writes plan.csv and plan.json.
    """
    started = perf_counter()
    import json

    from kolsky.base.files import filling, usable_folder
    from kolsky.cli.terminal import print_result, since
    from kolsky.report import numbers
    from kolsky.specimen import output
    from kolsky.specimen.reading import read_specification

    read = read_specification(spec, device=device)
    folder = usable_folder(out or read.toml.path.with_suffix("") / "plan")
    free = read.constants.free
    asked = texts.listed(wanted) or tuple(read.declared.plan.wanted)
    for name in asked:
        if name not in free:
            raise read.toml.error("plan.wanted", f"names {name!r}", allowed=", ".join(free))
    found = _sheet(read, asked) if read.declared.field is not None else _tests(read, asked)
    said = output.plan_json(found, free)
    with filling(folder) as partial:
        output.write_plan(partial, found, free)
        text = json.dumps(said, indent=2, allow_nan=False)
        (partial / "plan.json").write_text(text, encoding="utf-8")
    rows = {
        " + ".join(one.tests): ", ".join(
            f"{name} ± {numbers.percent(float(value))}"
            for name, value in zip(free, one.relative, strict=True)
        )
        for one in found
    }
    print_result(rows, said if as_json else None, rest={"folder": folder, "wall time": since(started)})


def _sheet(read: "Specification", asked: tuple[str, ...]) -> "list[Expected]":
    from kolsky.specimen.field_reading import read_field
    from kolsky.specimen.sheet_simulation import plan_sheet

    try:
        return plan_sheet(read_field(read).problem, wanted=asked)
    except ValueError as error:
        raise read.toml.error("field", f"cannot be simulated: {error}") from None


def _tests(read: "Specification", asked: tuple[str, ...]) -> "list[Expected]":
    from kolsky.specimen.planning import plan, slopes

    choices = read.declared.plan.compare or [[name] for name in read.models]
    used = list(dict.fromkeys(name for choice in choices for name in choice))
    noise = {
        name: (read.declared.tests[name].sigma_displacement, read.declared.tests[name].sigma_force)
        for name in used
    }
    try:
        whitened, forces, _ = slopes(
            {name: read.models[name] for name in used},
            {name: read.schedule(name) for name in used},
            noise,
            read.constants,
        )
    except ValueError as error:
        raise read.toml.error("tests", f"cannot be simulated: {error}") from None
    return plan(choices, whitened, forces, read.constants, wanted=asked)

"""`kolsky specimen simulate`: force curves of whole specimens with declared constants."""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.cli.options import AsJson, Device
from kolsky.cli.specimen_fit import OutOfSpec, SpecPath

if TYPE_CHECKING:
    from kolsky.specimen.reading import Specification


def specimen_simulate(
    spec: SpecPath,
    out: OutOfSpec = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, help="Add noise of the declared sizes, drawn with this seed.", show_default="none"
        ),
    ] = None,
    vtu: Annotated[bool, typer.Option("--vtu", help="Also write the last sample for ParaView.")] = False,
    device: Device = "cpu",
    as_json: AsJson = False,
) -> None:
    """Simulate the tests of a SPEC with its constants: force curves, strains by volume; a sheet's field.

    Writes a CSV file a test, or points.csv and pad.csv of a sheet, which the SPEC can name as its files: data
    whose constants are known. A sheet's points and the motion of its pad are those of the SPEC's files.
    """
    started = perf_counter()
    from kolsky.base.files import filling, usable_folder, write_table
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.specimen_folder import write_solution_vtu
    from kolsky.report.specimen_view import BINS, strain_share
    from kolsky.specimen.reading import read_specification
    from kolsky.specimen.simulation import simulate_tests

    read = read_specification(spec, device=device)
    folder = usable_folder(out or Path(read.toml.path.with_suffix("")) / "simulated")
    if read.declared.field is not None:
        _simulate_sheet(read, folder, started, seed=seed, vtu=vtu, as_json=as_json)
        return
    try:
        made = simulate_tests(read, seed=seed)
    except ValueError as error:
        raise read.toml.error("tests", f"cannot be simulated: {error}") from None
    with filling(folder) as partial:
        for name, one in made.items():
            write_table(partial / f"{name}.csv", one.columns)
            share = strain_share(name, one.solution, read.models[name].shape.mid_region())
            columns = {"strain from (1)": BINS[:-1], "strain to (1)": BINS[1:]}
            for part, values in (("whole", share.whole), ("middle", share.middle)):
                columns |= {f"share along {a}, {part} (1)": v for a, v in zip("xyz", values, strict=True)}
            write_table(partial / f"{name}_strains.csv", columns)
            if vtu:
                write_solution_vtu(partial / f"{name}.vtu", one.solution)
    rows = {
        name: f"{len(one.force)} samples to {1e3 * one.displacement.max():.4g} mm, "
        f"{one.force[-1].max():.5g} N"
        for name, one in made.items()
    }
    said = {
        name: {"displacement_m": one.displacement.tolist(), "force_N": one.force.tolist()}
        for name, one in made.items()
    }
    print_result(rows, said if as_json else None, rest={"folder": folder, "wall time": since(started)})


def _simulate_sheet(
    read: "Specification", folder: Path, started: float, *, seed: int | None, vtu: bool, as_json: bool
) -> None:
    from kolsky.base.errors import InputError
    from kolsky.base.files import filling, write_table
    from kolsky.cli import texts
    from kolsky.cli.terminal import print_result, since
    from kolsky.specimen.field_reading import read_field
    from kolsky.specimen.sheet_simulation import simulate_sheet

    if vtu:
        raise InputError(texts.COMMAND_LINE, "is for force curves", key="--vtu", cure="remove it")
    try:
        made = simulate_sheet(read_field(read), seed=seed)
    except ValueError as error:
        raise read.toml.error("field", f"cannot be simulated: {error}") from None
    with filling(folder) as partial:
        write_table(partial / "points.csv", made.point_columns)
        write_table(partial / "pad.csv", made.pad_columns)
    rows = {
        "points": f"{len(made.points)} in {len(made.frames)} frames",
        "pad": f"to {1e3 * abs(made.pad[-1]):.4g} mm, {made.force[-1]:.5g} N",
    }
    said = {"pad_m": made.pad.tolist(), "force_N": made.force.tolist()}
    print_result(rows, said if as_json else None, rest={"folder": folder, "wall time": since(started)})

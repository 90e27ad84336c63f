"""`kolsky repeats`: several tests of one kind to their mean curve with its band."""

from collections.abc import Sequence
from pathlib import Path

from kolsky.bars.records import Reduction
from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.reduction.repeated_tests import repeated_tests
from kolsky.base.errors import InputError
from kolsky.base.files import filling, usable_folder, write_table
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import tell
from kolsky.report.formats import FIGURES
from kolsky.shot.bars import load_waves
from kolsky.shot.schema.reading import folder_of

FEWEST = 2


def repeats(shots: Sequence[Path], *, out: Path, formats: Sequence[str], as_json: bool) -> None:
    """Reduce each test, average their stress over strain, write and print.

    Parameters
    ----------
    shots
        Shots' folders, or their shot.toml files.
    out
        Where results go.
    formats
        Also save the figure, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If there are fewer than two shots, two have one name, or one cannot be used or results written.
    """
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    if len(shots) < FEWEST:
        raise InputError(
            options.COMMAND_LINE,
            f"got {len(shots)} shot, the scatter between tests needs {FEWEST} or more",
            cure="name all repeats of the test",
        )
    folder = usable_folder(out)
    given = [load_waves(shot) for shot in shots]  # bad input is refused before any work
    found: dict[str, Reduction] = {}
    with bars() as progress:
        for number, (shot, one) in enumerate(zip(shots, given, strict=True)):
            progress("repeats", number, len(shots))
            if one.name in found:
                raise InputError(
                    folder_of(shot), f"another shot is called {one.name!r} too", cure="give each its own name"
                )
            try:
                found[one.name] = analyse(one).reduction
            except ValueError as error:
                raise InputError(folder_of(shot), str(error)) from error
        progress("repeats", len(shots), len(shots))
    try:
        mean = repeated_tests(found)
    except ValueError as error:
        raise InputError(options.COMMAND_LINE, str(error)) from error
    low, high = mean.band()
    together = mean.repeats
    with filling(folder) as partial:
        write_table(
            partial / "repeats.csv",
            {
                "strain (1)": together.axis.tolist(),
                "mean stress (Pa)": together.mean.tolist(),
                "low end of the 95 % band (Pa)": low.tolist(),
                "high end of the 95 % band (Pa)": high.tolist(),
                "scatter between tests (Pa)": together.scatter.tolist(),
                "shared standard uncertainty (Pa)": mean.shared.tolist(),
                **{f"{name} (Pa)": row.tolist() for name, row in zip(found, together.values, strict=True)},
            },
        )
        if formats:
            from kolsky.report.canvas import save_figures
            from kolsky.report.figures import REPEATS

            save_figures(partial / "figures", mean, formats=tuple(formats), registry=REPEATS)
    at = int(abs(together.mean).argmax())
    said = {
        "tests": list(found),
        "strain_range": [float(together.axis[0]), float(together.axis[-1])],
        "largest_mean_stress": {
            "value": float(together.mean[at]),
            "band": [float(low[at]), float(high[at])],
            "strain": float(together.axis[at]),
            "scatter": float(together.scatter[at]),
            "unit": mean.unit,
        },
        "remarks": list(together.remarks),
    }
    tell(
        [],
        {
            "tests": ", ".join(found),
            "strains": f"{together.axis[0]:.4g} to {together.axis[-1]:.4g}",
            "largest mean stress": f"{together.mean[at]:.4g} Pa, 95 % band {low[at]:.4g} to {high[at]:.4g} Pa"
            f" at strain {together.axis[at]:.4g}",
            "scatter between tests there": f"{together.scatter[at]:.3g} Pa",
        },
        said if as_json else None,
        rest={"curves": folder / "repeats.csv"},
        warnings=together.remarks,
    )

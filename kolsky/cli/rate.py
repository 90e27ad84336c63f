"""`kolsky rate`: several identified shots to their stiffness against strain rate."""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, OutFolder

if TYPE_CHECKING:
    from kolsky.inverse.result import Identification
    from kolsky.shot.records import Shot
    from kolsky.studies.rates.rate import Identify
    from kolsky.studies.rates.records import GroupRates


def rate(
    shots: Annotated[list[Path], typer.Argument(metavar="SHOT...", help="Shots that were identified.")],
    group: Annotated[
        str,
        typer.Option(
            metavar="KEY", help="Compare shots with one value of this key of shot.toml, e.g. interface.faces."
        ),
    ] = "",
    strains: Annotated[str, typer.Option(metavar="NUMBERS", help="Nominal strains.")] = "0.1,0.3,0.5",
    shared: Annotated[
        float, typer.Option(min=0.0, help="Relative standard uncertainty that all m have in common.")
    ] = 0.0,
    identify: Annotated[bool, typer.Option("--identify", help="Identify shots without a result.")] = False,
    keep_unexplained: Annotated[
        bool,
        typer.Option("--keep-unexplained", help="Count shots whose data the model does not explain, too."),
    ] = False,
    out: OutFolder = Path("rates"),
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Compare the stiffness of identified shots over their strain rates: mean, scatter, slope.

    Writes rates.h5, rates.html and CSV tables. A slope that the rates cannot carry is refused.
    A shot whose data the model does not explain is left out and named.
    """
    started = perf_counter()
    at = texts.strains("--strains", strains)
    formats = texts.figure_formats(figures)
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.report.result_folder import write_results
    from kolsky.studies.rates.output import summary
    from kolsky.studies.rates.rate import rate as compared

    folder = usable_folder(out)
    with progress_bars() as progress:
        try:
            report = compared(
                shots,
                group=group,
                strains=at,
                shared=shared,
                identify=_identified(progress) if identify else None,
                keep_unexplained=keep_unexplained,
                progress=progress,
            )
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE, str(error), cure="correct the option; `kolsky rate --help` shows each"
            ) from error
    write_results(folder, report, formats=formats)
    several = len(report.groups) > 1
    print_result(
        {name: text for group in report.groups for name, text in _rows(group, several=several).items()},
        summary(report) if as_json else None,
        rest={"result": folder / "rates.h5", "page": folder / "rates.html", "wall time": since(started)},
        warnings=[remark for group in report.groups for remark in group.remarks],
    )


def _identified(progress: Any) -> "Identify":
    """Identification of a shot without a result; it leaves the files of `kolsky identify`."""

    def identify(shot: Path, loaded: "Shot") -> "Identification":
        from kolsky.base.files import usable_folder
        from kolsky.identification import identify as identified
        from kolsky.report.result_folder import write_identify_results
        from kolsky.studies.rates.rate import result_of

        folder = usable_folder(result_of(shot).parent)
        try:
            found = identified(loaded, progress=progress)
        except ValueError as error:
            raise InputError(
                loaded.folder, str(error), cure="correct the option; `kolsky rate --help` shows each"
            ) from error
        write_identify_results(folder, found, loaded)
        return found

    return identify


def _rows(group: "GroupRates", *, several: bool) -> dict[str, str]:
    """The lines that a terminal gets of one group."""
    from kolsky.results import numbers
    from kolsky.results.numbers import plain_sentence

    prefix = f"{group.name}: " if several else ""
    rows = {f"{prefix}shots": f"{len(group.counted)} of {len(group.shots)} counted"}
    for shot in group.shots:
        value, U = numbers.measured(shot.m, 2.0 * shot.sigma)
        rows[f"{prefix}{shot.name}"] = (
            f"m = {plain_sentence(value)} ± {plain_sentence(U)} (k = 2) at "
            f"{shot.history.nominal_rate:.4g} 1/s"
            f"{'' if shot.counted else ', not counted'}"
        )
    if group.pooled is not None:
        low, high = group.pooled.interval
        value, half = numbers.measured(group.pooled.mean, 0.5 * (high - low))
        rows[f"{prefix}mean m"] = f"{plain_sentence(value)} ± {plain_sentence(half)} (95 %)"
        rows[f"{prefix}scatter between shots"] = f"{group.pooled.fit.between:.2g}"
        rows[f"{prefix}U = 2s"] = f"{2.0 * group.pooled.scatter:.2g}"
    line = group.slope
    if line is not None:
        rows[f"{prefix}slope"] = line.verdict.value
        for number, reason in enumerate(line.reasons, start=1):
            rows[f"{prefix}because {number}"] = reason
        if line.fit is not None:
            low, high = line.fit.interval(1)
            said = "would show" if line.reasons else "line"
            middle = float(line.fit.coefficients[1])
            rows[f"{prefix}{said}"] = f"{middle:.3g} per decade, 95 % {low:.3g} to {high:.3g}"
    if group.long_lever is not None:
        lever = group.long_lever
        rows[f"{prefix}from quasi-static"] = (
            f"{lever.slope:.2g} per decade, 95 % {lever.interval[0]:.2g} to {lever.interval[1]:.2g}"
        )
    return rows

"""`kolsky rate`: stiffness of several identified shots against strain rate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.files import usable_folder
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Figures, OutFolder
from kolsky.cli.terminal import print_result, progress_bars

if TYPE_CHECKING:
    from kolsky.inverse.result import Identification
    from kolsky.shot.records import Shot
    from kolsky.studies.rates.rate import Identify
    from kolsky.studies.rates.records import GroupRates


def rate(
    shots: Annotated[list[Path], typer.Argument(metavar="SHOT...", help="Identified shots.")],
    group: Annotated[
        str,
        Option("Compare shots with one value of this key of shot.toml, e.g. interface.faces.", metavar="KEY"),
    ] = "",
    strains: Annotated[
        tuple[float, ...], Option("Nominal strains.", metavar="NUMBERS", read=texts.strains)
    ] = (0.1, 0.3, 0.5),
    shared: Annotated[
        float, Option("Relative standard uncertainty that all m have in common.", min=0.0)
    ] = 0.0,
    identify: Annotated[bool, Option("Identify shots without a result.")] = False,
    keep_unexplained: Annotated[bool, Option("Include shots whose data the model does not explain.")] = False,
    out: OutFolder = Path("rates"),
    figures: Figures = (),
) -> None:
    """Compare the stiffness of identified shots over their strain rates: mean, scatter, slope.

    Writes rates.h5, rates.html and CSV tables. A slope that the range of rates does not support is rejected.
    A shot whose data the model does not explain is left out and named.
    """
    from kolsky.report.result_folder import write_results
    from kolsky.studies.rates import rate as rates
    from kolsky.studies.rates.output import summary

    folder = usable_folder(out)
    with progress_bars() as progress, texts.refused(cure=_CURE):
        report = rates.rate(
            shots,
            group=group,
            strains=strains,
            shared=shared,
            identify=_identification_of(progress) if identify else None,
            keep_unexplained=keep_unexplained,
            progress=progress,
        )
    write_results(folder, report, formats=figures)
    several = len(report.groups) > 1
    print_result(
        {name: text for group in report.groups for name, text in _rows(group, several=several).items()},
        summary(report),
        files={"result": folder / "rates.h5", "page": folder / "rates.html"},
        warnings=[remark for group in report.groups for remark in group.remarks],
    )


_CURE = "correct the option; `kolsky rate --help` shows each"


def _identification_of(progress: Any) -> "Identify":
    """Identification of a shot without a result. It writes the files of `kolsky identify`."""

    def identify(shot: Path, loaded: "Shot") -> "Identification":
        from kolsky import identification
        from kolsky.report.result_folder import write_identify_results
        from kolsky.studies.rates.rate import result_of

        folder = usable_folder(result_of(shot).parent)
        with texts.refused(cure=_CURE, place=loaded.folder):
            result = identification.identify(loaded, progress=progress)
        write_identify_results(folder, result, loaded)
        return result

    return identify


def _rows(group: "GroupRates", *, several: bool) -> dict[str, str]:
    """Lines of output for a terminal on one group."""
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
        low, high = (100.0 * share for share in group.own_range)
        rows[f"{prefix}in common (u of m)"] = ", ".join(group.in_common) or "nothing"
        rows[f"{prefix}each shot's own (u of m)"] = f"{low:.2g} to {high:.2g} %"
        rows[f"{prefix}U = 2s"] = f"{2.0 * group.pooled.scatter:.2g}"
    line = group.slope
    if line is not None:
        refused = bool(line.reasons)
        rows[f"{prefix}slope"] = line.verdict.value if refused else line.sentence
        for number, reason in enumerate(line.reasons, start=1):
            rows[f"{prefix}because {number}"] = reason
        if line.fit is not None and refused:
            low, high = line.fit.interval(1)
            middle = float(line.fit.coefficients[1])
            rows[f"{prefix}not supported: slope"] = f"{middle:.3g} per decade, 95 % {low:.3g} to {high:.3g}"
    if group.long_lever is not None:
        lever = group.long_lever
        rows[f"{prefix}from quasi-static"] = (
            f"{lever.slope:.2g} per decade, 95 % {lever.interval[0]:.2g} to {lever.interval[1]:.2g}"
        )
    return rows

"""`kolsky plan`, `predict` and `virtual`: planned tests, and shots with a known answer."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from kolsky.base.errors import refused
from kolsky.base.files import usable_folder
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.new import write_template
from kolsky.cli.options import Figures, Out, OutFolder, ShotPath, Values, load, usable
from kolsky.cli.terminal import as_json, print_result, progress_bars
from kolsky.inverse.settings import Device, Numerics, Threads


def _frame_interval(option: str, text: str) -> float:
    """ "120 kHz" as time between pictures [s]."""
    return 1.0 / texts.physical(option, text, "1/s", positive=True)


def _window(option: str, text: str) -> tuple[float, float]:
    """ "0 ms:1.2 ms" as start and end [s]."""
    ends = text.split(":")
    if len(ends) != 2:
        raise texts.unreadable(option, text, 'START:END, e.g. "0 ms:1.2 ms"')
    start, end = (texts.physical(option, part, "s") for part in ends)
    return start, end


_heights = texts.checked_numbers(
    "whole numbers from 1 with commas, e.g. 1,3,5",
    lambda found: all(n >= 1.0 and n % 1.0 == 0.0 for n in found),
)


def _without_bounds(text: str) -> str:
    """Name of a free parameter. It has no bounds in a plan."""
    if "=" in text:
        raise texts.refusal(
            f"--free {text!r}: a plan has no bounds",
            cure=f"write --free {text.partition('=')[0]}, and its value with -p",
        )
    return text


_Own = partial(Option, show_default="the shot's")


@dataclass(frozen=True)
class _Instruments:
    """Changes of the shot's instruments."""

    outline_sigma: Annotated[float | None, _Own('Noise of an outline point, e.g. "4 um".', unit="m")] = None
    force_sigma: Annotated[
        float | None, _Own('Noise of the mean force of a bin, e.g. "0.1 N".', unit="N")
    ] = None
    frame_interval: Annotated[
        float | None, _Own('Frame rate, e.g. "120 kHz".', name="frame-rate", read=_frame_interval)
    ] = None
    points: Annotated[
        float | None, _Own('Independent outline points per height, e.g. "3.6 1/mm".', unit="1/m")
    ] = None
    clearance: Annotated[
        float | None, _Own('Heights near a platen that the camera does not see, e.g. "0.3 mm".', unit="m")
    ] = None
    window: Annotated[
        tuple[float, float] | None,
        _Own('Time window, e.g. "0 ms:1.2 ms".', metavar="START:END", read=_window),
    ] = None


def plan(
    shot: ShotPath,
    *,
    free: Annotated[
        tuple[str, ...],
        Option(
            "Parameter to be estimated together with the others; repeat for more.",
            metavar="NAME",
            show_default="stiffness_factor, poisson, damping",
        ),
    ] = (),
    parameter: Values,
    instruments: _Instruments,
    rates: Annotated[
        list[float] | None,
        Option(
            "Flyer speeds to compare, relative to the shot's.",
            metavar="FACTORS",
            read=texts.numbers,
            show_default="0.5,1,2",
        ),
    ] = None,
    heights: Annotated[
        tuple[int, ...], Option("Numbers of best heights to choose.", metavar="NUMBERS", read=_heights)
    ] = (1, 2, 3),
    discrepancy: Annotated[
        Literal["mesh", "none"], Option("Model error: the change to a finer mesh (mesh), or none.")
    ] = "mesh",
    reach: Annotated[
        float, Option("Range of the slopes over the parameters' scales.", min=0.001, max=0.5)
    ] = 0.1,
    numerics: Annotated[Numerics, ("mesh", "precision", "device", "threads")],
    out: Out = None,
    figures: Annotated[
        tuple[str, ...],
        Option(
            "Formats of the figures, e.g. pdf,svg; empty: none.", metavar="FORMATS", read=texts.figure_formats
        ),
    ] = ("png",),
) -> None:
    """Predict the uncertainty of a planned test like this shot: where, when and how fast to measure.

    Writes plan.html, plan.json, CSV tables and figures into SHOT/results.
    """
    changes: dict[str, Any] = {name: value for name, value in vars(instruments).items() if value is not None}
    names = tuple(texts.ranges("--free", [_without_bounds(name) for name in free]))
    from kolsky.report.result_folder import write_results
    from kolsky.studies.planning import plan as output
    from kolsky.studies.planning import plan as planning
    from kolsky.studies.planning.information import instruments_of

    loaded, folder = load(shot, out, device=numerics.device)
    with usable(loaded), progress_bars() as progress:
        result = planning.plan(
            loaded,
            names=names or planning.NAMES,
            held=parameter,
            instruments=lambda prepared: replace(instruments_of(prepared), **changes),
            rates=rates or planning.RATES,
            heights=[int(count) for count in heights],
            reach=reach,
            discrepancy=(0.0, 0.0) if discrepancy == "none" else None,
            numerics=numerics,
            progress=progress,
        )
    write_results(folder, result, formats=figures)
    print_result(
        output.rows(result),
        output.to_json(result),
        files={"folder": folder},
        warnings=[f"{part}: {e.unseen}" for part, e in result.expected.items() if e.unseen],
    )


def predict(
    test: Annotated[Path, typer.Argument(metavar="TEST.toml", help="The test, from striker to specimen.")],
    out: OutFolder,
    vary: Annotated[
        tuple[str, ...],
        Option(
            'Scan a key of the file, e.g. "striker.speed=4 m/s:7 m/s:5"; repeat for more.',
            metavar="KEY=LOW:HIGH[:LEVELS]",
        ),
    ] = (),
    want: Annotated[
        tuple[str, ...],
        Option(
            "Find and predict the point within the ranges that has this number (SI), e.g. flyer_speed=2.7 "
            "or mean_rate=400.",
            metavar="NUMBER=VALUE",
        ),
    ] = (),
    quick: Annotated[bool, Option("Use the specimen's static curve instead of its elements.")] = False,
    figures: Figures = (),
) -> None:
    """Predict a flyer test from the contact of the striker to the second impact.

    Writes prediction.html, prediction.json, CSV tables of signals, events and the specimen's outline, and
    virtual.toml for `kolsky virtual make`.
    --vary scans the test; --want designs it.
    """
    if want and not vary:
        raise texts.refusal("--want needs --vary", cure='add e.g. --vary "striker.speed=4 m/s:7 m/s:5"')
    from kolsky.prediction import design
    from kolsky.prediction import predict as prediction
    from kolsky.prediction.design import to_json
    from kolsky.report.result_folder import write_prediction_results

    cure = "name a number of the test file with its range, e.g. striker.velocity=2:6"
    with texts.refused("--vary: ", cure=cure):
        ranges = [design.Varied.of(text) for text in vary]
    targets = dict(_wanted(text) for text in want)
    folder, test_plan = usable_folder(out), prediction.read_test(test)
    with progress_bars() as progress:
        scan = aim = None
        if ranges:
            scan = design.scan(test_plan, ranges, progress=lambda n, m: progress("design", n, m))
        if scan is not None and targets:
            with texts.refused("--want: ", cure="write it as `kolsky predict --help` shows"):
                aim = design.aim(test_plan, scan, targets)
            values = {one.key: one.written(aim.at[one.key]) for one in ranges}
            test_plan = design.varied_test(test_plan, values)
        progress("simulation", 0, 1)
        result = prediction.predict(test_plan, quick=quick)
        progress("simulation", 1, 1)
    write_prediction_results(folder, result, scan, aim, formats=figures)
    warnings = prediction.doubts(result)
    if aim is not None and not aim.reached:
        bound = f", at a bound of {' and '.join(aim.at_bound)}" if aim.at_bound else ""
        warnings.append(
            "the wanted numbers are not reached within the ranges: the nearest point is off by "
            f"{aim.distance:.1%}{bound}"
        )
    rows = {
        "test": test_plan.declared.name,
        **({} if aim is None else {f"found, {key}": value for key, value in aim.at.items()}),
        **{f"{name}, s": value for name, value in vars(result.events).items()},
        **vars(result.numbers),
        "page": str(folder / "prediction.html"),
    }
    print_result(rows, to_json(result, scan, aim), warnings=warnings)


def _wanted(text: str) -> tuple[str, float]:
    """A number and its value, SI."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        cure = "write a number in SI units, e.g. flyer_speed=2.7"
        raise texts.refusal(f"--want {text!r} is not NUMBER=VALUE", cure=cure) from None


def virtual_new(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the new specification.")],
) -> None:
    """Write an annotated SPEC.toml of a virtual shot; an existing one is left unchanged."""
    then = f"change it, then: kolsky virtual make {{}} --out {folder / 'shot'}"
    write_template(folder, "virtual.toml", then)


def virtual_make(
    specification: Annotated[
        Path, typer.Argument(metavar="SPEC.toml", help="The specification, or its folder.")
    ],
    out: OutFolder,
    only: Annotated[
        list[int] | None,
        Option(
            "Shots of a population, e.g. 3 or 1-8,12.",
            metavar="NUMBERS",
            show_default="all",
            read=texts.whole_numbers,
        ),
    ] = None,
    device: Device = "cpu",
    threads: Threads = None,
    workers: Annotated[int, Option("Number of parallel processes.", min=1)] = 1,
) -> None:
    """Make the shot folders of a specification; existing shots are left unchanged."""
    from kolsky.virtual.make import Made, make
    from kolsky.virtual.specification import read_specification

    series = read_specification(specification)

    def print_folder(made: Made) -> None:
        if not as_json():
            typer.echo(f"{made.folder}{'' if made.fresh else ' existed already'}")

    with refused(specification, cure="correct the specification; `kolsky virtual new` writes one"):
        made = make(
            series, out, numbers=only, device=device, threads=threads, workers=workers, progress=print_folder
        )
    fresh = sum(shot.fresh for shot in made)
    summary = {"shots": len(made), "made": fresh, "folder": str(out)}
    print_result(summary, {**summary, "folders": [str(shot.folder) for shot in made]})

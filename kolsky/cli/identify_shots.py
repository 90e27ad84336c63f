"""`kolsky identify SHOT SHOT...`: several shots of one material, and slow tests, together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts

if TYPE_CHECKING:
    from kolsky.inverse.forward import Numerics
    from kolsky.inverse.joint_result import JointResult, JointSettings
    from kolsky.shot.records import Shot


@dataclass(frozen=True)
class JointOptions:
    """Options of shots that are identified together; see `kolsky.cli.options.with_settings`."""

    slow_tests: Annotated[
        Path | None,
        typer.Option(metavar="TOML", help="Relaxation, ramps, oscillation of the same material."),
    ] = None
    curve_nodes: Annotated[
        int, typer.Option(min=0, help="Estimate the curve too, at this number of strains: 4 to 24.")
    ] = 0
    curve_roughness: Annotated[
        float, typer.Option(help="Standard deviation of the second difference of the nodes' logarithms.")
    ] = 0.1
    gain_each: Annotated[
        str,
        typer.Option(metavar="PERCENT", help='Standard uncertainty of each shot\'s own gain, "0.5 %".'),
    ] = ""
    no_scatter: Annotated[
        bool, typer.Option("--no-scatter", help="Assume no specimen-to-specimen scatter.")
    ] = False

    @property
    def asked(self) -> bool:
        """Whether an option needs a joint identification."""
        return self.slow_tests is not None or self.curve_nodes > 0

    def refuse(self) -> None:
        """Refuse what means something for several shots together alone.

        Raises InputError if it is asked for.
        """
        given = {
            "slow-tests": self.slow_tests is not None,
            "curve-nodes": self.curve_nodes > 0,
            "gain-each": bool(self.gain_each),
            "no-scatter": self.no_scatter,
        }
        for name in (name for name, there in given.items() if there):
            raise InputError(
                texts.COMMAND_LINE,
                f"--{name} is for several shots together",
                cure="leave it out, or leave out --each",
            )

    def settings(
        self,
        *,
        free: Mapping[str, tuple[float, float] | None] | None,
        held: Mapping[str, float],
        hold: tuple[str, ...],
        numerics: "Numerics",
        refined: tuple[int, int],
        replicates: int,
        seed: int,
    ) -> "JointSettings":
        """The settings of the library.

        Raises InputError if a value is not allowed.
        """
        from kolsky.inverse.joint_result import JointSettings

        gain = texts.physical("--gain-each", self.gain_each, "1") if self.gain_each else 0.0
        try:
            return JointSettings(
                free=free,
                held=held,
                hold=hold,
                numerics=numerics,
                refined_mesh=refined,
                replicates=replicates,
                curve_nodes=self.curve_nodes,
                curve_roughness=self.curve_roughness,
                scatter=not self.no_scatter,
                gain_each=gain,
                seed=seed,
            )
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE,
                str(error),
                cure="correct the option; `kolsky identify --help` shows each with its range",
            ) from None


def identify_shots(
    paths: Sequence[Path],
    options: JointOptions,
    settings: "JointSettings",
    *,
    relaxation: str,
    pull: str,
    out: Path | None,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """Load the shots, identify them together, write and print.

    Raises
    ------
    InputError
        If a shot, a slow test or the folder of results cannot be used, or the shots cannot be joined.
    """
    started = perf_counter()
    from doe.ledger import LedgerError
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.inverse.slow_tests import read_slow_tests
    from kolsky.joint_identification import identify_shots as together
    from kolsky.report.result_folder import write_results
    from kolsky.results.joint import to_json
    from kolsky.shot.curve import with_pull
    from kolsky.shot.load import load_shot

    shots = [
        with_pull(
            with_relaxation_option(load_shot(path), relaxation),
            "conditioned" if pull == "conditioned" else "first",
        )
        for path in paths
    ]
    slow = () if options.slow_tests is None else read_slow_tests(options.slow_tests)
    folder = usable_folder(out or Path("joint"))
    folder.mkdir(parents=True, exist_ok=True)
    with progress_bars() as progress:
        try:
            found = together(shots, settings, slow=slow, ledger=folder / "joint.sqlite", progress=progress)
        except (ValueError, LedgerError) as error:
            raise InputError(
                shots[0].folder, str(error), cure="give shots of one material with one set of free parameters"
            ) from error
    write_results(folder, found, formats=formats)
    print_result(
        _result_rows(found),
        to_json(found) if as_json else None,
        answers=answer_lines(found),
        rest={"report": folder / "joint.html", "wall time": since(started)},
        warnings=found.warnings,
    )


def with_relaxation_option(shot: "Shot", text: str) -> "Shot":
    """The shot with the relaxation of `--relaxation`; as declared if the text is empty."""
    from kolsky.inverse.parameters import with_relaxation

    return with_relaxation(shot, *texts.relaxation("--relaxation", text)) if text else shot


def answer_lines(found: "JointResult") -> list[str]:
    """The answer's first lines: shared parameters with their 95 % intervals, the scatter, what relaxes."""
    from kolsky.inverse.joint_result import interval
    from kolsky.inverse.result import Verdict
    from kolsky.results import numbers
    from kolsky.results.nomenclature import name_of
    from kolsky.results.numbers import plain_sentence
    from kolsky.results.printed import plain_symbol

    said = []
    for name, e in found.estimates.items():
        known = name_of(name)
        value, half = numbers.measured(known.factor * e.value, known.factor * found.expanded[name])
        unit = "" if known.unit == "1" else f" {plain_sentence(known.unit)}"
        line = (
            f"{plain_symbol(name)} = {plain_sentence(value)} +- "
            f"{plain_sentence(half)}{unit} (95 %, {len(found.shots)} shots)"
        )
        if e.outcome is Verdict.NOT_SEEN:
            low, high = (known.factor * end for end in interval(e, found.expanded[name]))
            line = f"{plain_symbol(name)} = {low:.2g} to {high:.2g}{unit}"
        said.append(line if e.outcome is Verdict.IDENTIFIED else f"{line}: {e.outcome.value.upper()}")
    if found.scatter is not None:
        low, high = (100.0 * end for end in found.scatter.interval)
        size = 100.0 * found.scatter.value
        said.append(f"scatter between shots = {size:.2g} % (95 %: {low:.2g} to {high:.2g} %)")
    if found.choice is not None:
        said.append(found.choice.sentence)
    return said


def _result_rows(found: "JointResult") -> dict[str, Any]:
    """Names and values below the answer."""
    from kolsky.inverse.parameters import reference_words

    said: dict[str, Any] = {"shots": len(found.shots)}
    reference = reference_words((*found.estimates, *found.fixed))
    if reference:
        said["m refers to"] = reference
    for p in found.shots:
        said[p.name] = (
            f"m = {p.factor:.4f}, chi2/n force {p.chi2_force:.3g}, outline {p.chi2_outline:.3g}, late by "
            f"{1e6 * p.clock:.2g} us, gain {100.0 * p.gain:+.2g} %"
        )
    said |= {f"{name}, chi2/n": value for name, value in found.slow.items()}
    if found.curve is not None:
        c = found.curve
        for strain, factor, sigma in zip(c.strain, c.factor, c.sigma_log, strict=True):
            said[f"factor at strain {strain:.3f}"] = f"{factor:.4f} +- {2.0 * factor * sigma:.2g} (k = 2)"
    return {**said, "simulations": found.runs}


def refuse_single_shot_options(given: Mapping[str, bool]) -> None:
    """Refuse options that mean something for one shot alone.

    Raises InputError if one is given.
    """
    for name, there in given.items():
        if there:
            raise InputError(
                texts.COMMAND_LINE,
                f"--{name} is for one shot by itself",
                cure="leave it out, or identify the shots one by one",
            )

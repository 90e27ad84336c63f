"""`kolsky identify SHOT SHOT...`: several shots of one material, and slow tests, together."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from kolsky.base.apparatus import RelaxationKind
from kolsky.base.options import Option
from kolsky.cli import texts

if TYPE_CHECKING:
    from kolsky.inverse.joint_result import JointResult, JointSettings
    from kolsky.inverse.result import FitQuality
    from kolsky.inverse.settings import Settings


TOGETHER = "Several shots together"
"""Panel of `--help`."""


@dataclass(frozen=True)
class JointOptions:
    """Options of shots that are identified together; see `kolsky.inverse.joint_result.JointSettings`."""

    slow_tests: Annotated[
        Path | None,
        Option("Relaxation, ramps, oscillation of the same material.", metavar="TOML", panel=TOGETHER),
    ] = None
    curve_nodes: Annotated[
        int, Option("Estimate the curve too, at this number of strains: 4 to 24.", min=0, panel=TOGETHER)
    ] = 0
    curve_roughness: Annotated[
        float, Option("Standard deviation of the second difference of the nodes' logarithms.", panel=TOGETHER)
    ] = 0.1
    gain_each: Annotated[
        float,
        Option(
            'Standard uncertainty of each shot\'s gain, "0.5 %".', metavar="PERCENT", unit="1", panel=TOGETHER
        ),
    ] = 0.0
    scatter: Annotated[bool, Option("Assume no specimen-to-specimen scatter.", panel=TOGETHER)] = True

    @property
    def is_needed(self) -> bool:
        """Whether an option needs a joint identification, also of one shot."""
        return self.slow_tests is not None or self.curve_nodes > 0

    def settings(self, settings: "Settings") -> "JointSettings":
        """The settings of the library, from those of a single shot.

        Raises InputError if a value is not allowed.
        """
        from kolsky.inverse.joint_result import JointSettings

        shared = ("free", "held", "hold", "numerics", "refined_mesh", "replicates", "seed")
        joint = ("curve_nodes", "curve_roughness", "gain_each", "scatter")
        cure = "correct the option; `kolsky identify --help` shows each with its range"
        with texts.refused(cure=cure):
            return JointSettings(
                **{name: getattr(settings, name) for name in shared},
                **{name: getattr(self, name) for name in joint},
            )


def identify_shots(
    paths: Sequence[Path],
    options: JointOptions,
    settings: "Settings",
    *,
    relaxation: tuple[RelaxationKind, int] | None,
    out: Path | None,
    figures: Sequence[str],
) -> None:
    """Load the shots, identify them together, write and print.

    Raises InputError if a shot, a slow test or the folder of results cannot be used, or the shots cannot be
    joined.
    """
    from doe.ledger import LedgerError
    from kolsky import joint_identification
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars
    from kolsky.inverse.parameters import with_relaxation
    from kolsky.inverse.slow_tests import read_slow_tests
    from kolsky.report.result_folder import write_results
    from kolsky.results.joint import to_json
    from kolsky.shot.curve import with_pull
    from kolsky.shot.load import load_shot

    chosen = options.settings(settings)
    require_one_material(paths)
    shots = []
    for path in paths:
        shot = load_shot(path)
        if relaxation is not None:
            shot = with_relaxation(shot, *relaxation)
        shots.append(with_pull(shot, settings.pull))
    slow = () if options.slow_tests is None else read_slow_tests(options.slow_tests)
    folder = usable_folder(out or Path("joint"))
    folder.mkdir(parents=True, exist_ok=True)
    cure = "give shots of one material with one set of free parameters"
    refused = texts.refused(cure=cure, place=shots[0].folder, errors=(ValueError, LedgerError))
    with progress_bars() as progress, refused:
        result = joint_identification.identify_shots(
            shots, chosen, slow=slow, ledger=folder / "joint.sqlite", progress=progress
        )
    write_results(folder, result, formats=figures)
    print_result(
        _result_rows(result),
        to_json(result),
        lines=answer_lines(result),
        files={"report": folder / "joint.html"},
        warnings=result.warnings,
    )


def require_one_material(paths: Sequence[Path]) -> None:
    """Refuse shots that declare different materials.

    Raises InputError if two shot files name a different `material`, or one cannot be read.
    """
    from kolsky.base.errors import InputError
    from kolsky.studies.rates.rate import declarations

    named = [(file, said.material) for file, said in map(declarations, paths) if said.material is not None]
    for file, material in named[1:]:
        if material != named[0][1]:
            raise InputError(
                file.path,
                f"is {material!r}, but {named[0][0].path} has {named[0][1]!r}: a joint answer is of "
                "one material",
                key="material",
                cure="identify them apart with --each, or correct the name",
            )


def answer_lines(result: "JointResult") -> list[str]:
    """First lines of the answer: shared parameters with 95 % intervals, the scatter, the relaxation."""
    from kolsky.inverse.joint_result import interval
    from kolsky.inverse.result import Verdict
    from kolsky.results import numbers
    from kolsky.results.nomenclature import name_of
    from kolsky.results.numbers import plain_sentence
    from kolsky.results.printed import plain_symbol

    lines = []
    for name, e in result.estimates.items():
        quantity = name_of(name)
        value, half = numbers.measured(quantity.factor * e.value, quantity.factor * result.expanded[name])
        unit = "" if quantity.unit == "1" else f" {plain_sentence(quantity.unit)}"
        line = (
            f"{plain_symbol(name)} = {plain_sentence(value)} +- "
            f"{plain_sentence(half)}{unit} (95 %, {len(result.shots)} shots)"
        )
        if e.outcome is Verdict.NOT_SEEN:
            low, high = (quantity.factor * end for end in interval(e, result.expanded[name]))
            line = f"{plain_symbol(name)} = {low:.2g} to {high:.2g}{unit}"
        lines.append(line if e.outcome is Verdict.IDENTIFIED else f"{line}: {e.outcome.value.upper()}")
    if result.scatter is not None:
        low, high = (100.0 * end for end in result.scatter.interval)
        size = 100.0 * result.scatter.value
        lines.append(f"scatter between shots = {size:.2g} % (95 %: {low:.2g} to {high:.2g} %)")
    if result.choice is not None:
        lines.append(result.choice.sentence)
    lines.append(_verdict_line(result))
    return lines


def _verdict_line(result: "JointResult") -> str:
    """The verdict on the whole, with the largest residual over that expected of a correct model."""
    fits = [(f"{shot.name}, {fit.channel}", fit) for shot in result.shots for fit in shot.fit]
    fits += [(fit.channel, fit) for fit in result.slow_fit]
    if not fits:
        return f"verdict: {result.verdict}"
    name, worst = max(fits, key=lambda one: one[1].excess / one[1].limit)
    return f"verdict: {result.verdict} (largest residual over expected: {worst.excess:.2g} of {name})"


def _excesses(fits: "Sequence[FitQuality]") -> str:
    """Residuals over the residual of a correct model, whole and slow, of several channels."""
    return ", ".join(
        f"{fit.channel} {fit.excess:.2g} (slow {fit.slow_excess:.2g})"
        f"{'' if fit.explained else ': NOT EXPLAINED'}"
        for fit in fits
    )


def _result_rows(result: "JointResult") -> dict[str, Any]:
    """Names and values below the answer."""
    from kolsky.diagnosis.joint_fit import cause_sentence
    from kolsky.inverse.parameters import reference_words

    rows: dict[str, Any] = {"shots": len(result.shots)}
    reference = reference_words((*result.estimates, *result.fixed))
    if reference:
        rows["m refers to"] = reference
    for p in result.shots:
        rows[p.name] = (
            f"m = {p.factor:.4f}, chi2/n force {p.chi2_force:.3g}, outline {p.chi2_outline:.3g}, late by "
            f"{1e6 * p.clock:.2g} us, gain {100.0 * p.gain:+.2g} %"
        )
        if p.own is not None:
            rows[f"{p.name}, by itself"] = (
                f"stiffness {100.0 * p.own.value:+.2g} +- {200.0 * p.own.sigma:.2g} % from the shared (k = 2)"
            )
        if p.fit:
            rows[f"{p.name}, residual over expected"] = _excesses(p.fit)
    rows |= {f"{name}, chi2/n": value for name, value in result.slow.items()}
    rows |= {f"{fit.channel}, residual over expected": _excesses((fit,)) for fit in result.slow_fit}
    if result.agreement is not None:
        rows["agreement of the shots"] = result.agreement.sentence
    if result.causes:
        rows["cause of the misfit"] = cause_sentence(result.causes)
    if result.curve is not None:
        c = result.curve
        for strain, factor, sigma in zip(c.strain, c.factor, c.sigma_log, strict=True):
            rows[f"factor at strain {strain:.3f}"] = f"{factor:.4f} +- {2.0 * factor * sigma:.2g} (k = 2)"
    return {**rows, "simulations": result.runs}

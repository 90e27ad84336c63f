"""`kolsky material baseline`: quasi-static tests to the curve that a shot's stiffness refers to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.apparatus import Specimen
from kolsky.commands import options
from kolsky.commands.outfolder import filling, usable_folder
from kolsky.commands.parts import tell
from kolsky.csvtable import write_table
from kolsky.errors import InputError
from kolsky.quasistatic.apparent import apparent_modulus
from kolsky.quasistatic.baseline import Baseline, Pull, Treatment, baseline
from kolsky.quasistatic.friction import EndFriction
from kolsky.quasistatic.slowtest import SlowNumerics
from kolsky.quasistatic.toe import Toe
from kolsky.quasistatic.uniaxial import UniaxialTest
from kolsky.readers.columns import read_columns
from kolsky.units import UnitError, quantity

CONVENTIONS = ("tension-positive", "compression-positive")
BRANCHES = ("compression", "tension")
KINDS = {"strain": "1", "stress": "Pa", "displacement": "m", "force": "N", "time": "s", "bulge": "m"}
"""What a column may hold -> its SI unit."""
MODE = "mode"
"""How the columns of common uncertainties begin."""


@dataclass(frozen=True)
class Given:
    """What the command line says; texts as they were written, empty or None where nothing was said."""

    files: Sequence[Path]
    columns: Mapping[str, str]
    units: Sequence[str]
    convention: str
    branch: str
    header_line: int | None
    diameter: str | None
    length: str | None
    compliance: str | None
    toe: str
    friction: str
    friction_sigma: float
    bulge_sigma: str | None
    scale_sigma: str
    poisson: float
    points: int
    last: float | None
    conditioned: bool


def make_baseline(given: Given, *, out: Path, formats: Sequence[str], as_json: bool) -> None:
    """Read the tests, average, correct, write and print.

    Raises
    ------
    InputError
        If a declaration or a file cannot be used, or the results cannot be written.
    """
    for name in formats:
        options.one_of("--figures", name, options.FIGURES)
    if out.suffix != ".csv":
        raise InputError(options.COMMAND_LINE, "is no table", key="--out", value=str(out), allowed="FILE.csv")
    folder = usable_folder(out.parent)
    treatment = _treatment(given)
    tests, hashes = _tests(given, treatment.specimen)
    pulls: tuple[Pull, ...] = ("first", "conditioned") if given.conditioned else ("first",)
    try:
        found = {pull: baseline(tests, treatment, pull=pull) for pull in pulls}
    except ValueError as error:
        raise InputError(options.COMMAND_LINE, str(error)) from error
    names = {"first": out.stem, "conditioned": f"{out.stem}_conditioned"}
    with filling(folder) as partial:
        for pull, made in found.items():
            write_curve(partial / f"{names[pull]}.csv", made)
            write_modulus(partial / f"{names[pull]}_modulus.csv", made)
            if formats:
                from kolsky.report.canvas import save_figures
                from kolsky.report.figures import BASELINES

                save_figures(
                    partial / f"{names[pull]}_figures", made, formats=tuple(formats), registry=BASELINES
                )
        table = curve_table(
            out.name, found["first"], f"{names['conditioned']}.csv" if given.conditioned else None
        )
        (partial / f"{out.stem}.toml").write_text(table, encoding="utf-8")
    said = {"inputs": hashes, "curves": {pull: _said(made) for pull, made in found.items()}}
    rows: dict[str, Any] = {}
    for pull, made in found.items():
        rows |= _rows(made, f"{pull}: " if given.conditioned else "")
    tell(
        [],
        rows,
        said if as_json else None,
        rest={"curve": out, "for shot.toml": folder / f"{out.stem}.toml"},
        warnings=list(dict.fromkeys(remark for made in found.values() for remark in made.remarks)),
    )


def write_curve(path: Path, made: Baseline) -> None:
    """A table that `[curve]` of a shot.toml reads, strain and stress positive along the branch."""
    band = made.band
    modes = {
        f"{MODE} {number}: {name} (Pa)": row.tolist()
        for number, (name, row) in enumerate(zip(band.names, band.modes, strict=True), start=1)
    }
    write_table(
        path,
        {
            "nominal strain (1)": band.strain.tolist(),
            "nominal stress (Pa)": band.stress.tolist(),
            "independent sigma (Pa)": band.noise.tolist(),
            **modes,
        },
    )


def write_modulus(path: Path, made: Baseline) -> None:
    """E_a against strain and time with its k = 2 interval, and what the uncorrected curve would give."""
    modulus = made.modulus
    low, high = modulus.interval()
    apparent = apparent_modulus(made.apparent, compression=made.compression)
    time = {} if modulus.time is None else {"time since zero strain (s)": modulus.time.tolist()}
    write_table(
        path,
        {
            "nominal strain (1)": modulus.strain.tolist(),
            **time,
            "E_a (Pa)": modulus.modulus.tolist(),
            "low end, k = 2 (Pa)": low.tolist(),
            "high end, k = 2 (Pa)": high.tolist(),
            "E_a as if frictionless (Pa)": apparent.modulus.tolist(),
        },
    )


def curve_table(name: str, made: Baseline, conditioned: str | None) -> str:
    """The table `[curve]` for a shot.toml that reads the curve."""
    side = "compression" if made.compression else "tension"
    lines = [
        "[curve]",
        f'file = "{name}"',
        'strain = { column = "nominal strain (1)", unit = "1" }',
        'stress = { column = "nominal stress (Pa)", unit = "Pa" }',
        f'convention = "{side} positive"',
        f'branch = "{side}"',
        'sigma = { column = "independent sigma (Pa)", unit = "Pa" }',
        *([f'modes = {{ prefix = "{MODE} ", unit = "Pa" }}'] if made.band.names else []),
        *([] if conditioned is None else [f'conditioned = "{conditioned}"']),
    ]
    return "\n".join(lines) + "\n"


def _treatment(given: Given) -> Treatment:
    size = None
    if given.diameter is not None or given.length is not None:
        if given.diameter is None or given.length is None:
            raise InputError(options.COMMAND_LINE, "needs both --diameter and --length or neither")
        diameter = _positive("--diameter", given.diameter, "m")
        size = Specimen(diameter=diameter, length=_positive("--length", given.length, "m"), density=0.0)
    if ("bulge" in given.columns) != (given.friction == "free"):
        raise InputError(
            options.COMMAND_LINE,
            "--bulge and --friction free belong together: the radius at mid-height finds the friction",
        )
    if ("bulge" in given.columns) != (given.bulge_sigma is not None):
        raise InputError(options.COMMAND_LINE, "--bulge and --bulge-sigma belong together")
    try:
        return Treatment(
            toe=_toe(given.toe),
            compliance=0.0 if given.compliance is None else _value("--compliance", given.compliance, "m/N"),
            scale_sigma=_value("--scale-sigma", given.scale_sigma, "1"),
            specimen=size,
            ends=_ends(given),
            bulge_sigma=0.0
            if given.bulge_sigma is None
            else _positive("--bulge-sigma", given.bulge_sigma, "m"),
            points=given.points,
            last=given.last,
            numerics=SlowNumerics(passages=160.0, poisson=given.poisson),
        )
    except ValueError as error:
        raise InputError(options.COMMAND_LINE, str(error)) from None


def _ends(given: Given) -> EndFriction | None:
    text, sigma = given.friction, given.friction_sigma
    number = None
    if text not in ("none", "bonded", "rough", "free"):
        try:
            number = float(text)
        except ValueError:
            options.one_of("--friction", text, ("none", "bonded", "rough", "free", "a number"))
    if number is None and sigma > 0.0:
        raise InputError(options.COMMAND_LINE, "--friction-sigma goes with a number as --friction")
    if text == "none":
        return None
    if text in ("bonded", "rough"):
        return EndFriction("bonded" if text == "bonded" else "rough")
    return EndFriction("coulomb", number, sigma)


def _toe(text: str) -> Toe:
    """ "gaussian:0.03:0.12" as a toe."""
    if text == "none":
        return Toe()
    kind, *ends = text.split(":")
    try:
        if kind not in ("line", "gaussian") or len(ends) != 2:
            raise ValueError
        low, high = (float(end) for end in ends)
    except ValueError:
        raise InputError(
            options.COMMAND_LINE,
            f"--toe {text!r} cannot be read",
            cure="write none, or line:LOW:HIGH or gaussian:LOW:HIGH with strains, e.g. gaussian:0.03:0.12",
        ) from None
    return Toe("line" if kind == "line" else "gaussian", low, high)


def _tests(given: Given, size: Specimen | None) -> tuple[list[UniaxialTest], dict[str, str]]:
    """Every file as a test, positive along its branch, and the hashes of the files."""
    options.one_of("--convention", given.convention, CONVENTIONS)
    options.one_of("--branch", given.branch, BRANCHES)
    columns = given.columns
    pair = {"strain", "stress"} if "stress" in columns else {"displacement", "force"}
    if (set(columns) & {"strain", "stress", "displacement", "force"}) != pair:
        raise InputError(
            options.COMMAND_LINE,
            "a test needs --strain and --stress, or --displacement and --force",
            cure="name two columns, or give their numbers",
        )
    if "force" in pair and size is None:
        raise InputError(options.COMMAND_LINE, "--displacement and --force need --diameter and --length")
    units = _units(given)
    compression = given.branch == "compression"
    sign = 1.0 if compression == (given.convention == "compression-positive") else -1.0
    tests, hashes = [], {}
    for path in given.files:
        values, digest = read_columns(
            path,
            {what: (column, KINDS[what]) for what, column in columns.items()},
            units=units,
            header_line=given.header_line,
        )
        if str(path) in hashes:
            raise InputError(path, "is named twice", cure="a test counts once")
        hashes[str(path)] = digest
        if size is not None and "force" in pair:
            values["strain"] = values["displacement"] / size.length
            values["stress"] = values["force"] / size.area
        try:
            tests.append(
                UniaxialTest(
                    name=path.name,
                    strain=sign * values["strain"],
                    stress=sign * values["stress"],
                    compression=compression,
                    time=values.get("time"),
                    bulge=values.get("bulge"),
                )
            )
        except ValueError as error:
            raise InputError(path, str(error)) from None
    return tests, hashes


def _units(given: Given) -> dict[str, str]:
    """["Load=N"] as units by column."""
    found = {}
    for text in given.units:
        column, equals, unit = text.rpartition("=")
        if not equals or column not in given.columns.values():
            raise InputError(
                options.COMMAND_LINE,
                f"--unit {text!r} names no column that is read",
                cure="write COLUMN=UNIT",
            )
        found[column] = unit
    return found


def _value(option: str, text: str, unit: str) -> float:
    try:
        return quantity(text, unit)
    except UnitError as error:
        raise InputError(options.COMMAND_LINE, f"{option}: {error}") from None


def _positive(option: str, text: str, unit: str) -> float:
    value = _value(option, text, unit)
    if not value > 0.0:
        raise InputError(
            options.COMMAND_LINE, "is not allowed", key=option, value=text, allowed=f"> 0 {unit}"
        )
    return value


def _rows(made: Baseline, before: str) -> dict[str, Any]:
    modulus, friction = made.modulus, made.friction
    strain = made.band.strain
    rows: dict[str, Any] = {
        f"{before}tests": len(made.tests),
        f"{before}strains": f"{strain[0]:.4g} to {strain[-1]:.4g}",
        f"{before}mean E_a": f"{modulus.mean / 1e3:.4g} ± {2.0 * modulus.mean_sigma / 1e3:.2g} kPa (k = 2)",
    }
    offsets = [one.offset for one in made.tests]
    if any(offsets):
        rows[f"{before}zero of strain"] = f"{min(offsets):.4g} to {max(offsets):.4g}"
    if friction is not None:
        ratio = friction.ratio
        rows[f"{before}stiffer by end friction"] = f"{ratio.min():.3f} to {ratio.max():.3f} times"
        if friction.coefficient is not None:
            sigma = f" ± {2.0 * friction.sigma:.2g} (k = 2)" if friction.sigma > 0.0 else ""
            rows[f"{before}friction"] = f"{friction.coefficient:.3g}{sigma}"
        closure = f"{100.0 * friction.closure:.2g} % from the tests (rms)"
        rows[f"{before}corrected curve simulated"] = closure
        rows[f"{before}kinetic over elastic energy"] = f"{friction.slow.kinetic_share:.1e} at most"
    return rows


def _said(made: Baseline) -> dict[str, Any]:
    modulus, friction = made.modulus, made.friction
    parts = {name: float(np.max(part / made.band.stress)) for name, part in made.band.parts().items()}
    return {
        "tests": len(made.tests),
        "strain_range": [float(made.band.strain[0]), float(made.band.strain[-1])],
        "mean_E_a": {"value": modulus.mean, "sigma": modulus.mean_sigma, "unit": "Pa"},
        "zero_of_strain": [one.offset for one in made.tests],
        "largest_relative_sigma": parts,
        "friction": None
        if friction is None
        else {
            "coefficient": friction.coefficient,
            "sigma": friction.sigma,
            "ratio": [float(friction.ratio.min()), float(friction.ratio.max())],
            "misfit": friction.misfit,
            "closure": friction.closure,
            "kinetic_share": friction.slow.kinetic_share,
            "face_difference": friction.slow.face_difference,
            "share_past_data": friction.slow.past_data,
        },
        "remarks": list(made.remarks),
    }

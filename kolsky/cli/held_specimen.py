"""The part of `kolsky material fit` that takes a specimen with held ends: inverse finite elements."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kolsky.base.errors import InputError
from kolsky.cli import texts

if TYPE_CHECKING:
    from kolsky.base.apparatus import Specimen
    from kolsky.material.end_friction.problem import ModelFit
    from kolsky.material.fits.homogeneous_test import HomogeneousTest

DEFAULT_LAWS = ("neo_hookean", "reduced_polynomial", "yeoh", "mooney_rivlin", "ogden1")
"""Laws that are tried if none is named: those that a single compression test may determine."""

SAME_SIZE = 1e-3
"""Relative difference up to which two sizes of one specimen are the same, written with fewer digits [-]."""


def size_of(text: str) -> "Specimen":
    """ "9.5 mm x 6.5 mm" as the undeformed size of a cylinder."""
    from kolsky.base.apparatus import Specimen

    diameter, cross, length = text.partition(" x ")
    if not cross:
        raise InputError(
            texts.COMMAND_LINE, f"--specimen {text!r} cannot be read", cure='write "9.5 mm x 6.5 mm"'
        )
    return Specimen(
        diameter=texts.physical("--specimen", diameter, "m", positive=True),
        length=texts.physical("--specimen", length, "m", positive=True),
        density=0.0,
    )


def agreed_size(
    size: "Specimen", length: float | None, area: float | None, unused: dict[str, bool]
) -> tuple[float, float]:
    """Length [m] and cross-section [m^2] of the tests: the cylinder's, which others must agree with.

    Raises
    ------
    InputError
        If `--length`, `--area` or `--diameter` is another, or an option was given that such a fit has no use
        for: the names in `unused` that are True.
    """
    for option, mine, own, unit in (
        ("--length", length, size.length, "m"),
        ("--area or --diameter", area, size.area, "m^2"),
    ):
        if mine is not None and abs(mine / own - 1.0) > SAME_SIZE:
            raise InputError(
                texts.COMMAND_LINE,
                f"{option} gives {mine:.6g} {unit}, --specimen {own:.6g} {unit}",
                cure=f"leave {option} out: the size of --specimen is taken",
            )
    given = [name for name, used in unused.items() if used]
    if given:
        raise InputError(
            texts.COMMAND_LINE,
            f"{', '.join(given)} does not go with --specimen",
            cure="leave it out: repeats are averaged, all laws start from one curve and are free of bounds",
        )
    return size.length, size.area


def fit_held_specimen(
    tests: Sequence["HomogeneousTest"],
    *,
    size: "Specimen",
    ends: str,
    laws: tuple[str, ...],
    poisson: float | None,
    hashes: dict[str, str],
    folder: Path,
    as_json: bool,
) -> None:
    """Fit laws to repeats of one compression test with held or rubbing ends; write and print the constants.

    The tests are apparent nominal stresses, tension-positive.
    """
    import numpy as np

    from kolsky.base.files import filling, write_table
    from kolsky.cli.reference_curve_options import ends_of
    from kolsky.cli.terminal import print_result
    from kolsky.material.curves.uniaxial import UniaxialTest
    from kolsky.material.end_friction.problem import CorrectionNumerics
    from kolsky.material.end_friction.specimen_fit import fit_specimen
    from kolsky.material.fits.modes import Mode
    from kolsky.material.reference_curve import Treatment, reference_curve
    from kolsky.material.reference_curve_files import model_summary

    held = ends_of(ends, 0.0)
    if held is None or ends == "free":
        raise InputError(
            texts.COMMAND_LINE, "--specimen needs --ends", cure="write bonded, rough or Coulomb's coefficient"
        )
    for test in tests:
        if test.mode is not Mode.UNIAXIAL or test.strain.min() > -1e-9:
            raise InputError(texts.COMMAND_LINE, f"{test.name} is no compression test", cure="leave it out")
    pushed = [UniaxialTest(t.name, -t.strain, -t.stress, compression=True) for t in tests]
    try:
        mean = reference_curve(pushed, Treatment(points=40))
        found = fit_specimen(
            mean.band,
            size,
            held,
            laws or DEFAULT_LAWS,
            numerics=CorrectionNumerics(poisson=0.499 if poisson is None else poisson),
        )
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE, str(error), cure="correct the option; `--help` shows each with its unit"
        ) from error
    said: dict[str, Any] = {"inputs": hashes, "ends": ends, "laws": [model_summary(one) for one in found]}
    fitted = [one for one in found if not one.reason]
    with filling(folder) as partial:
        (partial / "specimen.json").write_text(
            json.dumps(said, indent=2, allow_nan=False) + "\n", encoding="utf-8"
        )
        write_table(partial / "specimen_constants.csv", _constants(fitted))
        curves: dict[str, list[Any]] = {
            "nominal strain (1)": mean.band.strain.tolist(),
            "apparent nominal stress (Pa)": mean.band.stress.tolist(),
        }
        curves |= {f"{one.name} without end friction (Pa)": np.asarray(one.stress).tolist() for one in fitted}
        write_table(partial / "specimen_curves.csv", curves)
    print_result(
        {},
        said if as_json else None,
        answers=_lines(fitted),
        rest={"constants": folder / "specimen_constants.csv"},
        warnings=[*mean.remarks, *(f"{one.name} has no fit: {one.reason}" for one in found if one.reason)],
    )


def _constants(fitted: Sequence["ModelFit"]) -> dict[str, list[Any]]:
    rows = [(one, name) for one in fitted for name in one.constants]
    return {
        "law": [one.name for one, _ in rows],
        "constant": [name for _, name in rows],
        "value (SI)": [one.constants[name] for one, name in rows],
        "u (SI)": [one.sigma[name] for one, name in rows],
        "weight of the law": [one.weight for one, _ in rows],
        "misfit (rms)": [one.misfit for one, _ in rows],
    }


def _lines(fitted: Sequence["ModelFit"]) -> list[str]:
    """Laws with their constants and the strongest correlation, for a terminal."""
    import numpy as np

    lines = []
    for one in fitted:
        lines.append(f"{one.name}: {100.0 * one.misfit:.2g} % from the test (rms), weight {one.weight:.2g}")
        for name, value in one.constants.items():
            lines.append(f"  {name} = {value:.5g} ± {2.0 * one.sigma[name]:.2g} (SI, k = 2)")
        off = np.abs(np.triu(one.correlation, 1))
        if off.size > 1 and off.max() > 0.0:
            i, j = np.unravel_index(int(np.argmax(off)), off.shape)
            names = list(one.constants)
            lines.append(f"  correlation of {names[i]} and {names[j]}: {one.correlation[i, j]:+.3f}")
    return lines

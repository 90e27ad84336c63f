"""What holding the other free parameters would have given, as a line of a terminal or a page."""

from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.uncertainty_results import HeldAnswer
from kolsky.report import numbers
from kolsky.report.nomenclature import factor_of, name_of


def held_line(held: HeldAnswer, *, written: bool = False) -> str:
    """Return the held answer with its k = 2 uncertainty, what was held, and the misfit there and when free.

    Parameters
    ----------
    held
        In SI.
    written
        Symbols as pages write them; else as the command line does.
    """
    value, uncertainty = numbers.measured(held.value, 2.0 * held.sigma)
    named = []
    for name, number in held.held.items():
        p = PARAMETERS[name]
        unit = name_of(name, p.unit).unit
        symbol = p.written if written else p.symbol
        named.append(f"{symbol} = {number * factor_of(name):.6g}" + ("" if unit == "1" else f" {unit}"))
    there, free = (
        _misfits(*pair)
        for pair in (
            (held.chi2_force, held.chi2_shape),
            (held.free_chi2_force, held.free_chi2_shape),
        )
    )
    return f"{value} ± {uncertainty} with {', '.join(named)}; chi2/n {there} (free: {free})"


def _misfits(force: float, shape: float) -> str:
    """Chi-square a value of the force, and of the outline where there is one."""
    said = f"force {force:.3g}"
    return said if shape != shape else f"{said}, outline {shape:.3g}"

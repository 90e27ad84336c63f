"""Words for the API, symbols for figures and pages: one list."""

import re
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Name:
    """How a parameter is written."""

    symbol: str
    """Symbol in plain text, e.g. "m"."""
    tex: str
    """Symbol for figures (mathtext without dollar signs)."""
    words: str
    """What it is."""
    unit: str
    """Unit in which it is shown, "1" if none."""
    factor: float = 1.0
    """Shown number over SI number."""


_NAMES = {
    "stiffness_factor": Name("m", "m", "stiffness factor, dynamic over quasi-static modulus", "1"),
    "friction": Name("f", "f", "Coulomb friction between specimen and platens", "1"),
    "poisson": Name("ν", r"\nu", "Poisson’s ratio of the initial state", "1"),
    "damping": Name("β", r"\beta", "stiffness-proportional damping", "µs", 1e6),
    "release_stress": Name("σ_b", r"\sigma_b", "tensile stress at which a bonded face lets go", "kPa", 1e-3),
    "force_discrepancy": Name("τ_F", r"\tau_F", "discrepancy of the force", "N"),
    "shape_discrepancy": Name("τ_Z", r"\tau_Z", "discrepancy of the outline", "µm", 1e6),
    "mass_damping": Name("α", r"\alpha", "mass-proportional damping", "1/s"),
}

_ROUTES = {
    "joint": "joint χ²",
    "force only": "force χ² only",
    "shape only": "shape χ² only",
    "paper": "cost Φ, Eq. (M.5)",
}


def name_of(parameter: str, unit: str | None = None) -> Name:
    """How a parameter is written; one that is not in the list is written as it is called."""
    if parameter in _NAMES:
        return _NAMES[parameter]
    words = parameter.replace("_", " ")
    escaped = words.replace("\\", " ").replace("$", " ").replace("^", " ").replace(" ", r"\ ")
    return Name(words, rf"\mathrm{{{escaped}}}", words, unit or "SI")


def short(parameter: str) -> str:
    """A parameter inside a sentence: its first words and its symbol, e.g. "stiffness factor m"."""
    name = name_of(parameter)
    words = re.split(r",| between| of the initial| at which", name.words)[0]
    return words if name.symbol == words else f"{words} {name.symbol}"


def in_words(text: str, names: Iterable[str] = ()) -> str:
    """A sentence with `short` for every parameter that it calls as the API does.

    Parameters
    ----------
    text
        The sentence.
    names
        Parameters to look for, beside those whose API name is no word of English: "friction" can be meant as
        the word.
    """
    known = {*names, *(name for name in _NAMES if "_" in name)}
    called = "|".join(sorted(map(re.escape, known), key=len, reverse=True))
    return re.sub(rf"(?<![\w.\-\[])({called})(?![\w\]])", lambda found: short(found[1]), text)


def factor_of(parameter: str) -> float:
    """Shown number over SI number."""
    return _NAMES[parameter].factor if parameter in _NAMES else 1.0


def axis_label(parameter: str, unit: str | None = None) -> str:
    """Label of an axis for a parameter: words, symbol and unit in brackets."""
    name = name_of(parameter, unit)
    words = name.words.split(",")[0].split(" between")[0]
    unit = "–" if name.unit == "1" else name.unit
    if name.symbol == words:
        return f"{words.capitalize()} ({unit})"
    return f"{words[0].upper()}{words[1:]} ${name.tex}$ ({unit})"


def route_label(route: str) -> str:
    """What a route of `Identification.routes` minimises."""
    return _ROUTES.get(route, route)

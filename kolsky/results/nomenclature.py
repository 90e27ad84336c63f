"""Symbols, units and words of parameters, routes and stages, and typesetting of text for a terminal."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from markupsafe import Markup, escape

from kolsky.inverse.parameters import PARAMETERS
from kolsky.results import numbers


@dataclass(frozen=True)
class WrittenName:
    """Symbol, words and display unit of a parameter."""

    symbol: str
    """Symbol in plain text, e.g. "m"."""
    tex: str
    """Symbol for figures (mathtext without dollar signs)."""
    words: str
    """Words, e.g. "stiffness factor"."""
    unit: str
    """Unit of its display, "1" if none."""
    factor: float = 1.0
    """Shown number over SI number."""


_NAMES = {
    "force_discrepancy": WrittenName("τ_F", r"\tau_F", "discrepancy of the force", "N"),
    "shape_discrepancy": WrittenName("τ_Z", r"\tau_Z", "discrepancy of the outline", "µm", 1e6),
}


def _name_entry(parameter: str) -> WrittenName | None:
    if parameter in PARAMETERS:
        p = PARAMETERS[parameter]
        return WrittenName(p.written, p.tex, p.words, p.shown_unit, p.shown_factor)
    return _NAMES.get(parameter)


_ROUTES = {
    "joint": "joint χ²",
    "force only": "force χ² only",
    "shape only": "outline χ² only",
    "paper": "cost Φ, Eq. (M.5)",
}


def name_of(parameter: str, unit: str | None = None) -> WrittenName:
    """Return symbol and words of a parameter. An unknown parameter is written as its key."""
    known = _name_entry(parameter)
    if known is not None:
        return known
    words = parameter.replace("_", " ")
    escaped = words.replace("\\", " ").replace("$", " ").replace("^", " ").replace(" ", r"\ ")
    return WrittenName(words, rf"\mathrm{{{escaped}}}", words, unit or "SI")


def short(parameter: str) -> str:
    """Return a parameter for use in a sentence: first words and symbol, e.g. "stiffness factor m"."""
    name = name_of(parameter)
    words = re.split(r",| between| of the initial| at which", name.words)[0]
    return words if name.symbol == words else f"{words} {name.symbol}"


def in_words(text: str, names: Iterable[str] = ()) -> str:
    """Return a sentence in which every API name of a parameter is replaced by `short`.

    ``names``: those whose names may be ordinary words, such as "friction".
    """
    known = {*names, *(name for name in (*PARAMETERS, *_NAMES) if "_" in name)}
    called = "|".join(sorted(map(re.escape, known), key=len, reverse=True))
    return re.sub(rf"(?<![\w.\-\[])({called})(?![\w\]])", lambda found: short(found[1]), text)


def heading(parameter: str, unit: str = "1", words: str = "{}") -> Markup:
    """Return the heading of a column: words with a parameter's symbol for "{}", and a unit in brackets."""
    symbol = Markup("<var>{}</var>").format(with_subscripts(name_of(parameter).symbol))
    return Markup(words).format(symbol) + ("" if unit in ("", "1") else f" ({unit})")


def constant_symbol(name: str) -> str:
    """Return the symbol of a law's constant for figures: ν for "poisson", C10 with a subscript."""
    greek = {"poisson": r"\nu", "mu": r"\mu", "alpha": r"\alpha", "lam": r"\lambda"}
    parts = re.fullmatch(r"(poisson|alpha|lam|mu|[A-Za-z])_?(\d*)", name)
    if parts is None:
        return f"${name_of(name).tex}$"
    index = rf"_{{{parts[2]}}}" if parts[2] else ""
    return f"${greek.get(parts[1], parts[1])}{index}$"


def factor_of(parameter: str) -> float:
    """Return the displayed number over the SI number."""
    known = _name_entry(parameter)
    return 1.0 if known is None else known.factor


def axis_label(parameter: str, unit: str | None = None) -> str:
    """Return the axis label of a parameter: words, symbol and unit in brackets."""
    name = name_of(parameter, unit)
    words = name.words.split(",")[0].split(" between")[0]
    unit = "–" if name.unit == "1" else name.unit
    if name.symbol == words:
        return f"{words.capitalize()} ({unit})"
    return f"{words[0].upper()}{words[1:]} ${name.tex}$ ({unit})"


def route_label(route: str) -> str:
    """Return the objective of a route of `Identification.routes` in words."""
    return _ROUTES.get(route, route)


STAGES = {
    "compile": "compiling, once on this machine",
    "design": "design",
    "refinement": "design near the optimum",
    "check": "check on the refined mesh",
    "noise": "replicates of the input noise",
    "profile": "profile likelihoods",
    "posterior": "posterior",
    "choices": "other choices",
    "systematic": "declared uncertainties",
    "inputs": "effect of the inputs",
    "causes": "inputs that may be wrong",
    "simulation": "simulation",
    "sweep": "sweep",
    "rates": "speeds of the flyer",
    "calibration": "calibration pictures",
    "specimen, camera 0": "specimen in camera 0",
    "specimen, camera 1": "specimen in camera 1",
    "flyer, camera 0": "flyer in camera 0",
    "flyer, camera 1": "flyer in camera 1",
    "waves": "waves",
    "repeats": "tests",
    "rate": "shots",
}
"""Stages of the work."""


_RAISED_DIGITS = str.maketrans("+-0123456789", "⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def typeset(text: str) -> str:
    """Return a sentence or a value with typographic signs: "-1.2e-05 +- 3 us" is "−1.2 × 10⁻⁵ ± 3 µs".

    A hyphen before a digit becomes a minus sign, because a line may break after a hyphen. A hyphen inside a
    word does not change. An "e" is an exponent only if a sign follows. Otherwise it may be a digit of a
    checksum.
    """
    text = re.sub(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([+-]\d{2,3})(?!\w)", _raised_power, text)
    text = re.sub(r"\^(-?\d+)", lambda found: found[1].translate(_RAISED_DIGITS), text)
    text = re.sub(r"(?<=\d )u(?=[sm]\b)", "µ", text)
    return re.sub(r"(?<!\w)-(?=\d)", numbers.MINUS, text.replace("+-", "±"))


def _raised_power(found: re.Match[str]) -> str:
    return f"{found[1]} × 10{str(int(found[2])).translate(_RAISED_DIGITS)}"


def upper_first(text: str) -> str:
    """Return a sentence with its first letter in upper case."""
    return text[:1].upper() + text[1:]


def with_subscripts(text: str) -> Markup:
    """Return text for HTML in which Φ_F, τ_Z, σ_b have subscripts; a "_" inside a word is unchanged."""
    return Markup(re.sub(r"(?<!\w)([^\W\d_])_(\w)(?!\w)", r"\1<sub>\2</sub>", str(escape(text))))

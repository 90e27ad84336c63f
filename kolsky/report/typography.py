"""Typesetting of text that was written for a terminal: signs, powers, units, subscripts."""

import re

from markupsafe import Markup, escape

from kolsky.report import numbers

_RAISED = str.maketrans("+-0123456789", "⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def typeset(text: str) -> str:
    """Return a sentence or a value with typographic signs: "-1.2e-05 +- 3 us" is "−1.2 × 10⁻⁵ ± 3 µs".

    A hyphen before a digit is a sign, so that no line breaks after it; one inside a word stays. An "e" needs
    a sign after it, or it would be a digit of a checksum.
    """
    text = re.sub(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([+-]\d{2,3})(?!\w)", _power, text)
    text = re.sub(r"\^(-?\d+)", lambda found: found[1].translate(_RAISED), text)
    text = re.sub(r"(?<=\d )u(?=[sm]\b)", "µ", text)
    return re.sub(r"(?<!\w)-(?=\d)", numbers.MINUS, text.replace("+-", "±"))


def _power(found: re.Match[str]) -> str:
    return f"{found[1]} × 10{str(int(found[2])).translate(_RAISED)}"


def upper_first(text: str) -> str:
    """Return a sentence with its first letter in upper case."""
    return text[:1].upper() + text[1:]


def with_subscripts(text: str) -> Markup:
    """Return text for HTML in which Φ_F, τ_Z, σ_b have real subscripts; a "_" inside a word stays."""
    return Markup(re.sub(r"(?<!\w)([^\W\d_])_(\w)(?!\w)", r"\1<sub>\2</sub>", str(escape(text))))

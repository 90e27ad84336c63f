"""Causes in words: what is likely to be wrong, by how much, and what to check."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from kolsky.diagnosis.cause_inputs import CANDIDATES
from kolsky.diagnosis.thresholds import UNEXPLAINED
from kolsky.inverse.cause_results import CauseFinding

if TYPE_CHECKING:
    from kolsky.diagnosis.causes import CauseAnalysis


def cause_warnings(analysis: CauseAnalysis, *, explained: bool = False) -> Iterator[str]:
    """Say which inputs are likely to be wrong, the most likely first, or that none explains the misfit.

    Parameters
    ----------
    analysis
        All inputs that were tried.
    explained
        Whether the model explains force and outline on the refined mesh: then there is nothing that no input
        explains.
    """
    if analysis.lost:
        yield f"which input may be wrong could not be tried: {analysis.lost}"
    checks = {c.key: c.check for c in CANDIDATES}
    for finding in analysis.named:
        told = ", ".join(f"{name} = {value:.5g}" for name, value in finding.parameters.items())
        other = f" (the data cannot tell it from {' or '.join(finding.alike)})" if finding.alike else ""
        also, whole = ("", "the misfit")
        if finding.beside:
            also, whole = f"beside {finding.beside}, ", "what is left of it"
        yield (
            f"{also}{sentence(finding)} explains {percent(finding.explained)} of {whole}{other}: "
            f"{checks.get(finding.key, finding.key)}; with it {told}"
        )
    if not explained and not analysis.named and (analysis.misfits > UNEXPLAINED).any():
        yield (
            "no single change of an input explains the misfit (the residual is "
            f"{' and '.join(f'{x**0.5:.2g}' for x in analysis.misfits)} times what a right model leaves, of "
            "force and outline): more than one input may be wrong, or the model"
        )


SHOWN = {"s": (1e6, "us"), "m": (1e6, "um")}
"""Factor and unit in which a value is written."""


def sentence(finding: CauseFinding) -> str:
    """The change in words: "a force gain of 0.498 ± 0.003 (k = 2)"."""
    factor, unit = SHOWN.get(finding.unit, (1.0, "" if finding.unit == "1" else finding.unit))
    half = 2.0 * factor * finding.sigma
    value = factor * finding.value
    digits = max(0, 1 - int(np.floor(np.log10(half)))) if isfinite(half) and half > 0.0 else 4
    written = f"{value:.{min(digits, 7)}f}"
    if isfinite(half) and half > 0.0:
        written += f" ± {half:.{min(digits, 7)}f}"
    return f"{finding.words} of {written} {unit}".rstrip() + " (k = 2)"


def percent(share: float) -> str:
    """A share in percent, with as many digits as tell it from 100 %."""
    return f"{100.0 * share:.1f} %" if share > 0.95 else f"{100.0 * share:.0f} %"

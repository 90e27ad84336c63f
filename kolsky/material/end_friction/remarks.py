"""What a reader must know of a correction: why no law meets a test, and laws that it cannot tell apart."""

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.material.end_friction.fits import NOISE_LEFT, Found
from kolsky.material.end_friction.problem import MeasuredSpecimen

LARGEST_MISFIT = 0.03
"""Root mean square misfit of the best law from which on a correction is refused [-]."""
DISAGREE = 0.02
"""Difference of two laws that meet the test alike from which on it is said [-]."""


def cause_of_misfit(best: Found, test: MeasuredSpecimen) -> str:
    """Why no law meets a test, from where it is missed most."""
    off = best.off
    worst = int(np.argmax(np.abs(off)))
    share = worst / max(1, off.size - 1)
    guess = "a toe, or a force whose zero is off" if share < 0.2 else "ends that did not hold as declared"
    if share > 0.8:
        guess = "ends that did not hold as declared, a side that landed otherwise, or damage"
    return (
        f"no law meets the test: the best, {best.model.name}, misses it by {100.0 * best.misfit:.2g} %"
        f" (rms), most at strain {test.strain[worst]:.3g} ({100.0 * off[worst]:+.1f} %), at most"
        f" {100.0 * LARGEST_MISFIT:g} % is allowed; likely {guess}"
    )


def remarks_on(
    found: list[Found], weights: FloatArray, logs: FloatArray, test: MeasuredSpecimen
) -> tuple[str, ...]:
    """Misfits that are no noise, and laws that the test cannot tell apart."""
    best = int(np.argmax(weights))
    said = []
    n = test.strain.size
    if found[best].chi2 > NOISE_LEFT * n:
        said.append(
            f"the best law, {found[best].model.name}, misses the test by"
            f" {100.0 * found[best].misfit:.2g} % (rms), more than its noise; the band holds it"
        )
    alike = [k for k, one in enumerate(found) if one.chi2 < NOISE_LEFT * n]
    off = {k: float(np.abs(logs[k] - logs[best]).max()) for k in alike}
    if off and max(off.values()) > DISAGREE:
        k = max(off, key=lambda one: off[one])
        said.append(
            f"{found[k].model.name} meets the test within its noise too and differs from"
            f" {found[best].model.name} by {100.0 * off[k]:.2g} %: the choice between them rests on their"
            f" number of constants (weight {weights[k]:.2g}); a test in another mode or the radius at"
            " mid-height would tell"
        )
    return tuple(said)

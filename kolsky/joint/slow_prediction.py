"""What slow tests would have measured of a material: the long-term law times a factor, and what relaxes."""

from collections.abc import Mapping

import numpy as np

from explicit.materials import MaterialLaw
from explicit.relaxation import BergstromBoyce, PronySeries, bergstrom_boyce_stress
from kolsky.base.arrays import FloatArray
from kolsky.base.relaxation import NETWORK, Relaxation, prony_names
from kolsky.inverse.parameters import MOVED
from kolsky.joint.records import Slow
from kolsky.material.relaxation.evidence import HistoryTest, RateModel, ScaledLaw


def measured(slow: Slow) -> tuple[FloatArray, FloatArray]:
    """Values of all tests in a row, and their standard uncertainties; samples of no test are left out."""
    if not slow:
        return np.zeros(0), np.zeros(0)
    known = [np.isfinite(one.sigma) for one in slow]
    values = [one.values[k] for one, k in zip(slow, known, strict=True)]
    sigma = [one.sigma[k] for one, k in zip(slow, known, strict=True)]
    return np.concatenate(values), np.concatenate(sigma)


def predicted(
    slow: Slow, law: MaterialLaw, relaxation: Relaxation | None, values: Mapping[str, float]
) -> FloatArray:
    """The same values for a material, shape [n].

    Parameters
    ----------
    slow
        The tests.
    law
        The long-term law at factor 1.
    relaxation
        What relaxes as it is declared; None if nothing does.
    values
        Constants by parameter name; the declared ones where a name is missing, and factor 1.

    Raises
    ------
    ValueError
        If a network of Bergstrom and Boyce is to be held against an oscillation.
    """
    if not slow:
        return np.zeros(0)
    factor = float(values.get(MOVED, 1.0))
    rows = []
    for one in slow:
        if relaxation is not None and relaxation.kind == "bergstrom_boyce":
            if not isinstance(one, HistoryTest):
                raise ValueError(
                    f"{one.label}: an oscillation has no storage and loss modulus in a network that flows as "
                    "a power of the stress: leave the test out, or fit a Prony series"
                )
            network = BergstromBoyce(*(float(values.get(n, relaxation.values[n])) for n in NETWORK))
            whole = bergstrom_boyce_stress(ScaledLaw(law, factor), network, one.time, one.stretch)[0]
        else:
            whole = one.predict(law, [RateModel(factor, _series(relaxation, values))])[0]
        rows.append(whole[np.isfinite(one.sigma)])
    return np.concatenate(rows)


def _series(relaxation: Relaxation | None, values: Mapping[str, float]) -> PronySeries:
    if relaxation is None:
        return PronySeries((), ())
    n = relaxation.branches
    constants = [float(values.get(name, relaxation.values[name])) for name in prony_names(n)]
    return PronySeries(tuple(constants[:n]), tuple(constants[n:]))

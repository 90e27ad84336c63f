"""What a result file holds of the fit: residuals, clocks, causes of a misfit, the answer with others held."""

from kolsky.base.hdf5_items import (
    COLLECTION,
    OWN,
    Flags,
    Floats,
    Integers,
    Text,
    numbers,
)
from kolsky.base.hdf5_records import Record
from kolsky.inverse.cause_results import CauseFinding
from kolsky.inverse.fit_results import ClockLag, FitQuality
from kolsky.inverse.uncertainty_results import (
    HeldAnswer,
)

HELD = Record(
    HeldAnswer,
    COLLECTION,
    {
        "name": Text(),
        "held": numbers("SI"),
        "value": Floats("SI"),
        "sigma": Floats("SI"),
        "chi2_force": Floats("1"),
        "chi2_shape": Floats("1"),
        "free_chi2_force": Floats("1"),
        "free_chi2_shape": Floats("1"),
    },
)
FIT = Record(
    FitQuality,
    COLLECTION,
    {
        "channel": Text(),
        "unit": Text(),
        "values": Integers("1"),
        "residual": Floats(OWN),
        "predicted": numbers(OWN),
        "peak": Floats(OWN),
        "slow_residual": Floats(OWN),
        "slow_expected": Floats(OWN),
        "chi2": Floats("1"),
        "discrepancy_share": Floats("1"),
        "correlation": Floats("1"),
        "whiteness": Floats("1"),
        "weight": numbers("1"),
        "limit": Floats("1"),
        "slow_limit": Floats("1"),
    },
    derived={
        "expected": Floats(OWN),
        "excess": Floats("1"),
        "slow_excess": Floats("1"),
        "explained": Flags("1"),
    },
)
CLOCK = Record(
    ClockLag,
    COLLECTION,
    {
        "recording": Text(),
        "lag": Floats("s"),
        "sigma": Floats("s"),
        "evidence": Floats("1"),
        "explains": Flags("1"),
        "file": Text(),
        "key": Text(),
    },
)
CAUSE = Record(
    CauseFinding,
    COLLECTION,
    {
        "key": Text(),
        "words": Text(),
        "unit": Text(),
        "exact": Floats(OWN),
        "value": Floats(OWN),
        "sigma": Floats(OWN),
        "explained": Floats("1"),
        "evidence": Floats("1"),
        "probability": Floats("1"),
        "parameters": numbers("SI"),
        "sigmas": numbers("SI"),
        "named": Flags("1"),
        "alike": Text("alike"),
        "beside": Text(),
        "status": Text(),
        "declared_sigma": Floats(OWN, optional=True),
        "solved": numbers("SI"),
        "solved_sigmas": numbers("SI"),
    },
)

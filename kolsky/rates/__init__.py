"""Several identified shots: their mean stiffness, the scatter between them, and how it goes with the rate."""

from kolsky.rates.comparison import STRAINS, compare
from kolsky.rates.mixed import MixedFit, mixed_fit
from kolsky.rates.pooled import Pooled, pool
from kolsky.rates.records import GroupRates, RatedShot, RateReport
from kolsky.rates.regression import Slope, SlopeVerdict, slope

__all__ = [
    "STRAINS",
    "GroupRates",
    "MixedFit",
    "Pooled",
    "RateReport",
    "RatedShot",
    "Slope",
    "SlopeVerdict",
    "compare",
    "mixed_fit",
    "pool",
    "slope",
]

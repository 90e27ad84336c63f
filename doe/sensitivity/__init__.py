"""Sensitivity: variance-based indices, elementary effects, information of planned data; no physics."""

from doe.sensitivity.elementary_effects import ElementaryEffects, morris
from doe.sensitivity.histories import HistoryIndices, history_indices
from doe.sensitivity.information import LinearData
from doe.sensitivity.placement import Placement, best_groups, best_window
from doe.sensitivity.variance import SobolIndices, sobol_indices

__all__ = [
    "ElementaryEffects",
    "HistoryIndices",
    "LinearData",
    "Placement",
    "SobolIndices",
    "best_groups",
    "best_window",
    "history_indices",
    "morris",
    "sobol_indices",
]

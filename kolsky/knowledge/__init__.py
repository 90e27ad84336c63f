"""What a shot's data can tell about its parameters: profiles, verdicts, declared uncertainties, posterior."""

from kolsky.knowledge.records import (
    Declaration,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Variation,
)

__all__ = ["Declaration", "PairMap", "ParameterProfile", "PosteriorSummary", "Variation"]

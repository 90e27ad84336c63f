"""Elastic bars around the specimen: a mesh of platens, transducers and bars, and one-dimensional waves."""

from explicit.bars.coupling import simulate_test
from explicit.bars.elastic import PulseResponse, elastic_bar, pulse_on_bars, pulse_on_mesh
from explicit.bars.lines import (
    Apparatus,
    Joint,
    PulseShaper,
    Section,
    find_events,
    integrate_test,
    loaded_line,
    section_force,
)

__all__ = [
    "Apparatus",
    "Joint",
    "PulseResponse",
    "PulseShaper",
    "Section",
    "elastic_bar",
    "find_events",
    "integrate_test",
    "loaded_line",
    "pulse_on_bars",
    "pulse_on_mesh",
    "section_force",
    "simulate_test",
]

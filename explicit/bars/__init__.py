"""Elastic bars around the specimen: a mesh of platens, transducers and bars, and one-dimensional waves."""

from explicit.bars.contacts import Joint, PulseShaper
from explicit.bars.coupling import couple
from explicit.bars.elastic import elastic_bar
from explicit.bars.events import find_events
from explicit.bars.flyer_test import simulate_test
from explicit.bars.impact import Apparatus, integrate_test
from explicit.bars.lines import loaded_line, section_force
from explicit.bars.pulse import PulseResponse, pulse_on_bars, pulse_on_mesh
from explicit.bars.sections import Section

__all__ = [
    "Apparatus",
    "Joint",
    "PulseResponse",
    "PulseShaper",
    "Section",
    "couple",
    "elastic_bar",
    "find_events",
    "integrate_test",
    "loaded_line",
    "pulse_on_bars",
    "pulse_on_mesh",
    "section_force",
    "simulate_test",
]

"""Elastic bars around the specimen: a mesh of platens, transducers and bars, and one-dimensional waves."""

from explicit.bars.contacts import Joint, PulseShaper
from explicit.bars.coupling import Coupled, couple
from explicit.bars.elastic import ElasticBar, ElasticHistory, elastic_bar
from explicit.bars.events import Events, find_events
from explicit.bars.flyer_test import FlyerTest, simulate_test
from explicit.bars.impact import Apparatus, FlightHistory, march_test
from explicit.bars.lines import LineHistory, loaded_line, section_force
from explicit.bars.sections import Section

__all__ = [
    "Apparatus",
    "Coupled",
    "ElasticBar",
    "ElasticHistory",
    "Events",
    "FlightHistory",
    "FlyerTest",
    "Joint",
    "LineHistory",
    "PulseShaper",
    "Section",
    "couple",
    "elastic_bar",
    "find_events",
    "loaded_line",
    "march_test",
    "section_force",
    "simulate_test",
]

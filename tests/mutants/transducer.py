"""Faults of the transducer behind the platen's face."""

from tests.mutants.fault import Fault

TESTS = ("tests/unit/inverse/test_transducer_place.py",)

FAULTS = (
    Fault(
        name="the transducer's delay is that of the whole round trip",
        file="kolsky/inverse/transducer_place.py",
        right="delay = shot.transducer_depth / bar.wave_speed",
        wrong="delay = 2.0 * shot.transducer_depth / bar.wave_speed",
        tests=TESTS,
    ),
    Fault(
        name="the impulse stays at the face where the force is at the transducer",
        file="kolsky/inverse/transducer_place.py",
        right="impulse_transmission=seen(response.impulse_transmission),",
        wrong="impulse_transmission=response.impulse_transmission,",
        tests=TESTS,
    ),
)

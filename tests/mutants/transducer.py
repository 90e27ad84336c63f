"""Faults of the transducer behind the platen's face."""

from tests.mutants.fault import Fault

TESTS = ("tests/unit/inverse/test_transducer_place.py",)

FAULTS = (
    Fault(
        name="the transducer's delay is that of the whole round trip",
        file="kolsky/inverse/forward.py",
        right="delay = shot.transducer_depth / bar.wave_speed",
        wrong="delay = 2.0 * shot.transducer_depth / bar.wave_speed",
        tests=TESTS,
    ),
    Fault(
        name="the impulse stays at the face where the force is at the transducer",
        file="kolsky/inverse/forward.py",
        right="impulse_transmission=seen(response.impulse_transmission),",
        wrong="impulse_transmission=response.impulse_transmission,",
        tests=TESTS,
    ),
    Fault(
        name="the pulses' impulse lost in the first half step",
        file="explicit/bars/elastic.py",
        right="force[:, 1] += force[:, 0]",
        wrong="force[:, 1] += 0.0 * force[:, 0]",
        tests=("tests/unit/explicit/test_pulse.py",),
    ),
    Fault(
        name="a pulse that comes a step late",
        file="explicit/bars/elastic.py",
        right="axes=1)[:, 1 : n + 1])",
        wrong="axes=1)[:, :n])",
        tests=("tests/unit/explicit/test_pulse.py",),
    ),
    Fault(
        name="the mass before the transducer counted to the far end",
        file="kolsky/inverse/forward.py",
        right="min(part.length, max(rest, 0.0))",
        wrong="part.length",
        tests=(
            "tests/unit/inverse/test_surroundings.py::test_an_elastic_flyer_is_the_rigid_one_of_its_mass_where_waves_are_long",
        ),
    ),
    Fault(
        name="the inertia before the transducer with the wrong sign",
        file="kolsky/inverse/forward.py",
        right="force_flyer=force + mass * push",
        wrong="force_flyer=force - mass * push",
        tests=(
            "tests/unit/inverse/test_surroundings.py::test_a_rigid_flyer_adds_the_inertia_of_what_lies_before_its_transducer",
        ),
    ),
    Fault(
        name="a flyer's face that runs ahead of the place that is seen",
        file="kolsky/inverse/forward.py",
        right="position=measured[m].position - row",
        wrong="position=measured[m].position + row",
        tests=("tests/unit/inverse/test_surroundings.py::test_the_face_of_an_elastic_flyer_gives_way",),
    ),
    Fault(
        name="the transmitted force's scale error in the incident force too",
        file="kolsky/inverse/objective.py",
        right="transmitted = np.arange(len(self.data)) < len(self.observations.bins.mean)",
        wrong="transmitted = np.arange(len(self.data)) < self.n_force",
        tests=("tests/unit/inverse/test_surroundings.py::test_the_incident_force_is_among_the_data",),
    ),
)

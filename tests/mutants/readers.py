"""Faults of readers and pages: rows that are lost, layouts that are not there, files drawn wrong."""

from tests.mutants.fault import Fault

FOUND = ("tests/unit/readers/test_found_layout.py::test_units_below_the_header_are_no_data",)
REFUSED = (
    "tests/unit/readers/test_found_layout.py::test_what_is_no_table_is_refused_with_its_place",
    "tests/unit/readers/test_found_layout.py::test_plain_tables_are_what_they_were_and_nothing_is_said",
)
VTK = ("tests/unit/report/test_vtk_files.py",)
SCENE = (
    "tests/unit/report/test_scene.py::test_brightness_is_lamberts_law_and_distance_is_toward_the_eye",
    "tests/unit/report/test_scene.py::test_surfaces_of_the_scene_have_the_areas_of_their_solids",
)
INSTRUMENT = ("tests/unit/report/test_instrument.py",)

FAULTS = (
    Fault(
        name="residual of the slider with the other sign",
        file="kolsky/report/pages/identification.py",
        right="UM * (c.Z_model[rows] - line.Z[rows])",
        wrong="UM * (line.Z[rows] - c.Z_model[rows])",
        tests=INSTRUMENT,
    ),
    Fault(
        name="any script allowed on a page",
        file="kolsky/report/pages/rendering.py",
        right="return Markup(f\"'sha256-{found}'\")",
        wrong="return Markup(\"'unsafe-inline'\")",
        tests=INSTRUMENT,
    ),
    Fault(
        name="the first row of a found table lost",
        file="kolsky/readers/table.py",
        right="first_line=first + 1,",
        wrong="first_line=first + 2,",
        tests=FOUND,
    ),
    Fault(
        name="units below the header taken for it",
        file="kolsky/readers/table.py",
        right="header, units = header - 1, header",
        wrong="header, units = header, header",
        tests=FOUND,
    ),
    Fault(
        name="plain text read as something else",
        file="kolsky/readers/table.py",
        right='if utf8 and dialect.delimiter == "," and header == 1 and units is None:',
        wrong="if False:",
        tests=REFUSED,
    ),
    Fault(
        name="offsets of cells one cell late",
        file="kolsky/report/paraview.py",
        right="np.arange(1, len(table) + 1, dtype=np.int64)",
        wrong="np.arange(0, len(table), dtype=np.int64)",
        tests=VTK,
    ),
    Fault(
        name="edge-on faces black",
        file="kolsky/report/scene/stills.py",
        right="return AMBIENT + (1.0 - AMBIENT) * np.clip(",
        wrong="return (1.0 - AMBIENT) * np.clip(",
        tests=SCENE,
    ),
    Fault(
        name="the specimen's other half left out of the cut",
        file="kolsky/report/scene/scene_data.py",
        right="np.column_stack([zero, nodes[:, 1], -nodes[:, 0]])",
        wrong="np.column_stack([zero, nodes[:, 1], 0.0 * nodes[:, 0]])",
        tests=SCENE,
    ),
)

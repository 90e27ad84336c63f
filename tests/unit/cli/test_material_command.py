"""`kolsky material fit`: files and their signs, output, rejected inputs."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from kolsky_command import rows_of, run_kolsky

from explicit.materials.laws.polynomial import MooneyRivlin
from kolsky.base.errors import InputError
from kolsky.cli.material_fit import read_tests, size_of, with_size
from kolsky.material.fits.columns import Columns
from kolsky.material.fits.homogeneous import Mode, incompressible_stress

LAW = MooneyRivlin(4e3, 2e3)
STRETCH = np.linspace(0.55, 0.97, 15)


def write(path, mode=Mode.UNIAXIAL, *, sign=1.0, at=STRETCH, factor=1.0):
    """A file as a testing machine may write it: a line of comment, names with units, percent and kPa."""
    T = factor * incompressible_stress(LAW, mode, at)
    rows = [f"{100.0 * sign * e:.9g};{1e-3 * sign * s:.9g}" for e, s in zip(mode.strain(at), T, strict=True)]
    path.write_text("\n".join(["sample 7;", "Strain (%);Stress (kPa)", *rows]) + "\n", encoding="utf-8")
    return path


def test_from_files_to_a_report(tmp_path):
    push = write(tmp_path / "push.csv", sign=-1.0)
    wide = write(tmp_path / "wide.csv", Mode.EQUIBIAXIAL, sign=-1.0, at=2.0 - STRETCH)
    out = tmp_path / "out"
    done = run_kolsky(
        "material", "fit", push, f"equibiaxial:{wide}", "--strain", "Strain", "--stress", "Stress",
        "--convention", "compression-positive", "--laws", "neo_hookean,mooney_rivlin_2", "--out", out,
        "--figures", "svg", "--json",
    )  # fmt: skip
    said = json.loads(done.stdout)
    assert said == json.loads((out / "material.json").read_text(encoding="utf-8"))
    assert said["best"] == "mooney_rivlin_2"
    best = said["laws"][0]
    assert best["fit"]["constants"]["C10"] == pytest.approx(4e3, rel=1e-6)  # nine digits in the file
    assert best["fit"]["constants"]["C01"] == pytest.approx(2e3, rel=1e-6)
    assert best["fit"]["youngs_modulus"] == pytest.approx(36e3, rel=1e-6)
    assert best["stable_over_data"] is True
    assert [(t["name"], t["mode"]) for t in said["tests"]] == [("push", "uniaxial"), ("wide", "equibiaxial")]
    assert set(said["inputs"]) == {str(push), str(wide)}
    states = {(r["law"], r["constant"]): r["state"] for r in rows_of(out / "material_constants.csv")}
    assert states["mooney_rivlin_2", "C11"] == "held"
    curves = rows_of(out / "material_curves.csv")
    assert len(curves) == 30
    assert float(curves[0]["mooney_rivlin_2 (Pa)"]) == pytest.approx(
        float(curves[0]["measured (Pa)"]), rel=1e-6
    )
    page = (out / "material.html").read_text(encoding="utf-8")
    assert page.count("<figure") == 3
    assert "<script" not in page
    assert "mooney rivlin" in page
    for name in ("material-fits", "material-residuals", "material-stability"):
        ElementTree.parse(out / "figures" / f"{name}.svg")


def test_repeats_are_averaged(tmp_path):
    files = [write(tmp_path / f"r{k}.csv", factor=1.0 + 0.1 * k) for k in (-1, 0, 1)]
    columns = Columns("tension-positive", strain="1", stress="2")
    (mean,), hashes, _ = read_tests([str(f) for f in files], columns, mean=7)
    assert (mean.name, len(mean.stress), len(hashes)) == ("mean of 3 uniaxial", 7, 3)
    np.testing.assert_allclose(mean.deformation[[0, -1]], [0.97, 0.55], rtol=1e-9)
    ends = incompressible_stress(LAW, Mode.UNIAXIAL, mean.deformation[[0, -1]])
    np.testing.assert_allclose(mean.stress[[0, -1]], ends, rtol=1e-8)  # nine digits in the files
    done = run_kolsky(
        "material", "fit", *files, "--strain", "1", "--stress", "2", "--convention", "tension-positive",
        "--mean", "9", "--laws", "neo_hookean", "--weighting", "sigma", "--out", tmp_path / "out",
    )  # fmt: skip
    assert "neo hookean" in done.stdout
    assert "E₀ (kPa)" in done.stdout


def test_a_stretch_has_no_sign_and_names_are_told_apart(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        T = incompressible_stress(LAW, Mode.UNIAXIAL, STRETCH)
        np.savetxt(tmp_path / folder / "t.txt", np.column_stack([-1e-6 * T, STRETCH]))
    columns = Columns("compression-positive", stretch="2", stress="1", stress_unit="MPa")
    tests, _, _ = read_tests([str(tmp_path / "a" / "t.txt"), f"planar:{tmp_path / 'b' / 't.txt'}"], columns)
    assert [t.name for t in tests] == ["uniaxial t", "planar t"]
    for test in tests:
        np.testing.assert_allclose(test.deformation, STRETCH)
        np.testing.assert_allclose(test.stress, T)
    twice, _, _ = read_tests([str(tmp_path / f / "t.txt") for f in ("a", "b")], columns)
    assert [t.name for t in twice] == ["uniaxial t (1)", "uniaxial t (2)"]


SAID = {"convention": "tension-positive", "strain": "Strain", "stress": "Stress"}


@pytest.mark.parametrize(
    ("files", "change", "message"),
    [
        (["{f}"], {"convention": ""}, "--convention .*tension-positive or compression-positive"),
        (["{f}"], {"strain": ""}, "--stretch COLUMN or --strain COLUMN"),
        (["{f}"], {"stretch": "1"}, "--stretch and --strain exclude each other"),
        (["{f}"], {"stress": ""}, "--stress COLUMN"),
        (["{f}"], {"stress": "Force"},
         "column 'Force' .*is missing; the columns are 'Strain .%.' .1., 'Stress"),
        (["{f}"], {"stress_unit": "mm"},
         "column 'Stress .kPa.' for the stress is in 'mm'; it must be in a unit of a stress"),
        (["{f}"], {"stress": "Strain"}, "column 'Strain .%.' for the stress is in '%'"),
        (["{f}"], {"convention": "compression-positive"}, "uniaxial: stretch must be > 0|sign"),
        (["tension:{f}"], {}, "it must be uniaxial, equibiaxial, planar, simple-shear"),
        (["simple-shear:{f}"], {"strain": "", "stretch": "1"}, "simple shear has no stretch"),
        (["{f}x"], {}, "there is no such file"),
    ],
)  # fmt: skip
def test_what_is_not_said_or_cannot_be_is_refused(tmp_path, files, change, message):
    file = write(tmp_path / "t.csv", at=np.linspace(0.3, 0.9, 12))
    if change.get("convention") == "compression-positive":
        file.write_text(file.read_text(encoding="utf-8").replace(";-", ";"), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_tests([text.format(f=file) for text in files], Columns(**{**SAID, **change}))


def test_options_are_refused_in_one_line(tmp_path):
    file = write(tmp_path / "t.csv")
    common = (
        file, "--strain", "1", "--stress", "2", "--convention", "tension-positive", "--out", tmp_path / "out",
    )  # fmt: skip
    for arguments, message in (
        (("--laws", "hooke"), "law 'hooke' is not one of neo_hookean"),
        (("--weighting", "log"), "it must be absolute, relative or sigma"),
        (("--weighting", "sigma"), "--weighting sigma needs tests with a scatter"),
        (("--figures", "gif"), "it must be pdf, svg, png"),
    ):
        done = run_kolsky("material", "fit", *common, *arguments, code=2)
        assert message in done.stderr
        assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_law_without_a_fit_is_a_remark(tmp_path):
    file, at = tmp_path / "few.txt", STRETCH[:6]
    np.savetxt(file, np.column_stack([at - 1.0, incompressible_stress(LAW, Mode.UNIAXIAL, at)]))
    out = tmp_path / "out"
    done = run_kolsky(
        "material", "fit", file, "--strain", "1", "--stress", "2", "--convention", "tension-positive",
        "--laws", "neo_hookean,ogden3", "--stress-unit", "Pa", "--out", out,
    )  # fmt: skip
    assert "ogden3 has no fit: ogden3 has 6 free constants, the tests only 6 points" in done.stderr
    assert "ogden3 has no fit" in (out / "material.html").read_text(encoding="utf-8")


def test_a_lateral_strain_has_its_files_unit(tmp_path):
    rows = [f"{e},{2 * e},{-0.4 * e}" for e in (0.5, 1.0, 2.0, 4.0)]
    path = tmp_path / "pull.csv"
    path.write_text("\n".join(["Strain (%),Stress (kPa),Side (%)", *rows]) + "\n", encoding="utf-8")
    (test,), _, _ = read_tests(
        [str(path)],
        Columns("tension-positive", strain="Strain", stress="Stress", lateral="Side", lateral_strain=True),
    )
    np.testing.assert_allclose(test.lateral, [0.998, 0.996, 0.992, 0.984])
    path.write_text("\n".join(["Strain (%),Stress (kPa),Side (mm)", *rows]) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"column 'Side \(mm\)' for the lateral is in 'mm'"):
        read_tests([str(path)], Columns("tension-positive", strain="Strain", stress="Stress", lateral="Side"))


def test_tables_of_the_package_need_no_columns(tmp_path):
    path = tmp_path / "curve.csv"
    rows = [f"{e},{6e4 * e},0" for e in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35)]
    head = "nominal strain (1),nominal stress (Pa),independent sigma (Pa)"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    (test,), _, _ = read_tests([str(path)], Columns("compression-positive"))
    np.testing.assert_allclose(test.deformation[::2], [0.95, 0.85, 0.75, 0.65])
    np.testing.assert_allclose(test.stress[::2], [-3e3, -9e3, -15e3, -21e3])


SIZE = {"length": 10e-3, "area": 1e-4}


@pytest.mark.parametrize(
    ("headings", "size", "taken"),
    [
        ("Kraft [N];Weg [mm]", SIZE, ("Weg [mm]", "Kraft [N]")),
        ("Standardkraft/N;Standardweg/mm", SIZE, ("Standardweg/mm", "Standardkraft/N")),
        ("Load (N);Extension (mm)", SIZE, ("Extension (mm)", "Load (N)")),
        ("Force_N;Stroke_mm", SIZE, ("Stroke_mm", "Force_N")),
        ("Spannung [Pa];Dehnung [%]", {}, ("Dehnung [%]", "Spannung [Pa]")),
        ("Tensile stress, Pa;Tensile strain, %", {}, ("Tensile strain, %", "Tensile stress, Pa")),
        ("Nominal stress (Pa);Extension (%)", {}, None),  # an extension is no strain by its name
        ("True stress (Pa);True strain (%)", {}, None),
        ("Force A (N);Travel (mm)", SIZE, ("Travel (mm)", "Force A (N)")),
        ("Load cell (V);Travel (mm)", SIZE, None),
    ],
)
def test_columns_are_taken_by_their_names_or_asked_for(tmp_path, headings, size, taken):
    path = tmp_path / "a.csv"
    rows = [f"{0.5 * i};{0.1 * i}" for i in range(1, 9)]
    path.write_text("\n".join([headings, *rows]) + "\n", encoding="utf-8")
    columns = Columns("tension-positive", **size)
    if taken is None:
        with pytest.raises(InputError, match="the file has the columns of numbers '") as caught:
            read_tests([str(path)], columns)
        assert all(name in caught.value.message for name in headings.split(";"))
        return
    (test,), _, (words,) = read_tests([str(path)], columns)
    assert all(f"'{name}' as the " in words for name in taken)
    at = 0.1 * np.arange(1, 9)
    np.testing.assert_allclose(test.strain, at * (0.1 if size else 0.01), rtol=1e-9)  # of 10 mm, or in %
    np.testing.assert_allclose(test.stress, 5.0 * at * (1e4 if size else 1.0), rtol=1e-9)


def test_of_two_pairs_the_declared_size_chooses_and_two_of_a_kind_are_asked_for(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{0.5 * i};{0.1 * i};{7.0 * i};{i}" for i in range(1, 9)]
    path.write_text("\n".join(["Kraft [N];Weg [mm];Spannung [Pa];Dehnung [%]", *rows]), encoding="utf-8")
    for size, stress in ((SIZE, 0.5e4), ({}, 7.0)):
        (test,), _, _ = read_tests([str(path)], Columns("tension-positive", **size))
        assert test.stress[0] == pytest.approx(stress, rel=1e-12)
    path.write_text("\n".join(["Spannung 1 [Pa];Dehnung [%];Spannung 2 [Pa];x", *rows]), encoding="utf-8")
    with pytest.raises(InputError, match=r"'Spannung 1 .*'Spannung 2 "):
        read_tests([str(path)], Columns("tension-positive"))


def test_a_held_cylinder_has_one_size():
    size = size_of("--specimen", "9.5 mm x 6.5 mm")
    area = np.pi * 4.75e-3**2
    for columns in (Columns(), Columns(length=6.5e-3, area=70.88e-6), Columns(diameter=9.5e-3)):
        sized = with_size(columns, size)
        assert (sized.length, sized.section) == pytest.approx((6.5e-3, area), rel=1e-12)
    with pytest.raises(InputError, match=r"--length gives 0\.0065065\d* m, --specimen 0\.0065 m"):
        with_size(Columns(length=6.5e-3 * 1.00101), size)
    with pytest.raises(InputError, match="--area or --diameter gives"):
        with_size(Columns(area=1.0011 * area), size)
    words = ("--specimen", "9.5 mm x 6.5 mm", "--mean", "9", "--poisson", "0.49", "--free-bounds")
    refused = run_kolsky("material", "fit", "a.csv", *words, code=2)
    assert "--mean, --free-bounds does not go with --specimen" in refused.stderr

"""The cases: copied files, and the commands that run on them."""

from dataclasses import dataclass

THREADS = 2  # threads of every command that takes `--threads`; libraries of linear algebra have one

MESHES = "--mesh 12x16 --refined-mesh 16x22"
HELD = f"--hold poisson --hold damping {MESHES} --threads {THREADS}"


@dataclass(frozen=True)
class Case:
    """Commands that run one after the other in a copy of some folders of the repository.

    ``name``: what it is called, also the folder of its results. ``inputs``: files and folders that are
    copied, at the same place: of the repository, or with `shared/` in front of the folder of large data
    beside it. ``commands``: lines of a shell without substitutions; `kolsky ...`, or `python ...`. ``cheap``:
    whether it takes less than half a minute. ``before``: files that are written first: place and text.
    """

    name: str
    inputs: tuple[str, ...]
    commands: tuple[str, ...]
    cheap: bool = True
    before: tuple[tuple[str, str], ...] = ()


PICTURES = """
[pictures]
camera_0 = { file = "cam0.tif", crop_offset = [192, 192] }
camera_1 = { file = "cam1.tif", crop_offset = [192, 192] }
bits = 12

[calibration]
camera_0 = "calibration/cam0_*.png"
camera_1 = "calibration/cam1_*.png"
distortion = "k1"
square_pixels = true

[calibration.target]
kind = "fiducial_dots"
columns = 14
rows = 10
pitch = "1.2 mm"
diameter = "0.6 mm"
hollow = [[2, 2], [11, 2], [2, 7]]

[dic]
flyer_side = "up"
strip_half_width = "0.6 mm"
largest_sigma = "10 um"
subset = 25
step = 6
shape = "quadratic"
"""
"""The tables of docs/tutorials/pictures.md, in the place of [flyer] and [centre_line]."""

SOFT = """
pressures = ["0.3 bar", "0.5 bar"]

[geometry]
chambers = 2
wall = "2.5 mm"
base = "2.5 mm"
chamber = ["3 mm", "10 mm", "10 mm"]
gap = "2 mm"
channel = ["2 mm", "2 mm"]
inlet = "5 mm"
cell = "4 mm"
element = "hex8"

[material]
law = "neo_hookean"
constants = { mu = "218 kPa" }
D1 = "1.150 1/MPa"
density = "1.02 g/cm^3"

[gravity]
downward = [0.0, 0.0, -9.81]

[invert]
angles = ["2 deg"]
most = "0.76 bar"

[control]
angles = ["2 deg", "3 deg", "1 deg"]
hold = "5 s"
most = "0.76 bar"
noise = "0.1 deg"
"""
"""The actuator of runs/actuator/pneunet.toml with two chambers of linear bricks: seconds, not minutes."""

WITHOUT_EXPORTS = (
    "python -c \"import re, pathlib as p; s = p.Path('runs/open-01/shot.toml').read_text(); "
    "t = re.sub(r'(?ms)^\\[flyer\\].*?(?=^\\[curve\\])', '', s); "
    "p.Path('shared/data/shots/open-01/shot.toml').write_text(t + p.Path('pictures.toml').read_text())\""
)

OPEN = "runs/open-01"
BAR = "runs/bar-01"
PAPER = "runs/predict/paper.toml"
SLOW = "runs/relaxation/slow.toml"
PICTURED = "shared/data/shots/open-01"
RUBBER = "shared/data/quasistatic/rubber_classics/Meunier_2008"
TABLE = "stress_stretch.txt"

CASES: tuple[Case, ...] = (
    Case("tables", ("runs/open-01", "runs/bar-01"),
     ("kolsky check runs/open-01 --json", "kolsky check runs/bar-01",
     "kolsky channels runs/open-01/scope.csv --json", "kolsky channels runs/bar-01/tek0017.csv",
     "kolsky new filled", "kolsky new bars --bars", "kolsky virtual new lab")),
    Case("waves", ("runs/bar-01",), ("kolsky waves runs/bar-01",
     "kolsky waves runs/bar-01 --json --out again")),
    Case("waves-flyer", ("runs/open-01",), ("kolsky waves runs/open-01", "kolsky waves runs/open-01 --json")),
    Case("simulate", ("runs/open-01", "runs/open-03"),
     (f"kolsky simulate runs/open-01 --vtu --mesh 12x16 --threads {THREADS} -p stiffness_factor=1.1",
     f"kolsky simulate runs/open-01 --mesh 12x16 --element fbar --json --threads {THREADS} --out fbar",
     f"kolsky simulate runs/open-03 --mesh 12x16 --threads {THREADS} --out other",
     f"kolsky simulate runs/open-01 --slow --mesh 8x11 --error '2 %' --threads {THREADS} --out slow")),
    Case("open-01", ("runs/open-01",), (f"kolsky identify runs/open-01 {MESHES} --threads {THREADS}",),
     cheap=False),
    Case("open-01-held", ("runs/open-01", "runs/relaxation"),
     (f"kolsky identify runs/open-01 {HELD}", "kolsky report runs/open-01",
     "kolsky material relaxation runs/relaxation/slow.toml --shot runs/open-01 --out relaxed")),
    Case("open-03-held", ("runs/open-03",), (f"kolsky identify runs/open-03 {HELD} --json",)),
    Case("open-04-held", ("runs/open-04",), (f"kolsky identify runs/open-04 {HELD} --method paper",)),
    Case("per-shot", ("runs/open-01", "runs/per_shot.py"),
     ("python runs/per_shot.py runs/open-01 8x11 12x16",)),
    Case("predict", (PAPER,), ("kolsky predict runs/predict/paper.toml --out planned",), cheap=False),
    Case("predict-quick", (PAPER,), (f"kolsky predict {PAPER} --out planned --quick --json",
     f'kolsky predict {PAPER} --out scanned --quick --vary "striker.speed=4 m/s:7 m/s:3"')),
    Case("relaxation", ("runs/relaxation",),
     ("kolsky material relaxation runs/relaxation/slow.toml --json",)),
    Case("specimen", ("runs/specimen",),
     ("kolsky specimen simulate runs/specimen/silicone_truth.toml --seed 7 --out simulated",
     "kolsky specimen plan runs/specimen/silicone_truth.toml --wanted C01 --out choices"), cheap=False),
    Case("specimen-fit", ("runs/specimen",),
     ("kolsky specimen fit runs/specimen/silicone.toml --out fitted",), cheap=False),
    Case("sheet", ("runs/specimen",),
     ("kolsky specimen fit runs/specimen/sheet.toml --vtu --out fitted",)),
    Case("actuator-touching", ("runs/actuator",),
     ("kolsky actuator simulate runs/actuator/touching.toml --vtu --out touching",)),
    Case("actuator", ("runs/actuator",),
     ("kolsky actuator simulate runs/actuator/pneunet.toml --vtu --out bent",), cheap=False),
    Case("actuator-loop", (), ("kolsky actuator invert soft.toml --out inverted",
     "kolsky actuator control soft.toml --out controlled"), before=(("soft.toml", SOFT),)),
    Case("virtual", ("runs/virtual",),
     (f"kolsky virtual make runs/virtual/small.toml --out made --only 1-2 --threads {THREADS}",
     f"kolsky identify made/small-1 {HELD}")),
    Case("pictures", ("runs/open-01/shot.toml", PICTURED),
     (f"python -m dic.images {PICTURED}/cam0.tif --bits 12 --static 12 --subset 25 --wanted 0.01",
     WITHOUT_EXPORTS, f"kolsky dic {PICTURED}", f"kolsky identify {PICTURED} {HELD}"), cheap=False,
     before=(("pictures.toml", PICTURES),)),
    Case("material-fit", (RUBBER,),
     (f"kolsky material fit uniaxial:{RUBBER}/UT/{TABLE} equibiaxial:{RUBBER}/ET/{TABLE} "
     f"planar:{RUBBER}/PS/{TABLE} --stretch 2 --stress 1 --stress-unit MPa "
     "--convention tension-positive --laws yeoh,ogden2,gent,mooney_rivlin_2 --out rubber",)),
    Case("sweep", ("runs/open-01", "runs/sweep.py"),
     (f"kolsky sweep runs/open-01 --design maximin --runs 12 --vary stiffness_factor=1:1.25 "
     f'--vary "damping=10 us:50 us" --mesh 8x11 --threads {THREADS}',
     "python runs/sweep.py runs/open-01 sobol 16")),
    Case("rates", ("runs/open-01", "runs/rate_shots.py", "runs/rate_report.py"),
     ("python runs/rate_shots.py shots 16x22 0.7 1.4 2.6", f"kolsky identify shots/* --each {HELD}",
     "python runs/rate_report.py shots/*", "kolsky rate shots/* --out compared"), cheap=False),
    Case("joint", ("runs/open-01", "runs/rate_shots.py"),
     ("python runs/rate_shots.py shots 12x16 1.4 2.6",
     f"kolsky identify shots/* --mesh 8x11 --refined-mesh 12x16 --threads {THREADS} --out joint"),
     cheap=False),
    Case("plan", ("runs/open-01",),
     (f"kolsky plan runs/open-01 -p stiffness_factor=1.12 --mesh 12x16 --threads {THREADS}",)),
    Case("budget", ("runs/open-01",),
     ("kolsky budget runs/open-01 --free stiffness_factor --draws 4 --together 2 --mesh 8x11 "
     f"--refined-mesh 12x16 --truth-mesh 12x16 --threads {THREADS} --out budget",), cheap=False),
)  # fmt: skip
"""All cases, in the order in which they run."""

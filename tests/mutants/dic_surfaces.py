"""Faults of measured surfaces: smoothness, residual map, cylinder, overlap, strains, noise floors."""

from tests.mutants.fault import Fault

GATES = ("tests/unit/dic/test_dic_gates.py",)
SIGMAS = ("tests/unit/dic/test_dic_sigmas.py",)
NOISE = ("tests/unit/dic/test_dic_noise_floor.py",)
BESIDE = ("tests/unit/dic/test_dic_beside_strip.py",)

FAULTS = (
    Fault(
        name="outline beside the strip: one side alone",
        file="dic/surfaces/outline.py",
        right="0.5 * (left + other)",
        wrong="left",
        tests=BESIDE,
    ),
    Fault(
        name="outline beside the strip: noise counted with what departs",
        file="dic/surfaces/outline.py",
        right="1.0 - 1.0 / chi2",
        wrong="1.0 - 0.1 / chi2",
        tests=BESIDE,
    ),
    Fault(
        name="off the surface: fifty sigmas",
        file="dic/chain/outliers.py",
        right="SIGMAS = 5.0",
        wrong="SIGMAS = 50.0",
        tests=GATES,
    ),
    Fault(
        name="off the surface: weights of the neighbours not squared",
        file="dic/chain/outliers.py",
        right="weights**2, noise**2",
        wrong="weights, noise**2",
        tests=GATES,
    ),
    Fault(
        name="off the surface: neighbours of the worst point go with it",
        file="dic/chain/outliers.py",
        right="(score > 1.0) & (score >= around)",
        wrong="(score > 1.0)",
        tests=GATES,
    ),
    Fault(
        name="off the surface: one neighbour confirms a point",
        file="dic/chain/outliers.py",
        right="FEWEST_CONFIRMING = 2",
        wrong="FEWEST_CONFIRMING = 1",
        tests=GATES,
    ),
    Fault(
        name="off the surface: the bending of a scene of any size",
        file="dic/chain/outliers.py",
        right="bending = BENDING * distance",
        wrong="bending = BENDING * 0.4e-3",
        tests=GATES,
    ),
    Fault(
        name="off the surface: diagonals count as neighbours' distance",
        file="dic/chain/outliers.py",
        right="np.abs(offset).sum(axis=-1) == 1.0",
        wrong="np.abs(offset).max(axis=-1) == 1.0",
        tests=GATES,
    ),
    Fault(
        name="residual map: a hundred times the residual",
        file="dic/chain/outliers.py",
        right="SEED = 10.0",
        wrong="SEED = 100.0",
        tests=GATES,
    ),
    Fault(
        name="residual map: the excess for the residual",
        file="dic/chain/outliers.py",
        right="np.where(judged, 1.0 + excess[frame], 0.0)",
        wrong="np.where(judged, excess[frame], 0.0)",
        tests=GATES,
    ),
    Fault(
        name="residual map: a patch is its seeds alone",
        file="dic/chain/outliers.py",
        right="TOUCHED = 1.5",
        wrong="TOUCHED = 15.0",
        tests=GATES,
    ),
    Fault(
        name="cylinder: robust limit without the MAD constant",
        file="dic/surfaces/cylinder.py",
        right="MAD * float(np.median(off))",
        wrong="float(np.median(off))",
        tests=GATES,
    ),
    Fault(
        name="noise floor in time: n for n - 1",
        file="dic/surfaces/surface_history.py",
        right="variance = np.sum(off**2, axis=0) / (count - 1)",
        wrong="variance = np.sum(off**2, axis=0) / count",
        tests=NOISE,
    ),
    Fault(
        name="noise floor in space: the mean through the frames took nothing",
        file="dic/surfaces/surface_history.py",
        right="* np.sqrt(count / (count - 1))",
        wrong="* 1.0",
        tests=NOISE,
    ),
    Fault(
        name="strain noise: n for n - 1",
        file="dic/result.py",
        right="values.var(axis=0, ddof=1)",
        wrong="values.var(axis=0, ddof=0)",
        tests=NOISE,
    ),
    Fault(
        name="overlap: subsets share pixels up to twice their side",
        file="dic/correlation/subsets.py",
        right="1.0 - np.abs(apart) / subset",
        wrong="1.0 - np.abs(apart) / (2.0 * subset)",
        tests=(
            "tests/unit/dic/test_dic_cylinder.py::test_overlapping_subsets_promise_less_and_distant_ones_nothing_less",
        ),
    ),
    Fault(
        name="overlap: a pair counts for one of its points",
        file="dic/correlation/subsets.py",
        right="values = np.concatenate([np.ones(len(grid)), value, value])",
        wrong="values = np.concatenate([np.ones(len(grid)), value, 0.0 * value])",
        tests=("tests/unit/dic/test_dic_overlap.py",),
    ),
    Fault(
        name="strain gauge: one step too long",
        file="dic/surfaces/strains.py",
        right="(self.window - 1) * self.step",
        wrong="self.window * self.step",
        tests=("tests/unit/dic/test_dic_strains.py",),
    ),
    Fault(
        name="strain sigma: half the slope of the first component",
        file="dic/surfaces/strains.py",
        right="2.0 * around * g1",
        wrong="1.0 * around * g1",
        tests=("tests/unit/dic/test_dic_strains.py",),
    ),
    Fault(
        name="overlap: quadratic weights of both subsets taken for one's",
        file="dic/correlation/subsets.py",
        right="2.0 * 3.5 * 3.75 * (x + y)",
        wrong="3.5 * 3.75 * (x + y)",
        tests=SIGMAS,
    ),
    Fault(
        name="overlap: quadratic subsets as alike as their area",
        file="dic/correlation/subsets.py",
        right="if shape <= Shape.AFFINE:",
        wrong="if shape <= Shape.QUADRATIC:",
        tests=SIGMAS,
    ),
)

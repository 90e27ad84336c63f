"""Faults of the search with several minima: valleys and summits of the misfit, and what is said of them."""

from tests.mutants.fault import Fault

VALLEYS = ("tests/unit/inverse/test_valleys.py",)
SUMMITS = ("tests/unit/inverse/test_summits.py",)
FREE = ("tests/unit/inverse/test_free_parameters.py",)

FAULTS = (
    Fault(
        name="levels of Poisson's ratio evenly spaced",
        file="kolsky/inverse/valleys.py",
        right="np.interp(np.linspace(number[0], number[-1], n), number, values)",
        wrong="np.linspace(values[0], values[-1], n)",
        tests=VALLEYS,
    ),
    Fault(
        name="a minimum that is below one neighbour",
        file="kolsky/inverse/valleys.py",
        right="(padded[1:-1] < padded[:-2]) & (padded",
        wrong="(padded[1:-1] < padded[:-2]) | (padded",
        tests=VALLEYS,
    ),
    Fault(
        name="the wave's passage one way",
        file="kolsky/inverse/valleys.py",
        right="/ density) / (2.0 * length)",
        wrong="/ density) / length",
        tests=VALLEYS,
    ),
    Fault(
        name="the flyer's noise left out where valleys are compared",
        file="kolsky/inverse/valleys.py",
        right="seen = replace(stages.observations, front_noise=patterns_of(stages, prediction))",
        wrong="seen = stages.observations",
        tests=VALLEYS,
    ),
    Fault(
        name="the prior left out where valleys are compared",
        file="kolsky/inverse/valleys.py",
        right="objective.balanced_deviance(vector)[0] + objective.prior_chi2(points[row])",
        wrong="objective.balanced_deviance(vector)[0]",
        tests=VALLEYS,
    ),
    Fault(
        name="a parameter counts as told when two sigma fill its range",
        file="kolsky/inverse/search.py",
        right="SEEN = 4.0",
        wrong="SEEN = 2.0",
        tests=FREE,
    ),
    Fault(
        name="half as many motions at the floor of a valley",
        file="kolsky/inverse/valleys.py",
        right="MOTIONS = 24",
        wrong="MOTIONS = 12",
        tests=VALLEYS,
    ),
    Fault(
        name="two valleys by a frame as one entry",
        file="kolsky/inverse/valleys.py",
        right='"balanced": 3',
        wrong='"balanced": 2',
        tests=VALLEYS,
    ),
    Fault(
        name="no valley by the force alone",
        file="kolsky/inverse/valleys.py",
        right='"force": 1',
        wrong='"force": 0',
        tests=VALLEYS,
    ),
    Fault(
        name="one valley by all entries",
        file="kolsky/inverse/valleys.py",
        right='"joint": 2',
        wrong='"joint": 1',
        tests=VALLEYS,
    ),
    Fault(
        name="a climb in steps of a quarter of an oscillation",
        file="kolsky/inverse/valleys.py",
        right="STRIDE = 0.5",
        wrong="STRIDE = 0.25",
        tests=SUMMITS,
    ),
    Fault(
        name="places on the wrong side of a floor",
        file="kolsky/inverse/valleys.py",
        right="np.interp(middle + STRIDE * np.array(new), number, table)",
        wrong="np.interp(middle - STRIDE * np.array(new), number, table)",
        tests=SUMMITS,
    ),
    Fault(
        name="a climb that ends beside the floor",
        file="kolsky/inverse/valleys.py",
        right="new = strides_beside(best, set(places))",
        wrong="new = []",
        tests=SUMMITS,
    ),
    Fault(
        name="the least likely place",
        file="kolsky/inverse/valleys.py",
        right="best = order[int(np.argmin(judged(",
        wrong="best = order[int(np.argmax(judged(",
        tests=SUMMITS,
    ),
    Fault(
        name="a climb past the bounds",
        file="kolsky/inverse/valleys.py",
        right="if number[0] <= middle + STRIDE * k <= number[-1]]",
        wrong="if True]",
        tests=SUMMITS,
    ),
    Fault(
        name="the floor's patterns at the summit",
        file="kolsky/inverse/valleys.py",
        right="return Summit(x, patterns_of(stages, prediction), best, prediction)",
        wrong="return Summit(x, patterns_of(stages, runs), best, prediction)",
        tests=SUMMITS,
    ),
    Fault(
        name="a floor on the summit's own slope counts as another valley",
        file="kolsky/inverse/valleys.py",
        right="others = values[apart > OTHER]",
        wrong="others = values[apart > 0.0]",
        tests=SUMMITS,
    ),
    Fault(
        name="a valley not told from another is identified",
        file="kolsky/diagnosis/fit_quality.py",
        right="LEAST_MARGIN = 25.0",
        wrong="LEAST_MARGIN = 24.0",
        tests=("tests/unit/diagnosis/test_fit_verdicts.py",),
    ),
)

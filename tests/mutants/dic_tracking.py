"""Faults of correlation and tracking: matches, covariances, rigid bodies, frames ahead, forks."""

from tests.mutants.fault import Fault

TRAVEL = ("tests/unit/dic/test_dic_travel_checks.py",)
SIGMAS = ("tests/unit/dic/test_dic_sigmas.py",)
APART = ("tests/unit/dic/test_dic_apart.py",)
PARTS = ("tests/unit/dic/test_dic_in_parts.py",)
FORKS = ("tests/unit/dic/test_dic_forks.py",)
TOGETHER = ("tests/unit/dic/test_dic_side_by_side.py",)
AHEAD = ("tests/unit/dic/test_dic_ahead.py",)

FAULTS = (
    Fault(
        name="tracking: a new reference forgets the residuals before it",
        file="dic/tracking/__init__.py",
        right="largest[rows] = np.maximum(beyond, template.excess)",
        wrong="largest[rows] = beyond",
        tests=(
            "tests/unit/dic/test_dic_track_parts.py::test_a_residual_is_kept_through_changes_of_reference",
        ),
    ),
    Fault(
        name="tracking: the noise itself counts as excess",
        file="dic/tracking/matcher.py",
        right="* variance / expected - 1.0, 0.0)",
        wrong="* variance / expected, 0.0)",
        tests=("tests/unit/dic/test_dic_track_parts.py::test_residual_of_noise_alone_has_no_excess",),
    ),
    Fault(
        name="health: a doubled picture is fine",
        file="dic/images/health.py",
        right="outcome[seen.repeats] = int(FrameOutcome.REPEATED)",
        wrong="outcome[seen.repeats] = int(FrameOutcome.VALID)",
        tests=TRAVEL,
    ),
    Fault(
        name="start of a track: variances of two shape functions added",
        file="dic/tracking/matcher.py",
        right="searched * start - template",
        wrong="searched * start + template",
        tests=SIGMAS,
    ),
    Fault(
        name="covariance in the material: mapped forward instead of back",
        file="dic/tracking/matcher.py",
        right="back = np.linalg.inv(gradient(warp))",
        wrong="back = gradient(warp)",
        tests=SIGMAS,
    ),
    Fault(
        name="residual: counts along a flattening whether there is one or not",
        file="dic/tracking/matcher.py",
        right="(most - EVEN) * flat",
        wrong="(most - EVEN)",
        tests=SIGMAS,
    ),
    Fault(
        name="apart: what the process does not deliver is nothing",
        file="dic/processes.py",
        right="            return instead(said)",
        wrong="            return None",
        tests=APART,
    ),
    Fault(
        name="second camera: forked where a GPU is open already",
        file="dic/bodies/follow.py",
        right="or not allowed() or started()",
        wrong="or not allowed()",
        tests=APART,
    ),
    Fault(
        name="second camera: follows bodies in other pictures",
        file="dic/bodies/follow.py",
        right="not self._told and all(body.pictures is self._pictures for body in bodies)",
        wrong="not self._told",
        tests=APART,
    ),
    Fault(
        name="second camera: sends tracks of any size",
        file="dic/bodies/follow.py",
        right="if small and second is not None",
        wrong="if second is not None",
        tests=APART,
    ),
    Fault(
        name="forks: small work takes the last core too",
        file="dic/processes.py",
        right="min(cores() - 1, MOST_PARTS)",
        wrong="min(cores(), MOST_PARTS)",
        tests=PARTS,
    ),
    Fault(
        name="smooth surface: frames of the parts in each other's order",
        file="dic/chain/outliers.py",
        right="off[part::processes] = found",
        wrong="off[part::processes] = found[::-1]",
        tests=PARTS,
    ),
    Fault(
        name="pictures: another process's take the place of those read here",
        file="dic/images/series.py",
        right="if index not in self._kept and self._size",
        wrong="if self._size",
        tests=PARTS,
    ),
    Fault(
        name="forks: what a fork does not deliver is nothing",
        file="dic/processes.py",
        right="        return work()  # raises here",
        wrong="        return None  # raises here",
        tests=FORKS,
    ),
    Fault(
        name="forks: made by any thread of any program",
        file="dic/processes.py",
        right='ContextVar("forking", default=False)',
        wrong='ContextVar("forking", default=True)',
        tests=FORKS,
    ),
    Fault(
        name="forks: what one of several did not deliver is left out",
        file="dic/processes.py",
        right="found[number] if number in found else work() for number",
        wrong="found.get(number) for number",
        tests=FORKS,
    ),
    Fault(
        name="rigid body: the places tried together share the first one's match",
        file="dic/tracking/rigid.py",
        right="getattr(part, name)[begin:end]",
        wrong="getattr(part, name)[: end - begin]",
        tests=TOGETHER,
    ),
    Fault(
        name="rigid body: of a pair of places the first alone is looked at",
        file="dic/tracking/rigid.py",
        right="matches[2 * k - 2 : 2 * k]",
        wrong="matches[2 * k - 2 : 2 * k - 1]",
        tests=TOGETHER,
    ),
    Fault(
        name="rigid body: what looks three quarters like it is it",
        file="dic/tracking/rigid.py",
        right="1.0 - float(np.median(match.zncc[agree])) > most",
        wrong="1.0 - float(np.median(match.zncc[agree])) > 10.0 * most",
        tests=("tests/unit/dic/test_dic_side_by_side.py",),
    ),
    Fault(
        name="rigid body: one frame that looks like it sets the limit",
        file="dic/tracking/rigid.py",
        right="TIMES * float(np.median(before))",
        wrong="TIMES * float(np.min(before))",
        tests=("tests/unit/dic/test_dic_side_by_side.py",),
    ),
    Fault(
        name="rigid body: a quarter of the points in view is enough",
        file="dic/tracking/rigid.py",
        right="0.5 * inside.sum()",
        wrong="0.25 * inside.sum()",
        tests=TOGETHER,
    ),
    Fault(
        name="match: a mask that has changed is still used",
        file="dic/correlation/kernels/launch.py",
        right="kept.shape == mask.shape and np.array_equal(kept, mask)",
        wrong="kept.shape == mask.shape",
        tests=TOGETHER,
    ),
    Fault(
        name="points in parts: the last parts are not waited for",
        file="dic/correlation/kernels/launch.py",
        right="range(count, count + LANES)",
        wrong="range(count, count)",
        tests=AHEAD,
    ),
    Fault(
        name="frames ahead: a block counted with the frames that cannot be read",
        file="dic/tracking/inputs.py",
        right="enumerate(fit)",
        wrong="enumerate(frames)",
        tests=AHEAD,
    ),
    Fault(
        name="match: the mask of the call before is still used",
        file="dic/correlation/kernels/launch.py",
        right="job.has_mask = int(batch.mask is not None)",
        wrong="job.has_mask = max(job.has_mask, int(batch.mask is not None))",
        tests=AHEAD,
    ),
)

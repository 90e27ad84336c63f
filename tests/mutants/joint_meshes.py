"""Faults in what finer and graded meshes tell a joint identification."""

from tests.mutants.fault import Fault
from tests.mutants.joint import fault

FAULTS: tuple[Fault, ...] = (
    fault(
        "runs on a graded mesh taken for those on an even one of its size",
        "kolsky/inverse/joint_runs.py",
        "(*map(float, numerics.mesh), numerics.grading, element,",
        "(*map(float, numerics.mesh), element,",
        "joint/test_refined_patterns.py",
    ),
    fault(
        "patterns kept with which the search does not rest",
        "kolsky/inverse/joint_search.py",
        "if last.confirmed or not found.confirmed:",
        "if True:",
        "joint/test_refined_patterns.py",
    ),
    fault(
        "old patterns kept without a word",
        "kolsky/inverse/joint_search.py",
        "said.append(COARSE_PATTERNS)",
        "pass",
        "joint/test_refined_patterns.py",
    ),
    fault(
        "patterns of the noise made anew on the mesh of the search",
        "kolsky/inverse/joint_search.py",
        "problem.learn_noise(found.x, numerics)",
        "problem.learn_noise(found.x, problem.mesh)",
        "joint/test_refined_patterns.py",
    ),
    fault(
        "no search with the patterns made anew",
        "kolsky/inverse/joint_search.py",
        "replace(refined_optimum(problem, found.x, found.slopes), start=found.start)",
        "found",
        "joint/test_refined_patterns.py",
    ),
    fault(
        "a graded mesh's error by the wrong one of the two",
        "kolsky/uncertainty/mesh_error.py",
        "GradedChange(same - found.vector, coarse - same,",
        "GradedChange(coarse - found.vector, coarse - same,",
        "joint/test_refined_patterns.py",
    ),
    fault(
        "the mesh's error left as large as between the meshes",
        "kolsky/uncertainty/mesh_error.py",
        "rows = [change.error]",
        "rows = [change.coarser]",
        "joint/test_model_choice_words.py",
    ),
    fault(
        "a lost graded run of several shots without a word",
        "kolsky/uncertainty/mesh_error.py",
        "lost=(*lost, *more)",
        "lost=tuple(lost)",
        "joint/test_mesh_errors.py",
    ),
    fault(
        "a lost run of the other shots",
        "kolsky/uncertainty/mesh_error.py",
        "if np.isnan(part).any()]",
        "if not np.isnan(part).any()]",
        "joint/test_mesh_errors.py",
    ),
    fault(
        "a mesh error that is one for all shots",
        "kolsky/uncertainty/mesh_error.py",
        "stack.of_shot(k, row) for row in rows for k in range(len(stack.shots))",
        "row for row in rows",
        "joint/test_model_choice_words.py",
    ),
)

"""Warnings of runs that were to tell the mesh's error and did not complete."""

from collections.abc import Iterator, Sequence

from kolsky.uncertainty.numerical import LostRun


def lost_mesh_runs(lost: Sequence[LostRun], coarse: tuple[int, int]) -> Iterator[str]:
    """Say which runs of `kolsky.uncertainty.numerical.MeshChange` were lost, and what stands in for them.

    Parameters
    ----------
    lost
        The runs.
    coarse
        Elements of the search's mesh, across the radius and along the length.
    """
    for run in lost:
        across, along = run.numerics.mesh
        why = f" ({run.why})" if run.why else ""
        if run.is_graded:
            yield (
                f"the run at the answer on the graded mesh of {across} x {along} elements was lost{why}, so "
                "that the correction for the mesh and its part of the interval come from the coarser mesh of "
                f"{coarse[0]} x {coarse[1]} elements, by which that part is longer as a rule: give another "
                "--refined-mesh, or end the [window] before it"
            )
        else:
            yield (
                f"the run at the answer with {run.numerics.element} elements on {across} x {along} was lost"
                f"{why}, so that a multiple of what is extrapolated stands in the mesh's part of the "
                "interval for the distance of the two elements: give another --mesh, or end the [window] "
                "before it"
            )

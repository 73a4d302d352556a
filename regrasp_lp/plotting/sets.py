"""A grasp set on its object: where each contact may be, and a best grasp."""

from __future__ import annotations

from matplotlib.axes import Axes

from regrasp_lp.grasp_sets.grasp_set import GraspSet
from regrasp_lp.plotting.grasps import GraspArtists, plot_grasp


def plot_grasp_set(
    grasp_set: GraspSet, ax: Axes | None = None, *, edge_numbers: bool = True
) -> GraspArtists:
    """Draw the object with a best grasp of a set, and bands where each contact of the set may be.

    Every place in a band belongs to some grasp of the set, but not every choice of one place in
    each band does: these are the set's shadows on the edges, not independent contact regions.

    Parameters
    ----------
    grasp_set : GraspSet
    ax : matplotlib.axes.Axes, optional
        By default new axes of a new figure.
    edge_numbers : bool, optional
        Whether to number the edges.

    Returns
    -------
    GraspArtists
    """
    polygon, spans = grasp_set.polygon, grasp_set.spans.tolist()
    bands = {
        finger: (polygon.resolve_contact((edge, low)), polygon.resolve_contact((edge, high)))
        for finger, (edge, (low, high)) in enumerate(
            zip(grasp_set.edges, spans, strict=True), start=1
        )
    }
    return plot_grasp(
        polygon,
        grasp_set.witness,
        grasp_set.torque.cones.whole.friction,
        ax,
        center=grasp_set.center,
        regions=bands,
        edge_numbers=edge_numbers,
    )

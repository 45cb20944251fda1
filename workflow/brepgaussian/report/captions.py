"""Captions of tables, with the definitions that their numbers depend on."""

OURS = (
    "Ours: mean and median over the objects of each group (tuned: thresholds were chosen on them; holdout: none was); "
    "a failed object counts as 0 in scores, shares and IoU and has no distance. Rows where objects are the paper's "
    "hold its printed numbers, on its own objects and with masks corrected by hand; all other rows are on the objects "
    "of this run."
)
DISTANCES = (
    "Lengths in the unit frame. D_c: Chamfer distance between 20,000 samples of result and truth, sum and average of "
    "the two directed means (the paper does not say which; sampling alone gives a sum of sqrt(area / 20,000), about "
    "1e-2); exact: average point-to-triangle distance, floor 0. D_h: Hausdorff distance; 99 %: its 99 % quantile."
)
SOLIDS = (
    "Solids, shares of objects. Valid: BRepCheck finds no fault; closed: no free edge; topology: equal number of faces "
    "and isomorphic face-adjacency graphs labelled by surface type; last resort: the polyhedral fallback was published."
    " Volume IoU from jittered occupancy samples; normals: mean absolute cosine to the nearest triangle's. " + OURS
)


def segmentation(kind: str) -> str:
    """Caption of a table of patch or edge scores."""
    return (
        f"{kind} segmentation of the labelled points. Precision, recall and F1 as in the paper (directed mean distance "
        "at most tau = 0.08), F1 at 0.02 and 0.01, and strict F1: one-to-one matches where both directed distances are "
        f"at most tau. {OURS}"
    )

"""Labelled points in the format of other programs."""

from pathlib import Path

import numpy as np

from brepgaussian.artifacts.base import atomic
from brepgaussian.artifacts.points import read_points


def export_point2cad(points_path: str | Path, out_txt: str | Path) -> None:
    """Write `points.ply` as Point2CAD's input: one line `x y z label` a point, unassigned points left out.

    Args:
        points_path: `points.ply`.
        out_txt: the text file; unit frame, labels consecutive from 0.
    """
    points = read_points(points_path)
    kept = points.label >= 0
    labels = np.unique(points.label[kept], return_inverse=True)[1]
    table = np.column_stack([points.xyz[kept].astype(float), labels])
    with atomic(out_txt) as temporary:
        np.savetxt(temporary, table, fmt=["%.7f", "%.7f", "%.7f", "%d"])

"""Faces none of whose edges any image shows: guesses of the points, which a simpler solid may do without.

Where silhouettes see through a slot and no view shows the wall below it, the hull is cut straight there, and a plane
lies before the curved wall. No silhouette refuses it, and no step of luminance is at its edges.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from brepgaussian.brep.patches import Patch
from brepgaussian.brep.shown import edge_rows, is_shown
from brepgaussian.brep.simplify import Change, between_fillets
from brepgaussian.brep.structure import SMOOTH, Structure

_MOST = 0.04  # of all points: a larger face is none that nobody sees


def unshown(structure: Structure, patches: Sequence[Patch], edges: Sequence[Mapping[str, Any]]) -> list[Change]:
    """Each patch left out no sharp edge of which the images show; its own points may leave the solid with it.

    Not a wall between two fillets, whose other edges are smooth: without it these would cross.

    Args:
        structure: of the present solid.
        patches: that it is made of, in the order of its surfaces.
        edges: the acceptance test's table of edges.
    """
    shown = {index for index, row in edge_rows(edges) if is_shown(row)}
    total = sum(len(p.xyz) for p in patches)
    found = []
    for index, patch in enumerate(patches):
        own = [k for k, e in enumerate(structure.edges) if index in e.surfaces and e.convexity != SMOOTH]
        share = len(patch.xyz) / total
        if own and share <= _MOST and shown.isdisjoint(own) and not between_fillets(index, patches):
            found.append(Change(f"without patch {patch.primitive}, which no image shows", (index,), (), share))
    return found

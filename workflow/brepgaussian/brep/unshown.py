"""Faces none of whose edges any image shows: guesses of the points, which a simpler solid may do without.

Where silhouettes see through a slot and no view shows the wall below it, the hull is cut straight there, and a plane
lies before the curved wall. No silhouette refuses it, and no step of luminance is at its edges.

And fillets of hardly any radius: points are rounded off in the corners of a hole, and become a face of their own, which
the images then shrink to less than they can show.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from brepgaussian.brep.patches import Patch
from brepgaussian.brep.shown import edge_rows, is_shown
from brepgaussian.brep.simplify import Change, between_fillets
from brepgaussian.brep.structure import SMOOTH, Structure
from brepgaussian.geometry.surfaces import Surface

_MOST = 0.04  # of all points: a larger face is none that nobody sees
_SAGITTA = 0.4  # radii from a square edge to the fillet that rounds it off
_LEAST = 1.5  # pixels that this is at least: of less, the points are no reason, and images say if they mind


def unshown(structure: Structure, patches: Sequence[Patch], edges: Sequence[Mapping[str, Any]]) -> list[Change]:
    """All patches left out no sharp edge of which the images show, then each; their own points may leave the solid.

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
    if len(found) > 1:  # walls and floor of a nook that is none go together: alone, either leaves the others open
        gone = tuple(change.gone[0] for change in found)
        names = ", ".join(str(patches[k].primitive) for k in gone)
        excused = sum(change.excused for change in found)
        found.insert(0, Change(f"without patches {names}, which no image shows", gone, (), excused))
    return found


def shrunk(
    structure: Structure, surfaces: Sequence[Surface], patches: Sequence[Patch], footprint: float
) -> list[Change]:
    """The fillets left out whose radius the images have made too small to be seen: all, then each alone.

    Args:
        structure: of the present solid.
        surfaces: that it names, as the images have them.
        patches: that it is made of.
        footprint: of a pixel, unit frame.
    """
    total = sum(len(p.xyz) for p in patches)
    small = []
    for index, (surface, patch) in enumerate(zip(surfaces, patches, strict=False)):
        smooth = sum(e.convexity == SMOOTH for e in structure.edges if index in e.surfaces)
        seen = _SAGITTA * surface.radius >= _LEAST * footprint
        if surface.kind == "cylinder" and smooth == 2 and not seen and len(patch.xyz) <= _MOST * total:
            small.append(index)
    groups = [tuple(small)] if len(small) > 1 else []
    return [_left_out(group, patches, total) for group in [*groups, *((k,) for k in small)]]


def _left_out(group: tuple[int, ...], patches: Sequence[Patch], total: int) -> Change:
    names = ", ".join(str(patches[i].primitive) for i in group)
    name = (
        f"without patches {names}, too small a fillet each" if len(group) > 1 else f"without patch {names}, too small"
    )
    share = sum(len(patches[i].xyz) for i in group) / total
    return Change(name, group, (), share, faint=True)

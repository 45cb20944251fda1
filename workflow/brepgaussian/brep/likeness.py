"""What two solids of one object have in common: their faces by surface, and how these meet."""

from collections import Counter
from typing import Any

from brepgaussian.brep.job import Attempt

OTHER_TOPOLOGY = "its topology differs"
_HALF = 0.5  # of a patch is explained, or it is left out


def difference(before: Attempt, after: Attempt) -> str:
    """Why a rebuilt solid is not the same one with better surfaces; empty if it is."""
    if after.shape is None or after.verdict.structure is None or before.verdict.structure is None:
        return "; ".join(after.verdict.faults) or "it has no structure"
    if named(before) != named(after):
        return OTHER_TOPOLOGY
    new = set(after.verdict.doubts) - set(before.verdict.doubts)
    return "; ".join(sorted(new)) if len(after.verdict.doubts) > len(before.verdict.doubts) else ""


def closer(before: Attempt, after: Attempt) -> bool:
    """Whether two solids have the same faces, and the second no edge besides: corners have come together."""
    faces, pairs = named(before)
    new_faces, new_pairs = named(after)
    return faces == new_faces and new_pairs <= pairs


def left_out(before: Attempt, after: Attempt, gate: float) -> str:
    """Which patches a rebuilt solid has no face for although the solid before had; empty if none."""
    pairs = enumerate(zip(before.verdict.explained, after.verdict.explained, strict=False))
    lost = [str(i) for i, (old, new) in pairs if old >= gate and new < _HALF]
    return f"it leaves out patches {', '.join(lost)}" if lost else ""


def named(attempt: Attempt) -> tuple[Counter[Any], Counter[Any]]:
    """Faces by surface and adjacent pairs of surfaces (once for each pair of faces).

    Used surfaces are numbered in order: indices shift where unused caps are left out.
    """
    structure = attempt.verdict.structure
    assert structure is not None
    used = sorted({f.surface for f in structure.faces})
    name = {s: i for i, s in enumerate(used)}
    faces = Counter(name[f.surface] for f in structure.faces)
    pairs = {tuple(sorted(e.faces)): tuple(sorted(name[s] for s in e.surfaces)) for e in structure.edges}
    return faces, Counter(pairs.values())

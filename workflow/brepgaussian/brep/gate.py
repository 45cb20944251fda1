"""Is this solid fit to be published? Validity, and whether it explains the points and the silhouettes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep import occ, solid
from brepgaussian.brep.cells import SAMPLE_SPACING, sample_triangles
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.silhouettes import Silhouettes
from brepgaussian.brep.structure import Structure, extract
from brepgaussian.brep.verdict import Verdict
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.settings.brep import BrepSettings

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_DEFLECTION, _ANGLE = 5e-4, 0.2  # of the tessellation that is compared: a fifth of a pixel at 400 px
_SIGMAS = 3.0
_SPACINGS = 1.5  # no place on a face is farther than this many spacings from a sample
_IDENTICAL = 1e-6  # distance between two surfaces that are one, unit frame
_PROBES = 30
_SHORT_EDGE = 1e-5  # unit frame; shorter edges are debris
_LEAST_VOLUME = 1e-6
_MOST_NEAR = 10_000  # points that tell how much of a cloud lies on a solid
_BEYOND = 1.01  # of a limit at which a search for neighbours ends: the end itself is not found
_HALF = 0.5  # of a patch is on its own face, or it has hardly one
_BESIDE = 4  # samples of the solid beside a point: at an edge they lie on two faces


def examine(
    shape: Any,
    patches: Sequence[Patch],
    silhouettes: Silhouettes | None,
    settings: BrepSettings,
    ends: Array | None = None,
    left_out: Sequence[Patch] = (),
) -> Verdict:
    """Examine a solid (TopoDS_Shape, unit frame).

    Args:
        shape: the solid.
        patches: that it was built from.
        silhouettes: of the views, None without.
        settings: the limits.
        ends: (N, 3) points on open borders.
        left_out: patches that were not used; their points count all the same.
    """
    faults = integrity(shape)
    if faults:
        return Verdict(faults)
    surfaces = [p.surface for p in patches]
    structure = extract(shape, surfaces)
    occ.tessellate(shape, _DEFLECTION, _ANGLE)
    nodes, triangles, owner = occ.mesh_of(shape)
    samples, _, source, weight = sample_triangles(nodes[triangles], SAMPLE_SPACING)
    same = identical(patches)
    on = np.array([same[f.surface] if f.surface >= 0 else -1 for f in structure.faces])[owner[source]]
    explained, bare = _explain(patches, same, samples, weight, on)
    sizes = np.array([0 if p.cap else len(p.xyz) for p in patches])
    faces = np.array([f.surface for f in structure.faces])
    near = _Nearness(samples, surfaces, faces[owner[source]], (*patches, *left_out))
    low = [i for i, p in enumerate(patches) if explained[i] < settings.gate_explained and not p.cap]
    iou = silhouettes.iou(nodes[triangles]) if silhouettes is not None else None
    about = {i: f"patch {patches[i].primitive} is explained to {explained[i]:.0%}" for i in low}
    doubts = list(about.values())
    moved = [i for i in low if explained[i] >= _HALF and _covered(patches[i], samples) >= settings.gate_explained]
    if iou is not None and iou < settings.gate_iou:
        doubts.append(f"silhouettes agree to an IoU of {iou:.3f} only")
    if any(f.surface < 0 for f in structure.faces):
        doubts.append("a face lies on no primitive")
    hints = [f"{bare:.1%} of the area has no points"] if bare > settings.gate_bare else []
    return Verdict(
        faults=(),
        doubts=tuple(doubts),
        borders=tuple(about[i] for i in moved),
        hints=tuple(hints),
        explained=tuple(float(e) for e in explained),
        explained_all=float(explained @ sizes / max(sizes.sum(), 1)),
        on_solid=near.share(np.concatenate([*(p.xyz for p in (*patches, *left_out) if not p.cap), np.zeros((0, 3))])),
        iou=iou,
        bare=bare,
        ends=_at_edges(structure, ends, settings),
        caps=sum(f.surface >= 0 and patches[f.surface].cap for f in structure.faces),
        faces=len(structure.faces),
        edges=len(structure.edges),
        vertices=sum(v.corner for v in structure.vertices),
        volume=occ.volume(shape),
        structure=structure,
    )


class _Nearness:
    """How near points are to a solid: to the surfaces of the faces beside them."""

    def __init__(self, samples: Array, surfaces: Sequence[Surface], on: Indices, patches: Sequence[Patch]) -> None:
        """Take samples on the solid's faces, (N,) the surface of each, and the patches, which know the noise.

        Those that are left out, too: solids with and without them are compared.
        """
        self._tree, self._surfaces, self._on = cKDTree(samples), surfaces, on
        self._limit = _SIGMAS * float(np.median([p.sigma for p in patches if not p.cap] or [0.0]))

    def share(self, points: Array) -> float:
        """Share of (N, 3) points within three noises of the solid."""
        points = points[:: max(1, len(points) // _MOST_NEAR)]
        if not len(points):
            return 1.0
        reach = _SPACINGS * SAMPLE_SPACING + self._limit
        found = self._tree.query(points, k=_BESIDE, distance_upper_bound=reach)[1]
        faces = np.append(self._on, -1)[found]  # (N, _BESIDE)
        best = np.full(len(points), np.inf)
        for surface in np.unique(faces[faces >= 0]).tolist():
            rows = np.flatnonzero((faces == surface).any(axis=1))
            best[rows] = np.minimum(best[rows], np.abs(self._surfaces[surface].signed_distance(points[rows])))
        return float(np.mean(best <= max(self._limit, _IDENTICAL)))


def _at_edges(structure: Structure, ends: Array | None, settings: BrepSettings) -> float:
    """Share of the points on open borders that lie at an edge of the solid; 1 if there are none."""
    if ends is None or not len(ends) or not structure.edges:
        return 1.0
    edges = cKDTree(np.concatenate([e.polyline for e in structure.edges]))
    return float(np.mean(edges.query(ends)[0] <= settings.max_reach))


def integrity(shape: Any) -> tuple[str, ...]:
    """Faults that forbid publishing a solid: not one closed valid solid of positive volume, or debris."""
    count = len(occ.solids(shape))
    if count != 1:
        return (f"{count} solids instead of one",)
    faults = []
    if not solid.is_valid(shape):
        faults.append("BRepCheck finds it invalid")
    free = solid.free_edges(shape)
    if free:
        faults.append(f"{free} edges are not shared by two faces")
    if occ.volume(shape) < _LEAST_VOLUME:
        faults.append("no positive volume")
    if solid.shortest_edge(shape) < _SHORT_EDGE:
        faults.append("an edge shorter than rounding")
    return tuple(faults)


def identical(patches: Sequence[Patch]) -> list[int]:
    """For each patch the smallest index of one on the same unbounded surface (orientation apart)."""
    result: list[int] = []
    for index, patch in enumerate(patches):
        step = max(1, len(patch.xyz) // _PROBES)
        probes = patch.surface.project(patch.xyz[::step])
        same = (
            k
            for k in result
            if patches[k].surface.kind == patch.surface.kind
            and np.abs(patches[k].surface.signed_distance(probes)).max() < _IDENTICAL
        )
        result.append(next(same, index))
    return result


def _within(points: Array, others: Array, limit: float) -> NDArray[np.bool_]:
    """(N,) whether one of the others lies within `limit` of each point; no search goes farther than that."""
    distance = cKDTree(others).query(points, distance_upper_bound=_BEYOND * limit)[0]
    return np.asarray(distance <= limit)


def _covered(patch: Patch, samples: Array) -> float:
    """Share of a patch's points beside samples of a solid's faces."""
    return float(np.mean(_within(patch.xyz, samples, _SPACINGS * SAMPLE_SPACING + _SIGMAS * patch.sigma)))


def _explain(
    patches: Sequence[Patch], same: list[int], samples: Array, weight: Array, on: NDArray[np.int64]
) -> tuple[Array, float]:
    """(P,) explained share of each patch, and the share of the solid's area without points."""
    explained, seen = np.zeros(len(patches)), np.zeros(len(samples), bool)
    for index, patch in enumerate(patches):
        own = np.flatnonzero(on == same[index])
        if not len(own) or patch.cap:
            continue
        explained[index] = _covered(patch, samples[own])
        seen[own[_within(samples[own], patch.xyz, patch.reach + patch.sigma)]] = True
    return explained, float(1 - weight[seen].sum() / max(weight.sum(), 1e-300))

"""The truth-free acceptance test: do all edges and silhouettes of a solid agree with the images?

Every edge's and every apparent contour's median |silhouette residual| is below a tenth of a pixel (a little more where
few samples tell it), that of no stretch of one above three, the masks' IoU is above .998, and next to no pixel is wrong
that lies clear of the masks' borders. Global residuals do not show a failure: the worst edge does, and where an edge is
missing altogether, the hole that it would bound. What lies between the edges shows in places that views disagree about,
or whose greys follow the slant of the views, and an edge that the solid has not in steps of grey where it has none.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.agreement import disagreement
from brepgaussian.brep.refine.mesh import FaceMesh
from brepgaussian.brep.refine.observe import Found, Images, measure, prepare, whole_images
from brepgaussian.brep.refine.parallax import Displaced, displaced
from brepgaussian.brep.refine.samples import SPACING, edge_samples, see_contours, see_edges
from brepgaussian.brep.refine.solve import TONES, State, residuals
from brepgaussian.brep.refine.steps import stepped
from brepgaussian.brep.refine.visibility import (
    CREASE,
    SILHOUETTE,
    Masks,
    Scene,
    Seen,
    classify,
    compare_masks,
    group_names,
)
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.settings.brep import BrepSettings

Array = NDArray[np.float64]

PX_NOISE = 0.01  # of the worst edge's silhouette residual: less than that is noise of the median
IOU_NOISE = 5e-5  # the same of the masks' IoU
WINDOW_PX = 6.0  # search; an edge that is not found within it counts as this far off
_LEAST_SEEN = 8  # silhouette samples below which an edge is not judged
_STRETCH = 0.02  # unit frame: length of an edge that is judged on its own
_STRETCH_SEEN = 12  # silhouette samples below which it is not
_STRETCH_LIMITS = 3.0  # times an edge's limit: right solids had .05 px at most, a cone over two planes .6 at their edge
_FEW = 2.0  # over the root of their number: share of the limit by which the median of so few samples is uncertain


@dataclass(frozen=True)
class Acceptance:
    """Outcome of the test.

    Attributes:
        silhouette_px: worst edge's median |silhouette residual|; NaN if no edge is seen against the background.
        mask_iou: IoU of the silhouettes over all views.
        astray: share of the silhouettes' pixels that are wrong and clear of all borders.
        accepted: all within their limits.
        disputed: largest area that views disagree about, px^2.
        displaced: what parallax places elsewhere; None where the solid is refused anyway.
        stepped: largest area where views show steps clear of all edges, px^2; 0 where the solid is refused anyway.
        mask_pixels: pixels that the masks' figures count.
        edges: per edge or contour: name, number of samples, median |silhouette| and |interior| residual in px.
        faces: per face: the worst of its edges' medians, the number of samples seen, and of places that views
            disagree about.
    """

    silhouette_px: float
    mask_iou: float
    astray: float
    accepted: bool
    disputed: float = 0.0
    displaced: Displaced | None = None
    stepped: float = 0.0
    mask_pixels: int = 0
    edges: list[dict[str, object]] = field(default_factory=list)
    faces: list[dict[str, object]] = field(default_factory=list)


def keeps(new: Acceptance, old: Acceptance) -> bool:
    """Whether a solid is accepted where another one is, and its masks are as good to within noise."""
    return bool(new.accepted >= old.accepted and new.mask_iou > old.mask_iou - IOU_NOISE)


def acceptance(
    mesh: FaceMesh,
    structure: Structure,
    surfaces: Sequence[Surface],
    views: Views,
    settings: BrepSettings,
    *,
    images: Images | None = None,
    poses: Array | None = None,
    tone: Array | None = None,
) -> Acceptance:
    """Judge a solid by the images alone.

    Args:
        mesh: the solid's triangulation, faces as in `structure`.
        structure: its edges by surface.
        surfaces: the surfaces that `structure` names.
        views: images and cameras.
        settings: the limits.
        images: what `observe.prepare(views)` gave, to save doing it again.
        poses: (V, 3) image corrections that the refinement found.
        tone: (2,) tone coefficients that the refinement found, px.
    """
    images = images or prepare(views)
    poses = np.zeros((len(views.cameras), 3)) if poses is None else poses
    tone = np.zeros(TONES) if tone is None else tone
    scene, state = Scene(mesh), State(tuple(surfaces), tone, poses)
    seen = watch(mesh, scene, structure, state, views, settings.refine_observations)
    found = measure(images, seen, WINDOW_PX, WINDOW_PX / 2)
    masks = compare_masks(scene, views.cameras, views.alpha, poses)
    test = judge(seen, found, structure, tone, masks, settings)
    return judge_faces(test, scene, structure, views, poses, settings)


def watch(mesh: FaceMesh, scene: Scene, structure: Structure, state: State, views: Views, limit: int) -> Seen:
    """All usable observations of edges and apparent contours of the present solid."""
    samples = edge_samples(structure, state.surfaces, len(views.cameras), limit)
    rays = see_edges(samples, state.surfaces, views.cameras, state.poses)
    contours = see_contours(mesh, structure, state.surfaces, views.cameras, state.poses, 2 * SPACING)
    return classify(rays.joined(contours), scene, structure, views.cameras, state.poses)


def judge(
    seen: Seen, found: Found, structure: Structure, tone: Array, masks: Masks, settings: BrepSettings
) -> Acceptance:
    """The table of residuals and the verdict on edges and silhouettes."""
    residual = np.abs(residuals(seen, found, tone))
    outline = seen.kind == SILHOUETTE
    # A silhouette that is not there is a fault; an interior edge may have no contrast.
    residual = np.where(outline & np.isnan(residual), WINDOW_PX, residual)
    groups = np.unique(seen.rays.group)
    table: list[dict[str, object]] = []
    around: dict[int, list[tuple[float, int]]] = {}
    medians, sure = [], True
    for group, name in zip(groups, group_names(structure, groups), strict=True):
        mine = seen.rays.group == group
        silhouette = residual[mine & outline]
        inner = residual[mine & ~outline & np.isfinite(residual)]
        median = float(np.median(silhouette)) if len(silhouette) >= _LEAST_SEEN else None
        stretch = _worst_stretch(seen.rays.points[mine & outline], silhouette)
        sure &= stretch < settings.accept_silhouette_px * _STRETCH_LIMITS
        table.append(
            {
                "name": name,
                "silhouettes": len(silhouette),
                "silhouette_px": median,
                "stretch_px": stretch,
                "creases": int((mine & (seen.kind == CREASE)).sum()),
                "interior": len(inner),
                "interior_px": float(np.median(inner)) if len(inner) >= _LEAST_SEEN else None,
            }
        )
        if median is not None:
            medians.append(median)
            sure &= median < settings.accept_silhouette_px * (1 + _FEW / np.sqrt(len(silhouette)))
        edge = structure.edges[group].faces if group < len(structure.edges) else (group - len(structure.edges),)
        for face in edge:
            around.setdefault(int(face), []).append((median if median is not None else 0.0, int(mine.sum())))
    faces: list[dict[str, object]] = [
        {
            "face": i,
            "seen": sum(n for _, n in around.get(i, [])),
            "silhouette_px": max((m for m, _ in around.get(i, [])), default=None),
        }
        for i in range(len(structure.faces))
    ]
    worst = max(medians, default=float("nan"))
    outlines = masks.iou > settings.accept_iou and masks.astray < settings.accept_astray
    good = bool(medians and sure and outlines)
    return Acceptance(worst, masks.iou, masks.astray, good, mask_pixels=masks.pixels, edges=table, faces=faces)


def _worst_stretch(points: Array, residual: Array) -> float:
    """Median residual (px) of the worst piece of an edge or contour, for samples at points (N, 3); 0 if none is seen.

    The median over a whole edge does not show where a smooth face was put over two that meet in an edge.
    """
    if not len(points):
        return 0.0
    _, cell, count = np.unique(np.floor(points / _STRETCH), axis=0, return_inverse=True, return_counts=True)
    medians = ndimage.median(residual, cell.ravel(), np.flatnonzero(count >= _STRETCH_SEEN))
    return float(np.max(medians, initial=0.0))


def judge_faces(
    test: Acceptance,
    scene: Scene,
    structure: Structure,
    views: Views,
    poses: Array,
    settings: BrepSettings,
) -> Acceptance:
    """The verdict on what lies between the edges added; depths, which cost most, where nothing else is wrong."""
    shown = whole_images(views)
    disputed = disagreement(scene, structure, shown, poses)
    good = test.accepted and disputed.area <= settings.accept_disputed
    off = displaced(scene, structure, shown, poses) if good else None
    steps = stepped(scene, structure, shown, poses) if good else 0.0
    good = good and off is not None and off.area <= settings.accept_displaced and steps <= settings.accept_stepped
    faces = [row | {"disputed": int(count)} for row, count in zip(test.faces, disputed.faces, strict=True)]
    return replace(test, accepted=good, disputed=disputed.area, displaced=off, stepped=steps, faces=faces)

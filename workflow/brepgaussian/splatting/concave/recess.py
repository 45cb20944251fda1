"""Recesses that open at a face and at its edge: slots milled into a side, notches with a ceiling.

Silhouettes see into them from two sides and carve their mouth, but not the inner corner: what they leave there has no
planar lid. At the face the recess shows its section; how deep that goes the views tell, as of a channel.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements, rays_near
from brepgaussian.splatting.concave.columns import FINER, PARALLEL, Columns
from brepgaussian.splatting.concave.contours import chords_in, lost_share
from brepgaussian.splatting.concave.gaps import gaps, on_one_plane
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import SURE
from brepgaussian.splatting.concave.sweep import LEAST_VOLUME_VOXELS, MOST_LOST, Outlined
from brepgaussian.splatting.concave.volume import Volume, ends_of

Array = NDArray[np.float64]

_MOUTH_VOXELS = (1.0, 3.5)  # below a face, between which a recess shows its section
_WALLS = 0.5  # of a section's border are walls, else it is what lies beside a boss or before a wall
_LEAST_CELLS = 30  # of a section, in voxels
_DEPTHS = 8  # that are tried, evenly, before those around the best
_SHALLOWEST_VOXELS = 3.0  # deep, for a start
_MOST_TRIED = 4  # sections of all faces, those with most in them first
_MOST_GAPS = 2  # between faces of one plane that are tried
_COVERED = 0.1  # of a section is cut away of faces that views have confirmed: they stand in it
_IN_HOLE = 0.5  # of a section, then it is that hole's; voxels are coarse
_GAIN, _SURE_GAIN = 0.6, 0.75  # of the disagreement is left at most, and if rays surely tell of the recess
_LEAST_RAYS = 100

logger = log.get_logger("stage1")


def open_recesses(
    images: Images, hull: Volume, faces: Sequence[Outlined], known: Sequence[Prism] = ()
) -> tuple[Volume, list[Prism]]:
    """Carve what is left in the recesses of confirmed faces.

    Args:
        images: of all views.
        hull: opened elsewhere.
        faces: that views have confirmed: outlines (R, C) on lattices.
        known: what is open already; holes that end in others have no floor that could lie deeper.

    Returns:
        The opened hull and the recesses.
    """
    done: list[Prism] = []
    planes, through = _planes(faces, hull.spacing), [prism for prism in known if prism.through]
    for of, most in ((_gaps, _MOST_GAPS), (_sections, _MOST_TRIED)):  # views show more exactly than a hull does
        sections = [s for face in planes for s in of(hull, face, faces) if not _in_hole(s[0], through)]
        scene = hull.scene() if sections else None
        for deepest, _ in sorted(sections, key=lambda s: -s[1])[:most]:
            assert scene is not None
            found = _deepened(images, hull, scene, deepest)
            if found is None:
                continue
            opened = hull.without(found, 0.0)
            if hull.lost_in(opened) >= LEAST_VOLUME_VOXELS:
                hull, scene = opened, opened.scene()
                done.append(found)
    return hull, done


def _planes(faces: Sequence[Outlined], spacing: float) -> list[Outlined]:
    """Faces without those on the plane of an earlier one: it shows the same sections."""
    found: list[Outlined] = []
    for lattice, outline in faces:
        if not any(on_one_plane(lattice, other, spacing) for other, _ in found):
            found.append((lattice, outline))
    return found


def _sections(hull: Volume, face: Outlined, faces: Sequence[Outlined]) -> Iterator[tuple[Prism, float]]:
    """Sections that are empty at a face and full below it, as deep as nothing confirmed stands in them; and voxels."""
    normal, top = face[0].normal, face[0].offset
    columns = Columns.of(hull, normal)
    near, far = (top - v * hull.spacing for v in _MOUTH_VOXELS)
    at_mouth = columns.field[(columns.heights < near) & (columns.heights > far)]
    below = columns.field[columns.heights <= far]
    if not len(at_mouth) or not len(below):
        return
    solid, filled = at_mouth.max(axis=0) > 0, below.max(axis=0) > 0
    labels, count = ndimage.label(~solid & filled)
    for k in range(1, count + 1):
        section = labels == k
        rim = ndimage.binary_dilation(section) & ~section
        if section.sum() < _LEAST_CELLS or solid[rim].mean() < _WALLS:
            continue
        prism = columns.prism(np.kron(section, np.ones((FINER, FINER), bool)), float(columns.heights[0]), top)
        depth = _free_depth(prism, faces, hull.spacing)
        volume = (below[columns.heights[: len(below)] > top - depth] > 0)[:, section].sum()
        if volume >= LEAST_VOLUME_VOXELS:
            yield replace(prism, depth=depth), float(volume)


def _gaps(hull: Volume, face: Outlined, faces: Sequence[Outlined]) -> Iterator[tuple[Prism, float]]:
    """What faces of one plane leave of it, as deep as nothing confirmed stands there; and voxels."""
    for gap in gaps(hull, face, faces):
        free = replace(gap, depth=_free_depth(gap, faces, hull.spacing))
        volume = hull.lost_in(hull.without(free, 0.0))
        if volume >= LEAST_VOLUME_VOXELS:
            yield free, float(volume)


def _in_hole(section: Prism, through: Sequence[Prism]) -> bool:
    """Whether a section is the mouth of one of the holes that go through, or into another one."""
    cells = section.lattice.centers()[section.outline]
    alike = [p for p in through if p.lattice.normal @ section.lattice.normal > PARALLEL]
    return any(over(p.lattice, p.outline, cells)[0].mean() > _IN_HOLE for p in alike)


def _free_depth(prism: Prism, faces: Sequence[Outlined], spacing: float) -> float:
    """Down to where a confirmed face stands in a section."""
    depth = prism.depth
    for lattice, outline in faces:
        within, heights = over(prism.lattice, prism.outline, lattice.centers()[outline])
        down = np.sort(-heights[within & (heights < -2 * spacing)])
        share = np.arange(1, len(down) + 1) * lattice.pitch**2 / prism.area
        if len(down) and share[-1] > _COVERED:
            depth = min(depth, float(down[share > _COVERED][0]))
    return depth


def _deepened(images: Images, hull: Volume, scene: Scene, deepest: Prism) -> Prism | None:
    """The section down to where views agree best, or None if they don't agree much better."""
    near = rays_near(images, ends_of(deepest, 0.0))
    rays = near.hitting(scene, lambda points: deepest.contains(points, 0.0))
    before = rays.costs(scene)
    if np.count_nonzero(before[1]) < _LEAST_RAYS:
        return None
    known: dict[float, float] = {0.0: 0.0}

    def cost(depth: float) -> float:
        """By how much more the rays disagree in all."""
        if depth not in known:
            after = rays.costs(hull.without(replace(deepest, depth=depth), 0.0).scene())
            known[depth] = float((after[0] - before[0])[before[1] & after[1]].sum())
        return known[depth]

    best = min((0.0, *_depths(deepest.depth, hull.spacing)), key=cost)
    if not best:
        return None
    step = min(deepest.depth / _DEPTHS, best)
    while step > hull.spacing / 2:
        step /= 2
        best = min((d for d in (best, best - step, best + step) if 0 < d <= deepest.depth), key=cost)
    recess = replace(deepest, depth=best)
    after = hull.without(recess, 0.0).scene()
    sure = rays.advantage(before, rays.costs(after))
    said = disagreements(images, scene, after, 2 * hull.spacing, near)
    return recess if _believed(images, scene, recess, said, sure) else None


def _depths(deepest: float, spacing: float) -> list[float]:
    """Depths to start from: evenly, and halves of the least: the slot in a long pin's end is shallow for the pin."""
    step = deepest / _DEPTHS
    halves = range(1, 1 + max(0, int(np.log2(step / (_SHALLOWEST_VOXELS * spacing)))))
    return [*(step / 2**k for k in halves), *(k * step for k in range(1, _DEPTHS + 1))]


def _believed(images: Images, scene: Scene, recess: Prism, said: tuple[float, float, int], sure: float) -> bool:
    """Whether views agree much better on a recess, and silhouettes don't need what was there.

    Args:
        images: of all views.
        scene: the hull before it is cut.
        recess: what is cut.
        said: by the rays around it, which ask for walls that it shares with others, too; see `disagreements`.
        sure: standard errors by which the rays in it agree better.
    """
    old, new, count = said
    chords = chords_in(scene, *images.contour_rays)
    lost = lost_share(chords, chords.within(recess, 0.0))
    gain = _SURE_GAIN if sure > SURE else _GAIN
    good = better(said, gain, _LEAST_RAYS, untold=False) and lost <= MOST_LOST
    logger.info(
        "recess of area %.4f, normal %s, %.4f deep: views disagree by %.2f for %.2f of the hull, %d rays, %.1f sigma%s",
        recess.area, np.round(recess.lattice.normal, 2).tolist(), recess.depth, new, old, count, sure,
        "" if good else ": not believed",
    )  # fmt: skip
    return good

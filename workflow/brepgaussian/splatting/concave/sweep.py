"""Channels and slots that are open at their ends, made straight.

Silhouettes along a channel show its section; with perspective they show it at the ends only, and towards the
middle a hull closes it. So a column along the direction of a face's normal that the hull leaves empty anywhere
between two faces is taken to be empty all along, if the silhouettes stay filled and the views agree better.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements, one_surface
from brepgaussian.splatting.concave.columns import BESIDE_VOXELS, FINER, PARALLEL, Cut, cuts
from brepgaussian.splatting.concave.contours import Chords, chords_in, lost_rays, lost_share
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane, planar_regions
from brepgaussian.splatting.concave.prism import Lattice, Prism, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Field = NDArray[np.float32]
Outlined = tuple[Lattice, NDArray[np.bool_]]

LEAST_AREA = 0.01  # of a face that ends a channel
_MOST_BEND = 0.12  # rad: of faces that end a channel; slit walls, badly carved, bend by .09, strips of shafts by .13
LEAST_VOLUME_VOXELS = 300  # less is left to the surfels
MOST_LOST = 0.01  # share of the rays through a cut that it may leave with nothing
_DEEP = 0.5  # share of what silhouettes miss that lies deep in a section, not at its brim: the section is wrong
_GAIN = 0.8  # a cut leaves at most this share of the disagreement
_LEAST_RAYS = 200
_LEAST_RAYS_AT_ENDS = 60  # that both ends are open speaks for a channel, too
_LEAST_RAYS_OF_PART = 10  # one of several channels must change: what no ray tells of, others do not speak for
_MOST_CLOSED = 0.25  # of the rays agree about the wall that a cut opens: true channels had .12, one under a slot .36
_SHUT = 0.5  # of a channel's section lies behind faces without a hole there
_SHORTER = (0.35, 0.5, 0.7)  # of a column, from either end: what a wide bore's funnel in a hull would really be
_MOST_CUTS = 4  # channels of one part
_MOST_CHECKED = 12  # hypotheses of one direction, largest first
_MOST_TRIED = 6  # of all directions, for the next cut, largest first,
_MOST_NECKED = 2  # and of those whose parts are among them

logger = log.get_logger("stage1")


def straighten(images: Images, hull: Volume, faces: Sequence[Outlined] = ()) -> tuple[Volume, list[Prism]]:
    """Empty the columns that are empty at their ends.

    Args:
        images: of all views.
        hull: what silhouettes leave.
        faces: that views have confirmed: outlines (R, C) on lattices.

    Returns:
        The hull and what was cut.
    """
    done: list[Prism] = []
    for _ in range(_MOST_CUTS):
        mesh = hull.mesh()
        scene = Scene(*mesh)
        chords = chords_in(scene, *images.contour_rays)
        regions = [r for r in planar_regions(*mesh, 2 * hull.spacing) if r.area(*mesh) >= LEAST_AREA]
        flat = [r for r in regions if r.bend < _MOST_BEND]
        every = [c for normal in directions(flat) for c in _possible(chords, cuts(hull, normal, regions))]
        # the right direction explains all of a channel at once, others parts of it
        largest = sorted(every, key=lambda c: -c.volume)
        necked = [c for c in largest if c.necked][:_MOST_NECKED]  # what parts of them do not explain
        for cut in [c for c in largest if not c.necked][:_MOST_TRIED] + necked:
            if any(_is_shut(prism, faces, hull.spacing, not cut.at_ends) for prism in cut.prisms):
                continue
            opened, good = _judged(images, hull, cut)
            if good and len(cut.prisms) > 1:
                cut, opened, good = _told(images, hull, cut, opened)
            if good and (cut.at_ends or not _ends_before(images, hull, cut, opened)):
                less = None if cut.at_ends else _shown_at_ends(images, hull, cut, opened, every)
                hull, prisms = less or (opened, cut.prisms)
                done += prisms
                break
        else:
            break
    return hull, done


def _judged(images: Images, hull: Volume, cut: Cut) -> tuple[Volume, bool]:
    """A hull without a cut, and whether views agree about it better."""
    opened = _without(hull, cut.prisms)
    before, after, reach = hull.scene(), opened.scene(), 2 * hull.spacing
    old, new, count = said = disagreements(images, before, after, reach)
    good = better(said, _GAIN, _LEAST_RAYS_AT_ENDS if cut.at_ends else _LEAST_RAYS, untold=False)
    good = good and one_surface(images, before, after, reach) <= _MOST_CLOSED
    logger.info(
        "%s along %s, %.0f voxels: views disagree by %.2f for %.2f of the hull, %d rays%s",
        "channel" if len(cut.prisms) == 1 else f"{len(cut.prisms)} channels",
        np.round(cut.prisms[0].lattice.normal, 2).tolist(), cut.volume, new, old, count,
        "" if good else ": not believed",
    )  # fmt: skip
    return opened, good


def _told(images: Images, hull: Volume, cut: Cut, opened: Volume) -> tuple[Cut, Volume, bool]:
    """Those of several channels that rays tell of, the hull without them, and whether views agree about it better.

    What lies between a recess and a slot on the other side of a disc is empty at both ends, too.
    """
    scene, reach = hull.scene(), 2 * hull.spacing
    alone = [disagreements(images, scene, _without(hull, (p,)).scene(), reach)[2] for p in cut.prisms]
    told = tuple(p for p, count in zip(cut.prisms, alone, strict=True) if count >= _LEAST_RAYS_OF_PART)
    if len(told) == len(cut.prisms):
        return cut, opened, True
    less = replace(cut, prisms=told)
    return (less, *_judged(images, hull, less)) if told else (less, hull, False)


def _is_shut(prism: Prism, faces: Sequence[Outlined], spacing: float, across: bool) -> bool:
    """Whether confirmed faces cover one end of columns, or what lies before it.

    What shows through a wall of one grey agrees with any depth behind it. Past a slope all columns are empty, and what
    ends there only seems to be open at both ends; faces `across` columns count where these are not empty at both:
    regions may take the mouth of a hole for a part of its face.
    """
    covered = {1.0: 0.0, -1.0: 0.0}
    for lattice, outline in faces:
        facing = float(lattice.normal @ prism.lattice.normal)
        if not across and abs(facing) > PARALLEL:
            continue
        within, heights = over(prism.lattice, prism.outline, lattice.centers()[outline])
        within &= (heights < 2 * spacing) & (heights > -prism.depth - 2 * spacing)
        covered[1.0 if facing > 0 else -1.0] += within.sum() * lattice.pitch**2 * abs(facing)
    return max(covered.values()) > _SHUT * prism.area


def _ends_before(images: Images, hull: Volume, cut: Cut, opened: Volume) -> bool:
    """Whether views agree better where columns that are empty somewhere are cut from one end only, but not as far.

    Silhouettes that see through a bore with a narrower end leave a funnel, as wide as the bore at one end of it.
    """
    (prism,) = cut.prisms
    for share in _SHORTER:
        for skipped in (0.0, (1 - share) * prism.depth):
            origin = prism.lattice.origin - skipped * prism.lattice.normal
            part = replace(prism, depth=share * prism.depth, lattice=replace(prism.lattice, origin=origin))
            shorter = _without(hull, (part,))
            old, new, count = disagreements(images, shorter.scene(), opened.scene(), 2 * hull.spacing)
            if count >= _LEAST_RAYS_AT_ENDS and old <= _GAIN * new:
                logger.info("views disagree by %.2f for %.2f if it ends at %.2f of its length", old, new, share)
                return True
    return False


def _without(hull: Volume, prisms: Sequence[Prism]) -> Volume:
    for prism in prisms:
        hull = hull.without(prism, 0.0)
    return hull


def _shown_at_ends(
    images: Images, hull: Volume, cut: Cut, opened: Volume, every: Sequence[Cut]
) -> tuple[Volume, tuple[Prism, ...]] | None:
    """What is open at both ends of columns that are empty somewhere, where nothing tells of the rest of them.

    A bore across a channel's floor is a slit along all of it, and views that see the floor speak for both.
    """
    (prism,) = cut.prisms
    parts = [
        other
        for other in every
        if other.at_ends and len(other.prisms) == 1 and _share(other.prisms[0], prism) and other.volume < cut.volume
    ]
    if not parts:
        return None
    ends = tuple(part.prisms[0] for part in parts)
    less = _without(hull, ends)
    rest = disagreements(images, less.scene(), opened.scene(), 2 * hull.spacing)
    if better(rest, _GAIN, _LEAST_RAYS, untold=False):
        return None
    together = Cut(ends, sum(part.volume for part in parts), True)
    return (less, ends) if _judged(images, hull, together)[1] else None


def _share(one: Prism, other: Prism) -> bool:
    """Whether two columns of one direction have cells and a stretch in common."""
    same = one.outline.shape == other.outline.shape and np.allclose(one.lattice.normal, other.lattice.normal)
    if not same or not (one.outline & other.outline).any():
        return False
    top, end = (float(p.lattice.origin @ p.lattice.normal) for p in (one, other))
    return min(top, end) > max(top - one.depth, end - other.depth)


def directions(faces: Sequence[Plane]) -> list[Array]:
    """Normals of faces with another face at their back, each direction once.

    Faces that look at each other, as those of a bore that silhouettes leave angular, end no channel.
    """
    found: list[Array] = []
    for face in faces:
        behind = any(face.normal @ o.normal < -PARALLEL and face.offset > -o.offset for o in faces)
        if behind and not any(abs(face.normal @ other) > PARALLEL for other in found):
            found.append(face.normal)
    return found


def _possible(chords: Chords, cuts: list[Cut]) -> list[Cut]:
    """Those cuts that leave the silhouettes filled; all that are open at both ends at once as well."""
    largest = sorted(cuts, key=lambda c: -c.volume)[:_MOST_CHECKED]
    kept = [c for cut in largest if (c := _filling(chords, cut)) is not None]
    ends = [c for c in kept if c.at_ends]
    if len(ends) > 1:
        kept.append(Cut(tuple(c.prisms[0] for c in ends), sum(c.volume for c in ends), True))
    return [c for c in kept if c.volume >= LEAST_VOLUME_VOXELS]


def _filling(chords: Chords, cut: Cut) -> Cut | None:
    """A cut that leaves the silhouettes filled, without the brim of its section if that is what they need.

    At a channel's ends the hull is rounded, and a brim as wide as its rim would be cut all along.
    """
    prism = cut.prisms[0]
    removed = chords.within(prism, 0.0)
    if lost_share(chords, removed) <= MOST_LOST:
        return cut
    lost = chords.chosen(lost_rays(chords, removed)[chords.ray]).samples()
    cells, _ = prism.lattice.coordinates(lost)
    deep = prism.lateral(cells) < -BESIDE_VOXELS * FINER * prism.lattice.pitch
    if deep.any() and deep.mean() > _DEEP:
        return None
    brim = np.zeros_like(prism.outline)
    brim[tuple(np.clip(np.round(cells[~deep]).astype(int), 0, np.array(brim.shape) - 1).T)] = True
    less = replace(prism, outline=prism.outline & ~ndimage.binary_dilation(brim, iterations=FINER))
    if not less.outline.any() or lost_share(chords, chords.within(less, 0.0)) > MOST_LOST:
        return None
    return replace(cut, prisms=(less,))

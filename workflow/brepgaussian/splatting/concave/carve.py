"""Open the concavities of a hull's field, level by level (a counterbore's bore lies under its first floor)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from brepgaussian.splatting.concave.believed import agreeable, contradicted, disliked, walled
from brepgaussian.splatting.concave.bends import Bend, bent, cut
from brepgaussian.splatting.concave.counterbored import counterbored
from brepgaussian.splatting.concave.ends import lengthened
from brepgaussian.splatting.concave.even import evened
from brepgaussian.splatting.concave.find import find_curved, find_prisms
from brepgaussian.splatting.concave.islands import has_room, with_islands
from brepgaussian.splatting.concave.join import joined, square_ends, told_once
from brepgaussian.splatting.concave.meeting import crossed, met
from brepgaussian.splatting.concave.onward import onward
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.raised import raised
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shorten import shortened
from brepgaussian.splatting.concave.shoulders import with_shoulders
from brepgaussian.splatting.concave.sounded import sounded
from brepgaussian.splatting.concave.sweep import Outlined, straighten
from brepgaussian.splatting.concave.tops import Top
from brepgaussian.splatting.concave.trim import flatten
from brepgaussian.splatting.concave.turned import turn
from brepgaussian.splatting.concave.volume import MARGIN_CELLS, Volume
from brepgaussian.splatting.concave.walls import agreed, drawn

_LEVELS = 3
_MUCH_DEEPER = 4.0  # cells: floors and tops that views take for each other are farther apart


def open_channels(images: Images, hull: Volume, faces: Sequence[Outlined] = ()) -> tuple[Volume, list[Prism]]:
    """Cut a hull at its outer planes, and carry on all along what it leaves empty at one end or at one angle.

    Arguments are those of `open_concavities`, as are the first two results; `faces` are outlines (R, C) on lattices of
    faces that views have confirmed: no channel goes through them.
    """
    hull, _ = flatten(images, hull)
    hull, channels = straighten(images, hull, faces)
    return turn(images, hull), channels


def open_concavities(
    images: Images, hull: Volume, planes: Sequence[Plane] = (), uncut: Volume | None = None
) -> tuple[Volume, list[Prism], list[Bend]]:
    """Carve pockets and holes that views show to be open although every silhouette is blind to them.

    Args:
        images: of all views.
        hull: what silhouettes leave.
        planes: of the faces that views have confirmed.
        uncut: before channels and corners were cut out, with which bosses in a pocket may have gone. None = the hull.

    Returns:
        The opened hull, the concavities, and what joins those that are ends of a bent bore.
    """
    known: list[Prism] = []
    bends: list[Bend] = []
    floors: list[Prism] = []  # those that were not looked at yet
    below: list[Prism] = []  # what goes on below shoulders
    scene = hull.scene()
    for level in range(_LEVELS):
        sought = find_prisms(images, scene, hull.spacing, floors, planes) if floors or not level else []
        found = told_once(sought, [*known, *below], 2 * hull.spacing)
        deeper, found = raised(known, found, partial(_standing, images, hull, uncut, known)) if level else ({}, found)
        found = [*below, *found]
        if not (found or deeper):
            break
        found, below = _parted(found) if level < _LEVELS - 1 else (found, [])  # the last ones stay whole
        found = with_shoulders(images, scene, square_ends(found, 2 * hull.spacing), 2 * hull.spacing)
        # the far end of a hole may be the floor of what was found before
        before, known = known, joined([*_replaced(known, deeper), *found], 2 * hull.spacing)
        fresh = [k for k, prism in enumerate(known) if k >= len(before) or prism.depth > before[k].depth]
        margins = [hull.margin(prism) for prism in known]
        for k in fresh:
            known[k] = drawn(images, scene, hull, known[k], margins[k])
        known = agreed(known)
        straight, found_bends = bent(images, hull, [known[k] for k in fresh], MARGIN_CELLS * hull.spacing)
        ends = {k for k, end in zip(fresh, straight, strict=True) if end is not known[k]}
        for k, prism in zip(fresh, straight, strict=True):
            known[k] = prism
        wrong: set[int] = set()
        done = [k for k in range(len(known)) if k not in fresh]
        for k in sorted(fresh, key=lambda k: known[k].through):  # what is blind may be what a hole leads to
            if k not in ends:
                known[k] = sounded(images, scene, shortened(images, hull, known[k], margins[k]))
                if known[k].step and level < _LEVELS - 1:
                    known[k], rest = known[k].parted()
                    below.append(rest)
                if known[k].islands:  # of a pocket that was found around them
                    hull = _whole(hull, uncut, known, k, done)
                else:
                    known[k], hull = _with_islands(images, hull, uncut, known, k, done)
                if known[k].islands:
                    known[k], hull = _sounded_again(images, scene, hull, uncut, known, k, done)
            opened = hull.without(known[k], margins[k])
            if k < len(before) or not (contradicted(known[k]) or disliked(images, hull, opened, known[k])):
                hull = opened
                done.append(k)
            else:
                wrong.add(k)
        for k, prism in evened(images, scene, {k: known[k] for k in fresh if k not in ends | wrong}).items():
            known[k], hull = prism, hull.without(prism, margins[k])
        for bend in found_bends:
            hull = cut(hull, bend)
        bends += found_bends
        fresh = [k for k in fresh if k not in wrong]
        scene = hull.scene([known[k] for k in range(len(known)) if k not in wrong])
        longer = {k: lengthened(images, scene, known[k]) for k in fresh}  # with the pockets of this level cut
        longer = {k: prism for k, prism in longer.items() if prism is not known[k]}
        for k, prism in longer.items():
            known[k], hull = prism, hull.without(prism, margins[k])
        floors = [known[k] for k in fresh if not known[k].ring]
        known = [prism for k, prism in enumerate(known) if k not in wrong]
        scene = hull.scene(known) if longer else scene
        if not (floors or below):
            break
    hull, known = _behind_gaps(images, hull, scene, known)
    hull, known = open_curved(images, hull, known, planes)
    return hull, known, bends


def open_curved(
    images: Images, hull: Volume, known: Sequence[Prism], planes: Sequence[Plane]
) -> tuple[Volume, list[Prism]]:
    """Carve holes and pockets in a hull's curved faces.

    Arguments and results are those of `open_concavities`; `known` are the concavities that are open already.
    """
    scene = hull.scene(known)
    found = find_curved(images, scene, hull.spacing, known, planes)
    hull, opened = _with_agreeable(images, hull, scene, known, found)
    scene = hull.scene(opened)
    wider = counterbored(images, scene, hull.spacing, opened, planes)
    hull, more = _with_agreeable(images, hull, scene, opened, wider)
    return (hull, more) if len(more) == len(known) else _behind_gaps(images, hull, hull.scene(more), more)


def _behind_gaps(images: Images, hull: Volume, scene: Scene, known: Sequence[Prism]) -> tuple[Volume, list[Prism]]:
    """The hull, whose scene is given, with holes carried on behind gaps that they come out in; all that are known."""
    result = list(known)
    for k, prism in enumerate(known):
        further = onward(images, scene, 2 * hull.spacing, prism, result)
        if further is not prism:
            result[k], hull = further, hull.without(further, MARGIN_CELLS * hull.spacing)
            scene = hull.scene(result)
    return hull, result


def open_onward(images: Images, hull: Volume, known: Sequence[Prism]) -> tuple[Volume, list[Prism]]:
    """Lead holes on that end short of others which they meet, of all that are `known`; the hull and all of them."""
    result, margin = list(known), MARGIN_CELLS * hull.spacing

    def taken(k: int, further: Prism) -> Volume:
        deeper = hull.without(further, margin)
        if known[k].endless:
            fits = not (disliked(images, hull, deeper, further) or walled(images, hull, deeper, further))
        else:
            fits = agreeable(images, hull.scene(), deeper.scene(), further, 2 * hull.spacing, floor_told=True)
        if not fits:
            return hull
        result[k] = further
        return deeper

    scene, before = hull.scene(known), hull
    for k, further in crossed(scene, known).items():
        hull = taken(k, further)
    scene = scene if hull is before else hull.scene(result)
    for k in range(len(known)):
        further = met(scene, result[k], [other for other in result if other is not result[k]])
        if further is not result[k]:
            hull = taken(k, further)
            scene = hull.scene(result)
    return hull, result


def _with_agreeable(
    images: Images, hull: Volume, scene: Scene, known: Sequence[Prism], found: Sequence[Prism]
) -> tuple[Volume, list[Prism]]:
    """The hull opened by concavities in its curved faces, as far as views agree better then, and all that are known."""
    margin, result = MARGIN_CELLS * hull.spacing, list(known)
    for prism in found:
        if prism.section is None:
            prism = drawn(images, scene, hull, prism, margin)
        opened = hull.without(prism, margin)
        after = opened.scene()
        if not contradicted(prism) and agreeable(images, scene, after, prism, 2 * hull.spacing):
            hull, scene = opened, after
            result.append(prism)
    return hull, result


def _with_islands(
    images: Images,
    hull: Volume,
    uncut: Volume | None,
    known: Sequence[Prism],
    k: int,
    done: Sequence[int],
    likely: Sequence[Top] | None = None,
) -> tuple[Prism, Volume]:
    """One of the known concavities with what stands in it, and the hull with that, too; others are `done` already."""
    if not has_room(known[k]):
        return known[k], hull
    whole, margin = _whole(hull, uncut, known, k, done), hull.margin(known[k])
    prism = with_islands(images, whole, known[k], margin, likely)
    return prism, whole if prism.islands else hull


def _sounded_again(
    images: Images,
    scene: Scene,
    hull: Volume,
    uncut: Volume | None,
    known: Sequence[Prism],
    k: int,
    done: Sequence[int],
) -> tuple[Prism, Volume]:
    """One of the known concavities, in which something stands, as deep as its walls tell; others are `done` already.

    Where it is much deeper than its floor was thought to be, that was the top of something: islands are sought anew.
    """
    prism = sounded(images, scene, known[k])
    if prism.depth < known[k].depth + _MUCH_DEEPER * prism.lattice.pitch:
        return prism, hull
    bare = replace(prism, islands=())
    found, whole = _with_islands(images, hull, uncut, _replaced(known, {k: bare}), k, done)
    return (sounded(images, scene, found), whole) if found.islands else (prism, hull)


def _whole(hull: Volume, uncut: Volume | None, known: Sequence[Prism], k: int, done: Sequence[int]) -> Volume:
    """The hull with all that was within one of the known concavities, but for others that are `done` already."""
    if uncut is None:
        return hull
    whole = hull.filled(replace(known[k], islands=()), hull.margin(known[k]), uncut)
    for other in done:
        whole = whole.without(known[other], hull.margin(known[other]))
    return whole


def _standing(
    images: Images,
    hull: Volume,
    uncut: Volume | None,
    known: Sequence[Prism],
    k: int,
    prism: Prism,
    likely: Sequence[Top],
) -> Prism:
    """One of the known concavities, deeper than it was, with what stands in it."""
    others = [i for i in range(len(known)) if i != k]
    return _with_islands(images, hull, uncut, _replaced(known, {k: prism}), k, others, likely)[0]


def _replaced(known: Sequence[Prism], others: dict[int, Prism]) -> list[Prism]:
    """Concavities, some of them by others."""
    return [others.get(k, prism) for k, prism in enumerate(known)]


def _parted(found: Sequence[Prism]) -> tuple[list[Prism], list[Prism]]:
    """Concavities down to their shoulders, and what goes on below these."""
    parts = [prism.parted() if prism.step else (prism,) for prism in found]
    return [part[0] for part in parts], [part[1] for part in parts if len(part) > 1]

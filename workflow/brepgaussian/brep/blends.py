"""Fillets as modellers make them: the solid with sharp edges first, then its edges rounded off by the kernel.

A fillet touches the faces beside it. Where many edges are rounded, and three fillets meet around a ball's corner, an
arrangement of sheets that only touch falls apart. Without its fillets the same solid is an easy one.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.fillets import Builder, on_both_sides
from brepgaussian.brep.patches import Patch, neighbours, next_number, supported, thinned_out
from brepgaussian.geometry.rolling import rolling, touching
from brepgaussian.geometry.surfaces import Surface, sphere

Array = NDArray[np.float64]

_SQUARE = np.sin(np.radians(8.0))  # between a plane's normal and the axis of the cylinder that rounds it off
_TURN = np.cos(np.radians(20.0))  # least angle between two planes with an edge
_ALONG = np.cos(np.radians(8.0))  # between the axes of a torus and of the cylinder that it rounds off
_LIKE = 2.0  # times the patch's own radius, up or down, that its fillet may have
_WORSE = 3.0  # times its present residual, or noises, that a patch may have on its fillet
_EQUAL = 1.1  # ratio of radii that follow each other in size and are meant to be one: points know short arcs badly
_EXACT = 1.01  # the same where images have told them; the kernel makes a ball of equal ones only
_BETTER = 2.0  # times the least residual: among fillets of that much the larger faces are meant
_SPARE = 0.9  # of a patch's points that lie on what is beside it
_CHORD = 0.1  # radii from a fillet to points that cut across a part of it: of an eighth of a turn .08
_FACING = np.cos(np.radians(12.0))  # between a fillet's normal and a point's: a flat face has one for all of them
_MOSTLY = 0.5  # of a patch's points that lie on a fillet whose neighbours tell it
_BALL = 2.5  # radii from a corner's ball to each of its fillets' points
_FEW = 8  # points of a patch


@dataclass(frozen=True)
class Blend:
    """A fillet.

    Attributes:
        patch: its index.
        faces: indices of the patches that it touches: two planes, or a cylinder and a plane, or, around a corner, three
            planes.
    """

    patch: int
    faces: tuple[int, ...]


def blended(patches: Sequence[Patch], noise: float) -> tuple[list[Patch], tuple[Blend, ...]]:
    """The patches with a ball in every corner that three fillets meet in, and the fillets among them (none: `()`)."""
    edges = [blend for i in range(len(patches)) for blend in _edge_blends(i, patches, noise)]
    if not edges:
        return list(patches), ()
    result = _resized(patches, edges)
    for blend, surface in list(_left_out(edges, result, noise)):
        result[blend.patch] = replace(result[blend.patch], surface=surface, sigma=surface.rms(result[blend.patch].xyz))
        edges.append(blend)
    blends = list(edges)
    for faces in list(_corners(edges, result)):
        result, ball = _with_ball(result, faces, blends, noise)
        blends += [] if ball is None else [ball]
    result = _resized(result, edges)  # without the points of balls they know it better
    for ball in blends[len(edges) :]:
        around = next(b for b in blends if set(b.faces) < set(ball.faces))
        surface = _of_corner(ball.faces, result, result[around.patch].surface)
        result[ball.patch] = replace(result[ball.patch], surface=surface)
    return exact_blends(result, blends), tuple(blends)


def _resized(patches: Sequence[Patch], edges: Sequence[Blend]) -> list[Patch]:
    """The patches with the fillets of edges that fit their points best, all of about one radius of the same."""
    result = list(patches)
    best = [
        _closest(patches[b.patch], [patches[i].surface for i in b.faces]) or patches[b.patch].surface for b in edges
    ]
    for blend, surface, radius in zip(edges, best, _shared([size(s) for s in best], _EQUAL), strict=True):
        result[blend.patch] = replace(result[blend.patch], surface=_sized(surface, radius))
    return result


def _closest(patch: Patch, faces: Sequence[Surface]) -> Surface | None:
    """The fillet of some faces that fits a patch best, if one lies on the side that its points show."""
    own = size(patch.surface)
    found = on_both_sides(patch, builder(faces), (own / _LIKE, own * _LIKE))
    return min(found, key=lambda s: s.rms(patch.xyz), default=None)


def spare(patches: Sequence[Patch], blends: Sequence[Blend], noise: float) -> list[int]:
    """Indices of patches that are no fillets nor faces of any, and lie on those beside them: labels tore them off."""
    fillets = {b.patch for b in blends}
    taken = fillets | {i for b in blends for i in b.faces}
    result = []
    for i in (i for i in range(len(patches)) if i not in taken):
        patch = patches[i]
        own = _WORSE * max(patch.sigma, noise)
        off = [
            np.abs(surface.signed_distance(patch.xyz)) / max(own, _CHORD * size(surface) if k in fillets else 0.0)
            for k in neighbours(i, patches)
            if k in taken
            for surface in [patches[k].surface]
        ]
        if off and np.mean(np.min(off, axis=0) <= 1) >= _SPARE:
            result.append(i)
    return result


def exact_blends(patches: Sequence[Patch], blends: Sequence[Blend]) -> list[Patch]:
    """The patches with every fillet touching its faces exactly, those of nearly one radius of the same."""
    result = list(patches)
    if not blends:
        return result
    radii = _shared([size(patches[b.patch].surface) for b in blends], _EXACT)
    for blend, radius in sorted(zip(blends, radii, strict=True), key=lambda pair: -_is_face(pair[0], blends)):
        old = result[blend.patch].surface
        build = builder([result[i].surface for i in blend.faces])
        result[blend.patch] = replace(result[blend.patch], surface=build(-radius if old.flipped else radius))
    return result


def levels(blends: Sequence[Blend]) -> list[list[Blend]]:
    """Fillets of edges in the order of rounding: those along whose own edges others run go first."""
    edges = [b for b in blends if len(b.faces) == 2]
    first = [b for b in edges if _is_face(b, blends)]
    return [level for level in (first, [b for b in edges if b not in first]) if level]


def _is_face(blend: Blend, blends: Iterable[Blend]) -> bool:
    return any(blend.patch in other.faces for other in blends)


def _left_out(edges: Sequence[Blend], patches: Sequence[Patch], noise: float) -> Iterator[tuple[Blend, Surface]]:
    """Patches on the fillet that an edge has if it is rounded as others of its two faces are, taken for something else.

    A short fillet turns into its corners on both ends, and a cone or a sphere fits all of that better; the middle of
    one whose sides went to the faces beside it is a plane.
    """
    by_faces = {tuple(sorted(b.faces)): patches[b.patch].surface for b in edges}
    taken = {b.patch for b in edges} | {i for b in edges for i in b.faces}
    beside = cache(lambda i: set(neighbours(i, patches)))
    planes = sorted({i for pair in by_faces for i in pair if patches[i].surface.kind == "plane"})
    for edge in (pair for pair in combinations(planes, 2) if pair not in by_faces):
        first, second = (patches[i].surface for i in edge)
        if abs(float(first.axis @ second.axis)) >= _TURN:
            continue
        one, other = ({size(s) * s.sign for pair, s in by_faces.items() if i in pair} for i in edge)
        for radius in sorted(one & other):
            surface = rolling(first, second, radius)
            on = {
                i: int(_on_fillet(surface, patches[i], noise).sum())
                for i in range(len(patches))
                if i not in taken and set(edge) & beside(i)
            }
            best = max(on, key=lambda i: on[i], default=None)
            if best is not None and on[best] > _MOSTLY * len(patches[best].xyz):
                taken.add(best)
                by_faces[edge] = surface
                yield Blend(best, edge), surface
                break


def _on_fillet(surface: Surface, patch: Patch, noise: float) -> NDArray[np.bool_]:
    """Which points of a patch lie on a fillet and face as it does."""
    near = np.abs(surface.signed_distance(patch.xyz)) <= stray(size(surface), noise)
    return np.asarray(near & (np.einsum("ij,ij->i", surface.normals(patch.xyz), patch.normals) > _FACING))


def stray(radius: float, noise: float) -> float:
    """By how much points of a fillet may lie off it."""
    return max(_WORSE * noise, _CHORD * radius)


def builder(faces: Sequence[Surface]) -> Builder:
    """The fillet of some faces by its signed radius, positive on convex edges."""
    if len(faces) == 3:
        return partial(_ball, faces)
    first, second = faces
    return partial(touching if first.kind == "cylinder" else rolling, first, second)


def _ball(faces: Sequence[Surface], radius: float) -> Surface:
    """The sphere that touches three planes."""
    heights = np.array([float(f.origin @ f.axis) - radius for f in faces])
    return sphere(np.linalg.solve(np.array([f.axis for f in faces]), heights), abs(radius), radius < 0)


def size(surface: Surface) -> float:
    """Radius of a fillet."""
    return surface.minor if surface.kind == "torus" else surface.radius


def _sized(surface: Surface, radius: float) -> Surface:
    return replace(surface, minor=radius) if surface.kind == "torus" else replace(surface, radius=radius)


def _shared(values: Sequence[float], ratio: float) -> list[float]:
    """Values of which those that follow each other within a ratio are one, their median."""
    order = np.argsort(values, kind="stable")
    ordered = np.array(values, float)[order]
    result = np.array(values, float)
    for group in np.split(order, np.flatnonzero(ordered[1:] > ratio * ordered[:-1]) + 1):
        result[group] = np.median(result[group])
    return [float(v) for v in result]


def _edge_blends(index: int, patches: Sequence[Patch], noise: float) -> Iterator[Blend]:
    """The fillet that a patch is, of an edge between two of its neighbours, if it is one."""
    patch = patches[index]
    if patch.surface.kind not in ("cylinder", "torus"):
        return
    found = []
    for faces in _edges_beside(index, patches):
        surface = _closest(patch, [patches[i].surface for i in faces])
        rms = np.inf if surface is None else surface.rms(patch.xyz)
        if surface is not None and rms <= _WORSE * max(patch.sigma, noise):
            found.append((rms, Blend(index, faces)))
    if found:
        least = _BETTER * min(rms for rms, _ in found)
        yield max((b for rms, b in found if rms <= least), key=lambda b: min(len(patches[i].xyz) for i in b.faces))


def _edges_beside(index: int, patches: Sequence[Patch]) -> Iterator[tuple[int, int]]:
    """Pairs of neighbours whose edge a cylinder or a torus may round off."""
    surface = patches[index].surface
    beside = neighbours(index, patches)
    planes = [i for i in beside if patches[i].surface.kind == "plane"]
    if surface.kind == "torus":
        walls = [i for i in beside if patches[i].surface.kind == "cylinder"]
        for wall in (i for i in walls if abs(float(patches[i].surface.axis @ surface.axis)) > _ALONG):
            for floor in planes:
                if abs(float(patches[floor].surface.axis @ patches[wall].surface.axis)) > _ALONG:
                    yield wall, floor
        return
    along = [i for i in planes if abs(float(patches[i].surface.axis @ surface.axis)) < _SQUARE]
    for first, second in combinations(along, 2):
        if abs(float(patches[first].surface.axis @ patches[second].surface.axis)) < _TURN:
            yield first, second


def _corners(blends: Sequence[Blend], patches: Sequence[Patch]) -> Iterator[tuple[int, int, int]]:
    """Triples of planes whose three edges are rounded alike, where the three fillets come together."""
    by_faces = {tuple(sorted(b.faces)): b for b in blends}
    planes = sorted({i for pair in by_faces for i in pair if patches[i].surface.kind == "plane"})
    for faces in combinations(planes, 3):
        around = [by_faces[pair] for pair in combinations(faces, 2) if pair in by_faces]
        if len(around) < 3:
            continue
        surfaces = [patches[b.patch].surface for b in around]
        if len({s.flipped for s in surfaces}) > 1 or len({s.radius for s in surfaces}) > 1:
            continue
        if abs(float(np.linalg.det([patches[i].surface.axis for i in faces]))) < 1 - _TURN:
            continue
        ball = _of_corner(faces, patches, surfaces[0])
        if all(np.linalg.norm(patches[b.patch].xyz - ball.origin, axis=1).min() < _BALL * ball.radius for b in around):
            yield faces


def _of_corner(faces: Sequence[int], patches: Sequence[Patch], fillet: Surface) -> Surface:
    return _ball([patches[i].surface for i in faces], -fillet.radius if fillet.flipped else fillet.radius)


def _with_ball(
    patches: list[Patch], faces: tuple[int, int, int], blends: Sequence[Blend], noise: float
) -> tuple[list[Patch], Blend | None]:
    """The patches with a corner's ball: one that is there, or one with the points of its fillets beyond their edges."""
    around = [b.patch for b in blends if len(b.faces) == 2 and set(b.faces) < set(faces)]
    ball = _of_corner(faces, patches, patches[around[0]].surface)
    normals = np.array([patches[i].surface.axis for i in faces])

    def beyond(points: Array) -> NDArray[np.bool_]:
        """Which points lie on the ball's piece: on the far side of its centre along all three normals."""
        outward = (points - ball.origin) @ np.linalg.inv(normals)  # shares of the normals
        return np.asarray(((-outward if ball.flipped else outward) > 0).all(axis=1))

    taken = {b.patch for b in blends} | {i for b in blends for i in b.faces}
    for i, patch in enumerate(patches):
        near = ball.rms(patch.xyz) <= _WORSE * max(patch.sigma, noise)
        if i not in taken and near and beyond(patch.xyz).mean() > 0.5:
            patches[i] = replace(patch, surface=ball, sigma=ball.rms(patch.xyz))
            return patches, Blend(i, faces)
    xyz, turned = [], []
    for i in around:
        patch, here = patches[i], beyond(patches[i].xyz)
        if here.any() and (~here).sum() >= _FEW:
            xyz.append(patch.xyz[here])
            turned.append(patch.normals[here])
            patches[i] = thinned_out(patch, here)
    if sum(map(len, xyz)) < _FEW:
        return patches, None
    first = patches[around[0]]
    new = supported(replace(first, primitive=next_number(patches)), ball, np.concatenate(xyz), np.concatenate(turned))
    return [*patches, new], Blend(len(patches), faces)

"""Fillets whose label was cut in two: each half is a plane or a cylinder of its own, neither of which touches a face.

No image shows where a fillet begins, and labels may end in its middle. A cylinder that touches both faces has one free
parameter, its radius, and explains the points of both halves in fewer words.
"""

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from brepgaussian.geometry.fit_choose import EFFECTIVE
from brepgaussian.geometry.rolling import rolling
from brepgaussian.geometry.surfaces import Surface, unit
from brepgaussian.log import get_logger
from brepgaussian.primitives.fitting import description, errors
from brepgaussian.primitives.patches import Cloud, Indices, Noise, Patch, adjacent, spreads, thinned
from brepgaussian.settings.primitives import PrimitivesSettings

Array = NDArray[np.float64]

_HALVES = ("plane", "cylinder")
_ALONG = np.sin(np.radians(12.0))  # between what turns about an edge and a plane across it
_LEAST_TURN = np.radians(8.0)  # from one face to a half, and from half to half
_LEAST, _MOST = np.radians(30.0), np.radians(150.0)  # between the faces
_ROUNDS = 3  # of giving points to the nearest surface and fitting again
_WORTH = 1.0  # parameters by which the description must get shorter
_RADII = 24  # tried first
_LEAST_SHARE = 0.5  # of the points of both halves stay on the fillet

log = get_logger("primitives")


def join_halves(patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> list[Patch]:
    """Join two patches into one fillet between two planes where that is a shorter description."""
    patches = list(patches)
    while True:
        found = max(_fillets(patches, cloud, noise, settings), key=lambda f: f[0], default=None)
        if found is None:
            return patches
        _, (first, second), faces, parts = found
        log.info("labels %s: two halves of a fillet", list(parts[2].labels))
        patches[faces[0]], patches[faces[1]], patches[first] = parts
        del patches[second]


def _fillets(
    patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> Iterator[tuple[float, tuple[int, int], tuple[int, int], list[Patch]]]:
    """How much shorter each is, the halves (ascending), the faces, and what faces and fillet become."""
    touch = adjacent(patches, cloud)
    middle = np.array([_mean_normal(p, cloud) for p in patches])
    planes = [k for k, p in enumerate(patches) if p.surface.kind == "plane"]
    for pair in combinations(range(len(patches)), 2):
        if not touch[pair] or any(patches[k].surface.kind not in _HALVES for k in pair):
            continue
        beside = ([k for k in planes if touch[half, k] and k not in pair] for half in pair)
        for faces in product(*beside):
            first, second = (patches[k].surface.axis for k in faces)
            if faces[0] != faces[1] and _in_order([first, *middle[list(pair)], second]):
                found = _joined([patches[k] for k in (*faces, *pair)], cloud, noise, settings)
                if found is not None:
                    yield found[0], pair, (faces[0], faces[1]), found[1]


def _in_order(normals: list[Array]) -> bool:
    """Whether normals turn from the first to the last about one axis, each by some degrees."""
    turn = float(np.arccos(np.clip(normals[0] @ normals[-1], -1, 1)))
    if not _LEAST < turn < _MOST:
        return False
    axis = unit(np.cross(normals[0], normals[-1]))
    if max(abs(float(n @ axis)) for n in normals[1:-1]) > _ALONG:
        return False
    side = np.cross(axis, normals[0])
    angles = [float(np.arctan2(n @ side, n @ normals[0])) for n in normals]
    return bool(np.min(np.diff(angles)) > _LEAST_TURN)


def _joined(
    parts: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> tuple[float, list[Patch]] | None:
    """How much shorter two faces and a fillet are than two faces and two halves, and these three."""
    faces, halves = parts[:2], parts[2:]
    members = np.union1d(halves[0].members, halves[1].members)
    labels = tuple(sorted({*halves[0].labels, *halves[1].labels}))
    fillet, mine, owner = halves[0], members, np.zeros(0, np.int64)
    for _ in range(_ROUNDS):
        surface = _touching(faces, mine, cloud, settings)
        if surface is None:
            return None
        fillet = Patch(labels, mine, surface, *spreads(surface, cloud, mine))
        owner = errors([*faces, fillet], members, cloud, noise)[2]
        mine = members[owner == 2]
        if len(mine) < _LEAST_SHARE * len(members):
            return None
    gain = description(parts, members, cloud, noise) - description([*faces, fillet], members, cloud, noise)
    if gain < _WORTH * np.log(EFFECTIVE):
        return None
    fillet = Patch(labels, mine, fillet.surface, *spreads(fillet.surface, cloud, mine))
    return gain, [*(_with(face, members[owner == k], cloud) for k, face in enumerate(faces)), fillet]


def _with(face: Patch, more: Indices, cloud: Cloud) -> Patch:
    """A face with more points, on its own surface."""
    members = np.union1d(face.members, more)
    return Patch(face.labels, members, face.surface, *spreads(face.surface, cloud, members))


def _touching(faces: list[Patch], members: Indices, cloud: Cloud, settings: PrimitivesSettings) -> Surface | None:
    """The cylinder that touches both faces and lies nearest to points, with their side out."""
    some = thinned(members, settings.sample)
    xyz, normals = cloud.xyz[some], cloud.normals[some]
    found: list[tuple[float, Surface]] = []
    for side in (1.0, -1.0):

        def off(scale: float, side: float = side) -> float:
            surface = rolling(faces[0].surface, faces[1].surface, side * float(np.exp(scale)))
            return float(np.median(np.abs(surface.signed_distance(xyz))))

        scales = np.linspace(np.log(cloud.spacing), np.log(settings.largest_radius), _RADII)
        start = int(np.argmin([off(s) for s in scales]))
        near = float(scales[max(start - 1, 0)]), float(scales[min(start + 1, _RADII - 1)])
        scale = float(minimize_scalar(off, bounds=near, method="bounded").x)
        surface = rolling(faces[0].surface, faces[1].surface, side * float(np.exp(scale)))
        if float(np.median(np.einsum("ij,ij->i", surface.normals(xyz), normals))) > 0:
            found.append((off(scale), surface))
    return min(found, key=lambda f: f[0])[1] if found else None


def _mean_normal(patch: Patch, cloud: Cloud) -> Array:
    mean = cloud.normals[patch.members].mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))

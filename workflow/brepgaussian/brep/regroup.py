"""Borders between a fillet and the face that it touches, drawn anew: no image shows them.

Labels may end in the middle of a fillet; the rest of it and the face beside it then share a label that a cone or a
torus explains. Points that are rounded off at the face's other end do not tell (`primitives.sharing` asks them); here
a plane or a cylinder and a larger fillet in their place are a hypothesis for the images.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.fillets import rounded
from brepgaussian.brep.patches import Patch, neighbours, supported, touch
from brepgaussian.brep.simplify import Change, fitted
from brepgaussian.geometry.fit_choose import plausible
from brepgaussian.geometry.surfaces import Surface, plane, unit

Array = NDArray[np.float64]

_SHARED = ("cone", "torus")  # kinds that explain a face and a piece of the fillet beside it
_WIDER = 2.0  # times a fillet's radius has a cylinder through a piece of it and the plane beside it
_FILLETS = ("torus", "cylinder")
_SIMPLE = ("plane", "cylinder")  # kinds of the face
_FAR = 0.5  # share of a label's points, farthest from the fillet, that start the face
_ROUNDS = 4  # of giving the points to the nearer surface and fitting again
_LEAST = 0.15  # of both patches' points that either keeps
_WORSE = 1.5  # times the present residual of both together that they may have
_NEARLY = np.cos(np.radians(8.0))  # between a plane's normal as fitted and as a fillet needs it
_LARGEST = 1.5  # radius, longest sides of the object


def regrouped(patches: Sequence[Patch], noise: float, rng: np.random.Generator) -> Iterator[Change]:
    """A simpler face and a larger fillet for every pair of a curved patch and a fillet beside it, best kind first."""
    for i, patch in enumerate(patches):
        beside = [j for j, p in enumerate(patches) if j != i and _rolls(p) and _may_share(patch.surface, p.surface)]
        tree = cKDTree(patch.xyz) if beside else None
        for j in beside:
            fillet = patches[j]
            if not touch(fillet, patch, tree=tree):
                continue
            found = [f for kind in _SIMPLE if (f := _apart(kind, patch, fillet, noise, rng)) is not None]
            if found:
                face, larger = min(found, key=lambda pair: _misfit(*pair))
                rest = [k for k in range(len(patches)) if k not in (i, j)]
                others = [patches[k] for k in rest]
                name = f"patch {patch.primitive} as a {face.surface.kind} beside patch {fillet.primitive}"
                pair = _touching(face, larger, others, noise)
                moved = _moved(pair, others, noise)
                yield Change(name, (i, j, *(rest[m] for m in moved)), (*pair, *moved.values()))


def _may_share(face: Surface, fillet: Surface) -> bool:
    """Whether a curved surface may be that of a face and a piece of a fillet: a cylinder of a wider one along it."""
    if face.kind != "cylinder":
        return face.kind in _SHARED
    along = fillet.kind == "cylinder" and abs(float(face.axis @ fillet.axis)) > _NEARLY
    return along and face.sign == fillet.sign and face.radius > _WIDER * fillet.radius


def _apart(
    kind: str, patch: Patch, fillet: Patch, noise: float, rng: np.random.Generator
) -> tuple[Patch, Patch] | None:
    """A face of a kind and a fillet for the points of both; None if these explain them worse."""
    far = cKDTree(fillet.xyz).query(patch.xyz)[0]
    start = far >= np.quantile(far, 1 - _FAR)
    face = _square(_fitted(kind, patch.xyz[start], patch.normals[start], noise, rng, None), fillet.surface)
    larger: Surface | None = fillet.surface
    xyz, normals = np.concatenate([patch.xyz, fillet.xyz]), np.concatenate([patch.normals, fillet.normals])
    mine = np.zeros(len(xyz), bool)
    for _ in range(_ROUNDS):
        if face is None or larger is None:
            return None
        mine = np.abs(face.signed_distance(xyz)) < np.abs(larger.signed_distance(xyz))
        if not _LEAST < mine.mean() < 1 - _LEAST:
            return None
        face = _square(_fitted(kind, xyz[mine], normals[mine], noise, rng, face), fillet.surface)
        larger = _fitted(fillet.surface.kind, xyz[~mine], normals[~mine], noise, rng, larger)
    if face is None or larger is None:
        return None
    result = supported(patch, face, xyz[mine], normals[mine]), supported(fillet, larger, xyz[~mine], normals[~mine])
    return result if _misfit(*result) <= _WORSE * max(_misfit(patch, fillet), noise) else None


def _touching(face: Patch, fillet: Patch, others: Sequence[Patch], noise: float) -> tuple[Patch, Patch]:
    """The fillet made to touch the face and what lies on its other side, which knows the axis."""
    for _ in range(2):  # the face turns with the fillet
        fillet = (rounded([face, fillet, *others], noise) or [face, fillet])[1]
        turned = _square(face.surface, fillet.surface)
        face = face if turned is None else supported(face, turned, face.xyz, face.normals)
    return face, fillet


def _moved(pair: tuple[Patch, Patch], others: Sequence[Patch], noise: float) -> dict[int, Patch]:
    """The other fillets that end at a face, by their indices, made to touch it where it lies now."""
    every = [*pair, *others]
    beside = set(neighbours(0, every))
    again = enumerate(rounded(every, noise) or every)
    return {k - len(pair): p for k, p in again if k >= len(pair) and k in beside and p is not every[k] and _rolls(p)}


def _rolls(patch: Patch) -> bool:
    return patch.surface.kind in _FILLETS


def _square(face: Surface | None, fillet: Surface) -> Surface | None:
    """The face turned such that a fillet may touch it: a plane across a torus' axis or along a cylinder's."""
    if face is None or face.kind != "plane":
        return face
    along = float(face.axis @ fillet.axis)
    normal = np.sign(along) * fillet.axis if fillet.kind == "torus" else unit(face.axis - along * fillet.axis)
    return plane(face.origin, normal) if float(normal @ face.axis) > _NEARLY else None


def _fitted(
    kind: str, xyz: Array, normals: Array, noise: float, rng: np.random.Generator, start: Surface | None
) -> Surface | None:
    surface = fitted(kind, xyz, normals, noise, rng, start)
    return surface if surface is not None and plausible(surface, xyz, _LARGEST) else None


def _misfit(first: Patch, second: Patch) -> float:
    """Root mean square distance of both patches' points together."""
    counts = len(first.xyz), len(second.xyz)
    return float(np.sqrt((counts[0] * first.sigma**2 + counts[1] * second.sigma**2) / sum(counts)))

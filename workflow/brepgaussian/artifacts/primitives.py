"""`primitives.h5`: fitted surfaces with their support in `points.ply`."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance, create_h5, open_h5, put, strings
from brepgaussian.geometry.surfaces import ROW_LENGTH, Surface, surface_from_row, surface_to_row

KIND = "primitives"


@dataclass(frozen=True)
class Primitive:
    """One fitted surface.

    Attributes:
        surface: plane, cylinder, sphere, cone or torus, oriented so that its normal at the support
            points out of the solid (`surface.flipped` tells a hole from a shaft).
        label: label of the patch that it explains (several labels may have been merged: the smallest).
        support: (S,) int64 indices of its inliers in `points.ply`.
        rms: root mean square distance of the support, unit frame.
    """

    surface: Surface
    label: int
    support: NDArray[np.int64]
    rms: float


@dataclass(frozen=True)
class Relation:
    """A regularity that was found and kept, e.g. `parallel` between primitives 0 and 3."""

    kind: str
    first: int
    second: int
    residual: float


@dataclass(frozen=True)
class Primitives:
    """All primitives of an object, with the relations that hold between them and the noise of the points."""

    items: tuple[Primitive, ...]
    relations: tuple[Relation, ...] = ()
    sigma: float = 0.0

    def write(self, path: str | Path, provenance: Provenance) -> None:
        """Write `primitives.h5`."""
        supports = [p.support for p in self.items]
        starts = np.cumsum([0, *map(len, supports)])
        with create_h5(path, KIND, provenance) as file:
            file.attrs["sigma"] = self.sigma
            put(file, "type", [p.surface.kind for p in self.items], axes="primitive")
            rows = np.array([surface_to_row(p.surface) for p in self.items]).reshape(len(self.items), ROW_LENGTH)
            put(
                file,
                "parameters",
                rows,
                axes="primitive,(origin xyz, axis xyz, radius, minor radius, half angle, flipped)",
                unit="unit frame, rad",
            )
            put(file, "label", np.array([p.label for p in self.items], np.int32), axes="primitive")
            put(file, "rms", np.array([p.rms for p in self.items]), axes="primitive", unit="unit frame")
            put(file, "support_start", starts, axes="primitive + 1")
            put(
                file,
                "support",
                np.concatenate([*supports, np.zeros(0, np.int64)]).astype(np.int64),
                axes="point",
                unit="index into points.ply",
            )
            put(file, "relation_kind", [r.kind for r in self.relations], axes="relation")
            pairs = np.array([(r.first, r.second) for r in self.relations], np.int32).reshape(-1, 2)
            put(file, "relation_pair", pairs, axes="relation,2")
            put(file, "relation_residual", np.array([r.residual for r in self.relations]), axes="relation")


def read_primitives(path: str | Path) -> Primitives:
    """Read `primitives.h5`."""
    with open_h5(path, KIND) as file:
        starts, support = file["support_start"][...], file["support"][...]
        items = tuple(
            Primitive(
                surface=surface_from_row(kind, row),
                label=int(label),
                support=support[starts[i] : starts[i + 1]],
                rms=float(rms),
            )
            for i, (kind, row, label, rms) in enumerate(
                zip(
                    strings(file["type"]),
                    file["parameters"][...],
                    file["label"][...],
                    file["rms"][...],
                    strict=True,
                )
            )
        )
        relations = tuple(
            Relation(kind, int(pair[0]), int(pair[1]), float(residual))
            for kind, pair, residual in zip(
                strings(file["relation_kind"]),
                file["relation_pair"][...],
                file["relation_residual"][...],
                strict=True,
            )
        )
        return Primitives(items, relations, float(file.attrs["sigma"]))

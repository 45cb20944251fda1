"""Everything that a page or a contact sheet of one object shows, read once."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.brep import Brep, read_brep
from brepgaussian.artifacts.masks import Masks, read_masks
from brepgaussian.artifacts.points import Points, read_points
from brepgaussian.artifacts.primitives import Primitives, read_primitives
from brepgaussian.artifacts.stage1 import Evidence, Surfels, read_evidence, read_surfels
from brepgaussian.artifacts.stage2 import Stage2, read_stage2
from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.geometry.topology import sharp_curves
from brepgaussian.metrics import mesh
from brepgaussian.metrics.distances import SampledSurface
from brepgaussian.metrics.solid import read_step
from brepgaussian.metrics.table import read_rows
from brepgaussian.metrics.triangulation import triangulate
from brepgaussian.report.picture import best_view
from brepgaussian.settings.report import ReportSettings

_ERROR_EDGE = 0.05  # longest edge of triangles that carry errors at their corners, unit frame
Array = NDArray[np.float64]


@dataclass(frozen=True)
class ObjectFiles:
    """Where the artifacts of one object lie.

    Attributes:
        views: `views.h5`; masks: `masks.h5`; surfels: `stage1.ply`; evidence: `stage1.h5`; stage2: `stage2.h5`;
            points: `points.ply`; primitives: `primitives.h5`; step: `brep.step`; brep: `brep.h5`.
        row: the object's one-row `metrics.csv`.
        truth: `truth.h5`, or None.
    """

    views: str | Path
    masks: str | Path
    surfels: str | Path
    evidence: str | Path
    stage2: str | Path
    points: str | Path
    primitives: str | Path
    step: str | Path
    brep: str | Path
    row: str | Path
    truth: str | Path | None = None


@dataclass(frozen=True, eq=False)
class Solid:
    """The solid as triangles.

    Attributes:
        vertices: (K, 3); triangles: (T, 3); face: (T,) face of each.
        curves: one (n, 3) polyline per sharp curve.
    """

    vertices: Array
    triangles: NDArray[np.int32]
    face: NDArray[np.int32]
    curves: tuple[Array, ...]

    @cached_property
    def surface(self) -> SampledSurface:
        """For distances and rays; without samples."""
        return SampledSurface(self.vertices, self.triangles, np.zeros((0, 3)), np.zeros((0, 3)))

    @cached_property
    def fine(self) -> tuple[Array, NDArray[np.int32]]:
        """The same surface in small triangles, whose corners can carry errors."""
        return mesh.split_long(self.vertices, self.triangles, _ERROR_EDGE)


@dataclass(frozen=True, eq=False)
class Content:
    """All artifacts of one object."""

    object_name: str
    views: Views
    masks: Masks
    surfels: Surfels
    evidence: Evidence
    stage2: Stage2
    points: Points
    primitives: Primitives
    brep: Brep
    solid: Solid
    truth: Truth | None
    row: dict[str, Any]
    step_path: Path

    @property
    def repaired(self) -> NDArray[np.int16] | None:
        """(V, H, W) patch ids that mean the same face in every view; None where stage 2 repaired no masks."""
        return self.stage2.patches if self.stage2.consistent else None

    @cached_property
    def view(self) -> int:
        """The input view that shows most of the solid."""
        return best_view(self.views, self.solid.surface, self.solid.face)

    @cached_property
    def errors(self) -> Array | None:
        """Distance of each corner of `solid.fine` to the truth's surface; None without a truth."""
        if self.truth is None:
            return None
        truth = SampledSurface(
            self.truth.mesh_vertices, self.truth.mesh_triangles, self.truth.points, self.truth.normals
        )
        return truth.closest(self.solid.fine[0])[0]

    @cached_property
    def missed(self) -> Array | None:
        """Distance of each of the truth's points to the solid; None without a truth."""
        return None if self.truth is None else self.solid.surface.closest(self.truth.points)[0]


def load(object_name: str, files: ObjectFiles, settings: ReportSettings) -> Content:
    """Read all artifacts of an object."""
    views = read_views(files.views)
    return Content(
        object_name=object_name,
        views=views,
        masks=read_masks(files.masks),
        surfels=read_surfels(files.surfels),
        evidence=read_evidence(files.evidence),
        stage2=read_stage2(files.stage2),
        points=read_points(files.points),
        primitives=read_primitives(files.primitives),
        brep=read_brep(files.brep),
        solid=read_solid(files.step, views, settings.deflection),
        truth=read_truth(files.truth) if files.truth else None,
        row=read_rows(files.row)[0],
        step_path=Path(files.step),
    )


def read_solid(step_path: str | Path, views: Views, deflection: float) -> Solid:
    """Triangulate the published STEP in the unit frame."""
    shape = read_step(step_path, views.world_from_unit, views.unit)
    triangles, curves = triangulate(shape, deflection), sharp_curves(shape)
    lines = tuple(curves.points[curves.curve_id == i] for i in range(len(curves.types)))
    return Solid(triangles.vertices, triangles.triangles, triangles.face, lines)

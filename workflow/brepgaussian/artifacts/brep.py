"""`brep.h5`: curves, corners, refined surfaces and the gate report that go with `brep.step`."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance, create_h5, open_h5, put, strings
from brepgaussian.geometry.surfaces import ROW_LENGTH, Surface, surface_from_row, surface_to_row

KIND = "brep"
LEAST_SUPPORT = 4  # edge points that give a curve its range
LEAST_COVERAGE = 0.5  # of the edge's length with edge points beside it: else the solid's own range stands


@dataclass(frozen=True)
class Curve:
    """One trimmed curve.

    Attributes:
        kind: line, circle, ellipse or other.
        faces: indices of its two surfaces in `Brep.surfaces`.
        t_range: parameter range; arc length for a line, radians for a circle or an ellipse (more than 2 pi where
            it crosses t = 0), share of the solid's edge for other. From edge points, up to the corners that they
            meet in, where `from_edge_points`; else that of the solid's edge.
        points: (M, 3) float64 samples along the solid's edge, unit frame, first to last.
        t_solid: range of the solid's edge.
        t_edge: what the projected edge points span; NaN without points.
        support: number of edge points that span it.
        coverage: share of the solid's edge that has edge points beside it.
        frame: (3, 3) rows origin, x, y; radii: (2,): p(t) = origin + t x for a line and
            origin + radii[0] cos t x + radii[1] sin t y for a circle or an ellipse; radii zero for other.
    """

    kind: str
    faces: tuple[int, int]
    t_range: tuple[float, float]
    points: NDArray[np.float64]
    t_solid: tuple[float, float] = (np.nan, np.nan)
    t_edge: tuple[float, float] = (np.nan, np.nan)
    support: int = 0
    coverage: float = 0.0
    frame: NDArray[np.float64] = field(default_factory=lambda: np.zeros((3, 3)))
    radii: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))

    @property
    def from_edge_points(self) -> bool:
        """Whether `t_range` comes from edge points."""
        return self.support >= LEAST_SUPPORT and self.coverage >= LEAST_COVERAGE


@dataclass(frozen=True)
class Corner:
    """A cluster of corner candidates: intersections of three surfaces or two curves where edge points end.

    Attributes:
        point: (3,) its place, unit frame.
        size: number of candidates.
        vertex: index of the solid's vertex (`Brep.corners`) that it confirms, -1 for none.
    """

    point: NDArray[np.float64]
    size: int
    vertex: int


@dataclass(frozen=True)
class Brep:
    """What the brep stage knows beside the STEP.

    Attributes:
        surfaces: refined surfaces in the unit frame.
        curves: trimmed curves.
        corners: (C, 3) float64 vertices, unit frame.
        report: the gate report as JSON-able data; its keys `rung` (name of the ladder's rung that was
            published), `fallback` (bool), `silhouette_px`, `mask_iou` (float or None), `accepted` (bool or
            None) are read by the metrics.
        clusters: corners that the edge points alone give.
    """

    surfaces: tuple[Surface, ...]
    curves: tuple[Curve, ...]
    corners: NDArray[np.float64]
    report: dict[str, Any] = field(default_factory=dict)
    clusters: tuple[Corner, ...] = ()

    def write(self, path: str | Path, provenance: Provenance) -> None:
        """Write `brep.h5`."""
        with create_h5(path, KIND, provenance) as file:
            file.attrs["report"] = json.dumps(self.report, sort_keys=True)
            put(file, "surface_type", [s.kind for s in self.surfaces], axes="surface")
            rows = np.array([surface_to_row(s) for s in self.surfaces]).reshape(len(self.surfaces), ROW_LENGTH)
            put(file, "surface_parameters", rows, axes="surface,parameter", unit="unit frame, rad")
            put(file, "corners", self.corners, axes="corner,xyz", unit="unit frame")
            put(file, "curve_type", [c.kind for c in self.curves], axes="curve")
            faces = np.array([c.faces for c in self.curves], np.int32).reshape(-1, 2)
            put(file, "curve_faces", faces, axes="curve,2", unit="index of surface")
            ranges = np.array([c.t_range for c in self.curves]).reshape(-1, 2)
            put(file, "curve_t_range", ranges, axes="curve,2", unit="unit frame or rad")
            solid, edge = (np.array([getattr(c, k) for c in self.curves]).reshape(-1, 2) for k in ("t_solid", "t_edge"))
            put(file, "curve_t_solid", solid, axes="curve,2", unit="unit frame or rad")
            put(file, "curve_t_edge", edge, axes="curve,2", unit="unit frame or rad, nan without edge points")
            put(
                file,
                "curve_support",
                np.array([c.support for c in self.curves], np.int32),
                axes="curve",
                unit="edge points",
            )
            put(file, "curve_coverage", np.array([c.coverage for c in self.curves], float), axes="curve")
            frames = np.array([c.frame for c in self.curves]).reshape(-1, 3, 3)
            put(file, "curve_frame", frames, axes="curve,origin x y,xyz", unit="unit frame")
            radii = np.array([c.radii for c in self.curves]).reshape(-1, 2)
            put(file, "curve_radii", radii, axes="curve,2", unit="unit frame")
            places = np.array([c.point for c in self.clusters]).reshape(-1, 3)
            put(file, "corner_cluster", places, axes="cluster,xyz", unit="unit frame")
            sizes = np.array([(c.size, c.vertex) for c in self.clusters], np.int32).reshape(-1, 2)
            put(file, "corner_cluster_size", sizes[:, 0], axes="cluster", unit="candidates")
            put(file, "corner_cluster_vertex", sizes[:, 1], axes="cluster", unit="index of corner")
            points = np.concatenate([*(c.points for c in self.curves), np.zeros((0, 3))])
            put(file, "curve_points", points, axes="sample,xyz", unit="unit frame")
            starts = np.cumsum([0, *(len(c.points) for c in self.curves)])
            put(file, "curve_start", starts, axes="curve + 1", unit="index into curve_points")


def read_brep(path: str | Path) -> Brep:
    """Read `brep.h5`."""
    with open_h5(path, KIND) as file:
        kinds, parameters = strings(file["surface_type"]), file["surface_parameters"][...]
        starts, points = file["curve_start"][...], file["curve_points"][...]
        pairs, ranges = file["curve_faces"][...], file["curve_t_range"][...]
        curves = tuple(
            Curve(
                kind=kind,
                faces=(int(pairs[i][0]), int(pairs[i][1])),
                t_range=(float(ranges[i][0]), float(ranges[i][1])),
                points=points[starts[i] : starts[i + 1]],
                **_details(file, i),
            )
            for i, kind in enumerate(strings(file["curve_type"]))
        )
        return Brep(
            surfaces=tuple(surface_from_row(k, row) for k, row in zip(kinds, parameters, strict=True)),
            curves=curves,
            corners=file["corners"][...],
            report=json.loads(str(file.attrs["report"])),
            clusters=_clusters(file),
        )


def _details(file: h5py.File, index: int) -> dict[str, Any]:
    """What edge points say about one curve; nothing in files from before that was written."""
    if "curve_t_edge" not in file:
        return {}
    solid, edge = file["curve_t_solid"][index], file["curve_t_edge"][index]
    return {
        "t_solid": (float(solid[0]), float(solid[1])),
        "t_edge": (float(edge[0]), float(edge[1])),
        "support": int(file["curve_support"][index]),
        "coverage": float(file["curve_coverage"][index]),
        "frame": file["curve_frame"][index],
        "radii": file["curve_radii"][index],
    }


def _clusters(file: h5py.File) -> tuple[Corner, ...]:
    """Corners from edge points; none in files from before they were written."""
    if "corner_cluster" not in file:
        return ()
    columns = (file[name][...] for name in ("corner_cluster", "corner_cluster_size", "corner_cluster_vertex"))
    return tuple(Corner(point, int(size), int(vertex)) for point, size, vertex in zip(*columns, strict=True))

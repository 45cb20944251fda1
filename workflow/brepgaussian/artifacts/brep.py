"""`brep.h5`: curves, corners, refined surfaces and the gate report that go with `brep.step`."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance, create_h5, open_h5, put, strings
from brepgaussian.geometry.surfaces import ROW_LENGTH, Surface, surface_from_row, surface_to_row

KIND = "brep"


@dataclass(frozen=True)
class Curve:
    """One trimmed curve.

    Attributes:
        kind: line, circle, ellipse or other.
        faces: indices of its two surfaces in `Brep.surfaces`.
        t_range: parameter range; arc length for a line, radians for a circle or an ellipse, 0..1 for other.
        points: (M, 3) float64 samples along the trimmed curve, unit frame, first to last.
    """

    kind: str
    faces: tuple[int, int]
    t_range: tuple[float, float]
    points: NDArray[np.float64]


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
    """

    surfaces: tuple[Surface, ...]
    curves: tuple[Curve, ...]
    corners: NDArray[np.float64]
    report: dict[str, Any] = field(default_factory=dict)

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
            )
            for i, kind in enumerate(strings(file["curve_type"]))
        )
        return Brep(
            surfaces=tuple(surface_from_row(k, row) for k, row in zip(kinds, parameters, strict=True)),
            curves=curves,
            corners=file["corners"][...],
            report=json.loads(str(file.attrs["report"])),
        )

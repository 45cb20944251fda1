"""The layers of a page's 3D viewer, as JSON-able mappings."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.report import colors, encode
from brepgaussian.report.content import Content
from brepgaussian.settings.report import ReportSettings

_SIGMAS = 1.5  # radius at which a surfel is drawn, in standard deviations
_TRUTH = np.array([0.10, 0.55, 0.30])
_UNSEEN = np.array([0.60, 0.35, 0.75])
Array = NDArray[np.float64]
Layer = dict[str, Any]


def layers(content: Content, settings: ReportSettings) -> list[Layer]:
    """All layers, in the order in which they are listed and drawn."""
    rng = np.random.default_rng(settings.seed)
    found = [
        _solid(content),
        _lines("curves", "curves", [curve.points for curve in content.brep.curves], colors.INK, on=True),
        _dots("corners", "corners", content.brep.corners, colors.CORNER, on=True, radius=3.2),
        _points(content, rng, settings.page_points),
        _edge_points(content, rng, settings.page_points),
        _surfels(content, rng, settings.page_surfels),
        _dots("edge_cloud", "3D edge cloud of stage 1", content.evidence.edge_points, colors.INK),
        _dots("unobserved", "seen by fewer than two views", content.evidence.unobserved, _UNSEEN, radius=2.0),
    ]
    if content.truth is not None and content.missed is not None:
        ids = content.truth.curve_id
        pieces = [content.truth.curve_points[ids == i] for i in range(len(content.truth.curve_types))]
        found.append(_lines("truth_curves", "truth: sharp curves", pieces, _TRUTH))
        keep = _subset(rng, len(content.truth.points), settings.page_points)
        painted = colors.error_colors(content.missed[keep], colors.error_end(content.missed))
        found.append(
            {
                **_dots("missed", "truth: distance to the solid", content.truth.points[keep], painted),
                "normals": encode.directions(content.truth.normals[keep]),
                "legend": _legend(colors.error_end(content.missed)),
            }
        )
    return [layer for layer in found if layer["count"] > 0]


def _solid(content: Content) -> Layer:
    vertices, triangles = content.solid.fine
    coarse = content.solid
    fine_face = _nearest_face(content)
    paints = {"faces": encode.rgb(colors.patch_colors(fine_face))}
    legend = None
    if content.errors is not None:
        end = colors.error_end(content.errors)
        paints["error"] = encode.rgb(colors.error_colors(content.errors, end))
        legend = _legend(end)
    return {
        "id": "solid",
        "name": "solid",
        "kind": "mesh",
        "on": True,
        "count": len(np.unique(coarse.face)),
        "positions": encode.positions(vertices),
        "triangles": encode.packed(triangles.astype("<u4")),
        "color": encode.to_bytes(colors.STEEL).tolist(),
        "paints": paints,
        "legend": legend,
    }


def _nearest_face(content: Content) -> NDArray[np.int64]:
    """(K,) face of each corner of the fine triangles (corners are not shared by faces)."""
    vertices, triangles = content.solid.fine
    owner = np.full(len(vertices), -1)
    owner[content.solid.triangles] = content.solid.face[:, None]
    while (owner[triangles] < 0).any():  # a corner from a split takes the face of its triangle's others
        known = owner[triangles].max(axis=1)
        before = np.count_nonzero(owner < 0)
        np.maximum.at(owner, triangles, known[:, None])
        if np.count_nonzero(owner < 0) == before:
            break
    return owner


def _points(content: Content, rng: np.random.Generator, most: int) -> Layer:
    labelled = np.flatnonzero(content.points.label >= 0)
    keep = labelled[_subset(rng, len(labelled), most)]
    painted = colors.patch_colors(content.points.label)[keep]
    layer = _dots("points", "labelled points", content.points.xyz[keep], painted, radius=1.7)
    return {**layer, "normals": encode.directions(content.points.normals[keep]), "count": len(labelled)}


def _edge_points(content: Content, rng: np.random.Generator, most: int) -> Layer:
    on_curve = np.flatnonzero(content.points.curve >= 0)
    keep = on_curve[_subset(rng, len(on_curve), most)]
    painted = colors.patch_colors(content.points.curve)[keep]
    return {
        **_dots("edge_points", "edge points", content.points.xyz[keep], painted, radius=1.7),
        "count": len(on_curve),
    }


def _surfels(content: Content, rng: np.random.Generator, most: int) -> Layer:
    surfels = content.surfels
    keep = _subset(rng, len(surfels.centers), most)
    axes = surfels.axes[keep]
    return {
        "id": "surfels",
        "name": "surfels",
        "kind": "discs",
        "on": False,
        "count": len(surfels.centers),
        "positions": encode.positions(surfels.centers[keep]),
        "along_u": encode.lengths(axes[:, :, 0] * surfels.scales[keep, :1] * _SIGMAS),
        "along_v": encode.lengths(axes[:, :, 1] * surfels.scales[keep, 1:] * _SIGMAS),
        "colors": encode.rgb(surfels.colors[keep]),
    }


def _dots(
    name: str, title: str, points: NDArray[np.floating], color: Array, on: bool = False, radius: float = 1.4
) -> Layer:
    return {
        "id": name,
        "name": title,
        "kind": "points",
        "on": on,
        "count": len(points),
        "positions": encode.positions(points),
        "colors": encode.rgb(np.broadcast_to(color, (len(points), 3))),
        "radius": radius,
    }


def _lines(name: str, title: str, polylines: list[Array], color: Array, on: bool = False) -> Layer:
    polylines = [line for line in polylines if len(line) > 1]
    return {
        "id": name,
        "name": title,
        "kind": "lines",
        "on": on,
        "count": len(polylines),
        "positions": encode.positions(np.concatenate([*polylines, np.zeros((0, 3))])),
        "starts": np.cumsum([0, *map(len, polylines)]).tolist(),
        "color": encode.to_bytes(color).tolist(),
    }


def _legend(end: float) -> dict[str, Any]:
    stops = encode.to_bytes(colors.error_colors(np.linspace(0, 1, 7), 1.0)).tolist()
    return {"end": end, "stops": stops}


def _subset(rng: np.random.Generator, count: int, most: int) -> NDArray[np.int64]:
    """Indices of all, or of `most` drawn at random in their order."""
    return np.arange(count) if count <= most else np.sort(rng.choice(count, most, replace=False))

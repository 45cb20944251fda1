"""One self-contained HTML page of an object: views, layers in 3D, scores, gate report, the STEP."""

import os
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import atomic
from brepgaussian.metrics.columns import COLUMNS, CURVE, EDGE, HEAD, PATCH, SOLID, SURFACE
from brepgaussian.report import colors, encode
from brepgaussian.report.content import Content
from brepgaussian.report.layers import layers
from brepgaussian.report.picture import Frame, frame_on_object, runs, upward, visible
from brepgaussian.settings.report import ReportSettings

_ASSETS = Path(__file__).parent
_LONG = 120  # characters of a list that is folded away
_LARGEST_EMBEDDED = 4_000_000  # bytes of a STEP file that goes into the page itself
_GROUPS = {
    "Run": HEAD[2:],
    "Patches (labelled points)": PATCH,
    "Edges (labelled points)": EDGE,
    "Surface (STEP)": SURFACE,
    "Curves (STEP)": CURVE,
    "Solid (STEP)": SOLID,
}


def make_page(content: Content, out_html: str | Path, settings: ReportSettings) -> None:
    """Write the page.

    Args:
        content: the object's artifacts.
        out_html: the page.
        settings: settings of the stage.
    """
    template = Template((_ASSETS / "page.html").read_text(encoding="utf-8"))
    page = template.substitute(
        name=encode.escape(content.object_name),
        subtitle=encode.escape(_subtitle(content)),
        badges=_badges(content.row),
        step_link=_step_link(content, Path(out_html)),
        views="\n".join(_view(content, view, settings) for view in _spread(content, settings.page_views)),
        mask_toggles=_mask_toggles(content),
        hidden=" ".join(f"hide-{kind}" for kind in ("edges", *_patch_masks(content)) if kind != _shown(content)),
        metrics=_metrics(content.row),
        report=_tree(content.brep.report),
        primitives=_primitives(content),
        data=encode.script_json({"layers": layers(content, settings), "camera": _camera(content), **_units()}),
        viewer=(_ASSETS / "viewer.js").read_text(encoding="utf-8"),
    )
    with atomic(out_html) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _units() -> dict[str, Any]:
    return {"steps": encode.POSITION_STEPS}


def _subtitle(content: Content) -> str:
    row = content.row
    parts = [f"variant {row['variant']}", f"{len(content.views.cameras)} views"]
    if row["seconds"] is not None:
        parts.append(f"{row['seconds']:.0f} s")
    if row["peak_mb"] is not None:
        parts.append(f"{row['peak_mb']:.0f} MB")
    return ", ".join(parts)


def _badges(row: dict[str, Any]) -> str:
    """The answers that a reader looks for first."""
    shown = [("closed", row["closed"]), ("valid", row["valid"])]
    if row["topology_match"] is not None:
        shown.append(("same topology as the truth", row["topology_match"]))
    badges = [f'<span class="badge {"good" if ok else "bad"}">{"✓" if ok else "✗"} {name}</span>' for name, ok in shown]
    if row["fallback"]:
        badges.append('<span class="badge bad">polyhedral last resort</span>')
    return " ".join(badges)


def _step_link(content: Content, out_html: Path) -> str:
    """A download of the STEP: inside the page if small, else beside it."""
    path = content.step_path
    name = encode.escape(f"{content.object_name}.step")
    size = path.stat().st_size
    small = size <= _LARGEST_EMBEDDED
    target = encode.data_uri(path.read_bytes(), "model/step") if small else os.path.relpath(path, out_html.parent)
    return f'<a class="button" download="{name}" href="{encode.escape(target)}">{name} ({size // 1024 + 1} kB)</a>'


def _spread(content: Content, count: int) -> list[int]:
    """The view with the most regions first, then views spread evenly."""
    total = len(content.views.cameras)
    first = content.view
    others = [round(first + i * total / min(count, total)) % total for i in range(min(count, total))]
    return list(dict.fromkeys(others))


def _view(content: Content, view: int, settings: ReportSettings) -> str:
    """One input view with its overlays: edges, patches, the result's curves."""
    frame = frame_on_object(content.views, view, settings.view_px)
    alpha = frame.crop(content.views.alpha[view])[..., None] / 255.0
    photo = frame.crop(content.views.rgb[view]) / 255.0 * alpha + colors.BACKGROUND * (1 - alpha)
    edges = frame.crop(content.masks.edges[view])
    ink = np.dstack([np.broadcast_to(encode.to_bytes(colors.CORNER), (*edges.shape, 3)), edges])
    layers_ = [
        f'<img class="photo" alt="input view {view + 1}" src="{encode.jpeg(photo)}">',
        *(_regions(kind, frame.crop(ids[view])) for kind, ids in _patch_masks(content).items()),
        f'<img class="over edges" alt="edge map" src="{encode.png(ink.astype(np.uint8))}">',
        _curves(content, frame),
    ]
    caption = f"view {view + 1}, {encode.escape(content.views.names[view])}"
    return f'<figure><div class="stack">{"".join(layers_)}</div><figcaption>{caption}</figcaption></figure>'


def _patch_masks(content: Content) -> dict[str, NDArray[np.int16]]:
    """(V, H, W) region ids, 0 for none, by name; the best of ours comes last but for the truth's."""
    masks = {"detected": content.masks.patches}
    if content.repaired is not None:
        masks["repaired"] = content.repaired
    if content.truth is not None and content.truth.face_ids is not None:
        masks["true"] = content.truth.face_ids + 1
    return masks


def _shown(content: Content) -> str:
    """The patch masks that are shown at first."""
    return "detected" if content.repaired is None else "repaired"


def _mask_toggles(content: Content) -> str:
    """Radio buttons of the patch masks."""
    titles = {"none": "none", "detected": "as detected", "repaired": "repaired by stage 2", "true": "true"}
    return "\n".join(
        f'<label><input type="radio" name="patches" value="{kind}"{" checked" * (kind == _shown(content))}> '
        f"{titles[kind]}</label>"
        for kind in ("none", *_patch_masks(content))
    )


def _regions(kind: str, ids: NDArray[np.integer]) -> str:
    """(H, W) region ids, 0 for none, as a coloured overlay."""
    ids = ids.astype(int)
    painted = encode.to_bytes(colors.patch_colors(ids.ravel() - 1)).reshape(*ids.shape, 3)
    picture = np.dstack([painted, np.where(ids > 0, 255, 0).astype(np.uint8)])
    return f'<img class="over patches {kind}" alt="patches, {kind}" src="{encode.png(picture)}">'


def _curves(content: Content, frame: Frame) -> str:
    """The visible parts of the result's curves as an SVG over the photograph."""
    paths = []
    for curve in content.brep.curves:
        if len(curve.points) < 2:
            continue
        pixels, _ = frame.project(curve.points)
        for start, stop, seen in runs(visible(frame, curve.points, content.solid.surface)):
            if seen and stop - start > 1:
                paths.append("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in pixels[start:stop]))
    return f'<svg class="over curves" viewBox="0 0 {frame.size} {frame.size}"><path d="{"".join(paths)}"/></svg>'


def _metrics(row: dict[str, Any]) -> str:
    """The row of metrics in groups; what is empty is left out."""
    assert set(row) == set(COLUMNS)
    tables = []
    for title, names in _GROUPS.items():
        lines = [
            f"<tr><th>{encode.escape(name)}</th><td>{encode.escape(row[name])}</td></tr>"
            for name in names
            if row[name] not in (None, "")
        ]
        if lines:
            tables.append(f"<table><caption>{title}</caption>{''.join(lines)}</table>")
    return "\n".join(tables)


def _tree(value: Any) -> str:
    """Nested JSON-able data as nested tables."""
    if isinstance(value, dict):
        lines = "".join(f"<tr><th>{encode.escape(k)}</th><td>{_tree(v)}</td></tr>" for k, v in sorted(value.items()))
        return f"<table>{lines}</table>" if lines else "–"
    if isinstance(value, list):
        if any(isinstance(v, (dict, list)) for v in value):
            return "<ol>" + "".join(f"<li>{_tree(v)}</li>" for v in value) + "</ol>"
        words = [v if isinstance(v, str) else encode.escape(v) for v in value]
        text = encode.escape(", ".join(words))
        return f"<details><summary>{len(value)} entries</summary>{text}</details>" if len(text) > _LONG else text
    return encode.escape(value)


def _primitives(content: Content) -> str:
    """Table of the refined surfaces."""
    head = "<tr><th>surface</th><th>radius</th><th>minor</th><th>half angle</th><th>hole</th></tr>"
    lines = []
    for surface in content.brep.surfaces:
        cells = [surface.kind, surface.radius or None, surface.minor or None]
        cells += [f"{np.degrees(surface.angle):.2f}°" if surface.angle else None]
        cells += [surface.flipped if surface.kind != "plane" else None]
        lines.append("<tr>" + "".join(f"<td>{encode.escape(cell)}</td>" for cell in cells) + "</tr>")
    return f"<table>{head}{''.join(lines)}</table>"


def _camera(content: Content) -> dict[str, Any]:
    """Where the viewer starts: the best input view; and which way is up, from all of them."""
    cameras = content.views.cameras
    return {"back": _unit(cameras.centers[content.view] - 0.5), "up": _unit(upward(cameras))}


def _unit(vector: NDArray[np.float64]) -> list[float]:
    length = float(np.linalg.norm(vector))
    return [round(float(v), 5) for v in (vector / length if length > 0 else [0.6, -0.6, 0.5])]

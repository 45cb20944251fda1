"""The numbers of the paper's tables 1 to 6, on the paper's own objects (ABC-NEF), as printed there.

They are shown beside ours for orientation and are not comparable object by object: the paper does not
list its objects, corrects masks by hand, and does not say whether D_c is the sum or the average of the
two directed means.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperRow:
    """One row of a table of the paper: values by column of `metrics.csv` (distances in unit lengths)."""

    method: str
    input: str
    values: dict[str, float]


def _segmentation(kind: str, method: str, source: str, precision: float, recall: float, f1: float) -> PaperRow:
    names = (f"{kind}_precision_008", f"{kind}_recall_008", f"{kind}_f1_008")
    return PaperRow(method, source, dict(zip(names, (precision, recall, f1), strict=True)))


def _cad(method: str, source: str, *values: float | None) -> PaperRow:
    """Surface D_c and curve D_c in 1e-2, surface D_h and curve D_h in 1e-1, None where the paper has none."""
    names = ("surface_cd", "curve_cd", "surface_hd", "curve_hd")
    scales = (1e-2, 1e-2, 1e-1, 1e-1)
    found = {n: v * s for n, v, s in zip(names, values, scales, strict=True) if v is not None}
    return PaperRow(method, source, found)


OURS = "BrepGaussian (paper)"
PATCHES = (
    _segmentation("patch", "ParSeNet", "true points", 0.5108, 0.2646, 0.3486),
    _segmentation("patch", "PCER-Net", "true points", 0.8760, 0.9119, 0.8936),
    _segmentation("patch", "SED-Net", "true points", 0.9490, 1.0, 0.9738),
    _segmentation("patch", "HPNet", "true points", 1.0, 0.2142, 0.3528),
    _segmentation("patch", "ParSeNet", "densified points", 0.6229, 0.2364, 0.3427),
    _segmentation("patch", "PCER-Net", "densified points", 0.5357, 0.7924, 0.6392),
    _segmentation("patch", OURS, "images", 0.8903, 0.9181, 0.9040),
)
EDGES = (
    _segmentation("edge", "PCER-Net", "true points", 0.8807, 0.9563, 0.9169),
    _segmentation("edge", "SED-Net", "true points", 0.9693, 0.9913, 0.9802),
    _segmentation("edge", "PCER-Net", "densified points", 0.7149, 0.8349, 0.7703),
    _segmentation("edge", OURS, "images", 0.9350, 0.9253, 0.9301),
)
CAD = (
    _cad("Point2CAD", "the paper's labels", 3.38, 5.42, 2.413, 3.858),
    _cad("Point2CAD", "PCER-Net", 7.08, 20.45, 3.394, 7.276),
    _cad("Split-and-Fit", "densified points", 6.23, 13.98, 3.523, 4.962),
    _cad(OURS, "images", 4.90, 5.01, 3.351, 3.626),
)
ABLATION_PATCHES = (
    _segmentation("patch", "paper: w/o two-stage learning", "images", 0.8709, 0.6805, 0.7672),
    _segmentation("patch", "paper: w/o triplet loss", "images", 0.8395, 0.9374, 0.8857),
    _segmentation("patch", "paper: full model", "images", 0.8903, 0.9181, 0.9040),
)
ABLATION_CAD = (
    _cad("paper: w/o edge segmentation", "images", 4.63, 5.83, 3.601, 3.705),
    _cad("paper: w/o densification", "images", 5.99, None, 4.184, None),
    _cad("paper: full model", "images", 4.90, 5.01, 3.351, 3.626),
)


def _masks(method: str, precision: float, recall: float, f1: float, distance: float) -> PaperRow:
    row = _segmentation("patch", f"paper: {method}", "images", precision, recall, f1)
    return PaperRow(row.method, row.input, {**row.values, "surface_cd": distance * 1e-2})


MASKS = (
    _masks("manual correction", 0.8704, 0.9191, 0.8941, 5.04),
    _masks("fine-tuned SAM", 0.8896, 0.8363, 0.8621, 5.33),
    _masks("vanilla SAM", 0.8435, 0.8090, 0.8259, 5.66),
)

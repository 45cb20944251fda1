"""BrepGaussian: calibrated multi-view images of a mechanical part to a closed B-Rep solid.

One package per stage ("room"): views, masks, splatting (stage1 and stage2), points, primitives,
brep, metrics, report. Rooms talk through files only; the readers and writers of those files live
in `artifacts`, shared mathematics in `geometry`, settings in `settings`.
"""

__version__ = "0.1.0"

"""Patch masks from Segment Anything, prompted with points inside edge-bounded regions as in the paper."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.artifacts.views import Views
from brepgaussian.errors import InputError, ToolError
from brepgaussian.masks.evaluate import EDGE_THRESHOLD
from brepgaussian.masks.steps import Crop
from brepgaussian.settings.masks import MasksSettings

_MAX_PROMPTS = 64  # points sent through the mask decoder at once
_DUPLICATE_IOU = 0.8  # masks that overlap more are the same patch


class SamPatches:
    """Segment Anything through `transformers`, from a local folder; nothing is downloaded.

    Raises:
        InputError: no checkpoint folder is given, or it cannot be loaded.
        ToolError: `transformers` or `torch` is not installed.
    """

    def __init__(self, views: Views, settings: MasksSettings) -> None:
        folder = settings.sam_checkpoint
        if not folder or not Path(folder).is_dir():
            raise InputError(
                "no Segment Anything checkpoint is given" if not folder else "is not a folder",
                file=folder or None,
                fix="set masks.sam_checkpoint to a folder saved by transformers, or choose masks.patches: classical",
            )
        self.rgb, self.minimum = views.rgb, settings.minimum_area
        self.model, self.processor = _load(folder, settings.sam_model)

    def patches(self, view: int, crop: Crop, edges: NDArray[np.uint8] | None) -> NDArray[np.int16]:
        """(H, W) int16 ids; the best mask of every prompt, large ones under small ones."""
        assert edges is not None
        points = prompts(edges[crop.box], crop.inside, self.minimum)
        image = np.ascontiguousarray(self.rgb[view][crop.box])
        masks, scores = self._segment(image, points)
        return crop.paste(paint(masks & crop.inside, scores, self.minimum), edges.shape)

    def _segment(self, image: NDArray[np.uint8], points: NDArray) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
        """The best of the model's masks for each of (P, 2) points: (P, h, w) and its predicted IoU (P,)."""
        import torch

        masks, scores = [np.zeros((0, *image.shape[:2]), bool)], [np.zeros(0, np.float32)]
        for start in range(0, len(points), _MAX_PROMPTS):
            part = points[start : start + _MAX_PROMPTS]
            inputs = self.processor(images=image, input_points=[[[p] for p in part.tolist()]], return_tensors="pt")
            with torch.inference_mode():
                answer = self.model(**inputs)
            sizes = [inputs["original_sizes"]]
            if "reshaped_input_sizes" in inputs:  # the first generation pads after resizing
                sizes.append(inputs["reshaped_input_sizes"])
            full = self.processor.post_process_masks(answer.pred_masks, *sizes)[0]
            best = answer.iou_scores[0].argmax(-1)
            row = torch.arange(len(part))
            masks.append(np.asarray(full[row, best], bool))
            scores.append(np.asarray(answer.iou_scores[0][row, best], np.float32))
        return np.concatenate(masks), np.concatenate(scores)


def _load(folder: str, generation: str) -> tuple[Any, Any]:
    try:
        import transformers
    except ImportError as error:
        raise ToolError(
            "transformers is not installed, and masks.patches is sam",
            fix="pip install transformers, or choose masks.patches: classical",
        ) from error
    names = {"sam": ("SamModel", "SamProcessor"), "sam2": ("Sam2Model", "Sam2Processor")}[generation]
    try:
        model, processor = (getattr(transformers, name) for name in names)
        return (
            model.from_pretrained(folder, local_files_only=True).eval(),
            processor.from_pretrained(folder, local_files_only=True),
        )
    except (AttributeError, OSError, ValueError, RuntimeError) as error:
        raise InputError(
            f"cannot be loaded as a {generation} checkpoint ({str(error).splitlines()[0]})",
            file=folder,
            fix="save it with transformers' save_pretrained, and set masks.sam_model to its generation",
        ) from error


def prompts(edges: NDArray[np.uint8], inside: NDArray[np.bool_], minimum: int) -> NDArray[np.int64]:
    """One point (x, y) for each region that edges bound: the pixel farthest from them.

    Args:
        edges: (h, w) uint8 edge probability.
        inside: (h, w) silhouette.
        minimum: smaller regions get no prompt, px.
    """
    free = inside & (edges < EDGE_THRESHOLD)
    labels, count = ndimage.label(free)
    depth = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    area = np.bincount(labels.ravel(), minlength=count + 1)
    wanted = [i for i in range(1, count + 1) if area[i] >= minimum]
    if not wanted:
        return np.zeros((0, 2), np.int64)
    deepest = np.array(ndimage.maximum_position(depth, labels, wanted), np.int64)
    return deepest[:, ::-1]


def paint(masks: NDArray[np.bool_], scores: NDArray[np.float32], minimum: int) -> NDArray[np.int16]:
    """Turn overlapping masks into one (h, w) int16 id map: duplicates dropped, small masks over large ones."""
    kept: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        if masks[i].sum() >= minimum and all(_iou(masks[i], masks[j]) <= _DUPLICATE_IOU for j in kept):
            kept.append(int(i))
    ids = np.zeros(masks.shape[1:], np.int16)
    for number, i in enumerate(sorted(kept, key=lambda j: (-int(masks[j].sum()), j)), start=1):
        ids[masks[i]] = number
    return ids


def _iou(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    return float((a & b).sum() / max((a | b).sum(), 1))

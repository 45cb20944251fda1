"""Edge maps of one image: step strength made thin, borders of patches, and maps that others made."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.filters import apply_hysteresis_threshold

from brepgaussian.errors import InputError, ToolError
from brepgaussian.masks.steps import DIRECTIONS, Crop, step_strength, without_shading

_WEAK = 0.5  # edges that start above the threshold are followed down to this share of it
_NOISE_FACTOR = 4.0  # the strongest of 8 noisy half-disk steps stays below so many of their standard errors
_MAX_OFFSET_PX = 4  # shipped edge maps are shifted by less
_STRONG = 128  # of a shipped edge map, when its offset is measured


def edge_threshold(noise: float, radius: int, step: float) -> float:
    """Step strength from which a pixel is an edge: the noise-free threshold, or what noise alone never reaches."""
    pixels = 0.5 * np.pi * radius**2
    return max(step, _NOISE_FACTOR * noise * float(np.sqrt(2 / pixels)))


def suppress(strength: NDArray[np.float32], direction: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Keep the step strength where it is the largest across its line (non-maximum suppression).

    Args:
        strength: (h, w) step strength.
        direction: (h, w) uint8 index of the line's direction, as `step_strength` gives it.
    """
    angle = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    across = np.rint(np.stack([np.cos(angle), -np.sin(angle)], 1)).astype(int)  # rows, columns
    padded = np.pad(strength, 1)
    kept = np.zeros_like(strength)
    height, width = strength.shape
    for i, (dy, dx) in enumerate(across):
        ahead = padded[1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]
        behind = padded[1 - dy : 1 - dy + height, 1 - dx : 1 - dx + width]
        peak = (direction == i) & (strength > ahead) & (strength >= behind)
        kept[peak] = strength[peak]
    return kept


def classical_edges(crop: Crop, radius: int, step: float, width: int) -> NDArray[np.uint8]:
    """Silhouette and interior steps of one cropped view as (h, w) uint8 edge probability.

    Interior lines are followed with hysteresis; half probability is the threshold.
    """
    strength, direction = step_strength(crop.grey, crop.inside, radius)
    strength = without_shading(strength, radius)
    threshold = edge_threshold(crop.noise, radius, step)
    peaks = suppress(strength, direction)
    kept = apply_hysteresis_threshold(peaks, _WEAK * threshold, threshold)
    probability = np.where(kept, np.maximum(strength / (strength + threshold), 0.51), 0.0)
    probability[silhouette_border(crop.inside)] = 1.0
    return widen(np.rint(255 * probability).astype(np.uint8), width)


def region_edges(patches: NDArray[np.integer], width: int) -> NDArray[np.uint8]:
    """Borders of one view's patches as (H, W) uint8, 255 on a border."""
    edge = np.zeros(patches.shape, np.uint8)
    edge[:, :-1][patches[:, :-1] != patches[:, 1:]] = 255
    edge[:-1][patches[:-1] != patches[1:]] = 255
    return widen(edge, width)


def silhouette_border(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Object pixels with a background pixel beside them."""
    eroded = cv2.erode(inside.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)), borderValue=0)
    return inside & (eroded == 0)


def widen(edge: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """Dilate lines one pixel wide to `width` pixels."""
    if width == 1:
        return edge
    return np.asarray(cv2.dilate(edge, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))), np.uint8)


def measure_offset(edge_maps: NDArray[np.uint8], alpha: NDArray[np.uint8]) -> tuple[int, int]:
    """Shift in whole pixels (x, y) of shipped edge maps against the silhouettes, the same for all views.

    Args:
        edge_maps: (V, H, W) uint8.
        alpha: (V, H, W) uint8 silhouettes.

    Returns:
        The shift whose reversal brings most edge strength onto the silhouettes' borders.
    """
    contour = np.stack([silhouette_border(a >= _STRONG) for a in alpha]).astype(np.float32)
    # an outline two pixels wide, centred on the crack between object and background
    outside = np.stack([_outer_border(a >= _STRONG) for a in alpha]).astype(np.float32)
    line = contour + outside
    best, offset = -1.0, (0, 0)
    for dy in range(-_MAX_OFFSET_PX, _MAX_OFFSET_PX + 1):
        for dx in range(-_MAX_OFFSET_PX, _MAX_OFFSET_PX + 1):
            score = float((shift(edge_maps, -dx, -dy).astype(np.float32) * line).sum())
            if score > best:
                best, offset = score, (dx, dy)
    return offset


def _outer_border(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return silhouette_border(~inside)


def shift(images: NDArray[np.uint8], dx: int, dy: int) -> NDArray[np.uint8]:
    """Move (V, H, W) images by whole pixels; what enters is 0."""
    moved = np.zeros_like(images)
    height, width = images.shape[1:]
    rows, columns = slice(max(dy, 0), height + min(dy, 0)), slice(max(dx, 0), width + min(dx, 0))
    from_rows, from_columns = slice(max(-dy, 0), height + min(-dy, 0)), slice(max(-dx, 0), width + min(-dx, 0))
    moved[:, rows, columns] = images[:, from_rows, from_columns]
    return moved


def load_network(path: str) -> Any:
    """Load the user's TorchScript edge network: (1, 3, H, W) float in 0..1 to (1, 1, H, W) probability.

    Raises:
        InputError: no path is given, or the file cannot be loaded.
        ToolError: torch is not installed.
    """
    if not path:
        raise InputError(
            "no edge network is given", fix="set masks.weights to a TorchScript file, or choose other edges"
        )
    if not Path(path).is_file():
        raise InputError("does not exist", file=path, fix="set masks.weights to a TorchScript file")
    try:
        import torch
    except ImportError as error:
        raise ToolError("torch is not installed", fix="pip install torch, or choose other edges") from error
    try:
        network = torch.jit.load(path, map_location="cpu")
    except (RuntimeError, ValueError) as error:
        raise InputError(
            f"is not a TorchScript file ({str(error).splitlines()[0]})",
            file=path,
            fix="export the network with torch.jit.trace(...).save(...)",
        ) from error
    return network.eval()


def network_edges(network: Any, rgb: NDArray[np.uint8], path: str) -> NDArray[np.uint8]:
    """Run an edge network on one (H, W, 3) image; the last output counts where it has several.

    Raises:
        InputError: the network cannot take the image or answers with another shape.
    """
    import torch

    image = torch.from_numpy(rgb.astype(np.float32) / 255).permute(2, 0, 1)[None]
    try:
        with torch.inference_mode():
            answer = network(image)
    except RuntimeError as error:
        raise InputError(
            f"the edge network fails on an image of shape {tuple(image.shape)}",
            file=path,
            fix="export a network that takes (1, 3, H, W) float in 0..1",
        ) from error
    if isinstance(answer, (list, tuple)):
        answer = answer[-1]
    result = np.asarray(answer.detach().float().squeeze())
    if result.shape != rgb.shape[:2]:
        raise InputError(
            f"the edge network answers with shape {result.shape} for an image of {rgb.shape[:2]}",
            file=path,
            fix="export a network that returns one probability a pixel",
        )
    return np.rint(255 * np.clip(result, 0, 1)).astype(np.uint8)

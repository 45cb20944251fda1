"""Edge maps of one image: step strength made thin, borders of patches, and maps that others made."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.filters import apply_hysteresis_threshold

from brepgaussian.errors import InputError, ToolError
from brepgaussian.masks.steps import DIRECTIONS, Crop, noise_map, step_strength, without_shading
from brepgaussian.views.checks import OPAQUE

_WEAK = 0.5  # edges that start above the threshold are followed down to this share of it
_NOISE_FACTOR = 4.0  # the strongest of 8 noisy half-disk steps stays below so many of their standard errors
_PROFILE_PX = 6.0  # half the length of the profiles across the silhouette on which the offset is measured
_PROFILE_STEP_PX = 0.5
_PROFILE_MASS = 100.0  # grey levels x px that a line has at least
_OFFSET_ROUNDS = 10  # of reweighting
_OFFSET_SCALE_PX = 0.3  # profiles farther off than that count less


def edge_threshold(crop: Crop, radius: int, step: float) -> NDArray[np.float32]:
    """(h, w) step strength from which a pixel is an edge: the noise-free threshold and what noise hardly reaches.

    Both in quadrature: noise lifts what stays just below the noise-free threshold (shading, light from other faces).
    """
    pixels = 0.5 * np.pi * radius**2
    return np.hypot(np.float32(step), _NOISE_FACTOR * noise_map(crop) * np.float32(np.sqrt(2 / pixels)))


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
    threshold = edge_threshold(crop, radius, step)
    peaks = suppress(strength, direction)
    kept = apply_hysteresis_threshold(peaks / threshold, _WEAK, 1.0)
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


def measure_offset(edge_maps: NDArray[np.uint8], alpha: NDArray[np.uint8]) -> tuple[float, float]:
    """Shift (x, y) in pixels of shipped edge maps against the silhouettes, the same for all views.

    Each profile across a silhouette gives the shift along its normal (the line's centre of mass); all of them together
    give the shift, robustly, beside a common distance of the lines to the outside.

    Args:
        edge_maps: (V, H, W) uint8.
        alpha: (V, H, W) uint8 silhouettes.
    """
    normals, offsets = [np.zeros((0, 2))], [np.zeros(0)]
    along = np.arange(-_PROFILE_PX, _PROFILE_PX + 1e-9, _PROFILE_STEP_PX)
    for edge, cover in zip(edge_maps, alpha, strict=True):
        soft = cv2.GaussianBlur(cover.astype(np.float32), (0, 0), 1.5)
        y, x = np.nonzero(silhouette_border(cover >= OPAQUE))
        normal = -np.stack([cv2.Sobel(soft, cv2.CV_32F, 1, 0)[y, x], cv2.Sobel(soft, cv2.CV_32F, 0, 1)[y, x]], 1)
        length = np.linalg.norm(normal, axis=1)
        normal = normal / np.maximum(length, 1e-6)[:, None]
        position = np.stack([x, y], 1)[:, None] + normal[:, None] * (0.5 + along)[None, :, None]
        maps = position.astype(np.float32)
        profile = cv2.remap(edge.astype(np.float32), maps[..., 0], maps[..., 1], cv2.INTER_LINEAR)
        mass = profile.sum(1)
        good = (mass * _PROFILE_STEP_PX > _PROFILE_MASS) & (length > 0)
        normals.append(normal[good])
        offsets.append((profile @ along)[good] / mass[good])
    normal, offset = np.concatenate(normals), np.concatenate(offsets)
    design = np.column_stack([normal, np.ones(len(normal))])
    if len(offset) < design.shape[1]:
        return 0.0, 0.0
    weight: NDArray[np.float64] = np.ones(len(offset))
    shift_by = np.zeros(3)
    for _ in range(_OFFSET_ROUNDS):
        root = np.sqrt(weight)
        shift_by = np.linalg.lstsq(design * root[:, None], offset * root, rcond=None)[0]
        weight = 1 / np.maximum(1, np.abs(offset - design @ shift_by) / _OFFSET_SCALE_PX)
    return float(shift_by[0]), float(shift_by[1])


def shift(images: NDArray[np.uint8], dx: float, dy: float) -> NDArray[np.uint8]:
    """Move (V, H, W) images by (dx, dy) pixels, bilinear; what enters is 0."""
    height, width = images.shape[1:]
    move = np.array([[1, 0, dx], [0, 1, dy]], np.float64)
    return np.stack([np.asarray(cv2.warpAffine(image, move, (width, height)), np.uint8) for image in images])


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

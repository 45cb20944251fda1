"""Reading of a user's images: RGBA, or RGB with masks; every fault named."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.errors import InputError

Rgba = NDArray[np.uint8]
_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp")


def read_image(path: Path) -> NDArray[np.uint8]:
    """Read an image as (H, W), (H, W, 3) or (H, W, 4) uint8, RGB(A) order.

    Raises:
        InputError: the file is missing, truncated, or no image.
    """
    from PIL import Image, UnidentifiedImageError

    if not path.is_file():
        raise InputError("does not exist", file=path, fix="add the image or remove its camera")
    try:
        with Image.open(path) as opened:
            image: Image.Image = opened
            image.load()
            if image.mode in ("I;16", "I", "F"):
                raise InputError(f"has {image.mode} pixels", file=path, fix="convert it to 8 bits per channel")
            if image.mode in ("P", "LA", "PA"):
                image = image.convert("RGBA" if "transparency" in image.info or "A" in image.mode else "RGB")
            elif image.mode not in ("L", "RGB", "RGBA"):
                image = image.convert("RGB" if image.mode != "1" else "L")
            return np.asarray(image, np.uint8)
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise InputError(f"cannot be decoded ({error})", file=path, fix="copy or export the image again") from error


def read_size(path: Path) -> tuple[int, int]:
    """Width and height of an image.

    Raises:
        InputError: the file is missing or no image.
    """
    from PIL import Image, UnidentifiedImageError

    if not path.is_file():
        raise InputError("does not exist", file=path, fix="add the image or remove its camera")
    try:
        with Image.open(path) as image:
            return image.size
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise InputError(f"cannot be decoded ({error})", file=path, fix="copy or export the image again") from error


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        InputError: the file is missing or no JSON object.
    """
    import json

    if not path.is_file():
        raise InputError("does not exist", file=path, fix="add the file that describes the cameras")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"is not valid JSON ({error})", file=path, fix="mend or export it again") from error
    if not isinstance(data, dict) or not isinstance(data.get("frames"), list) or not data["frames"]:
        raise InputError("lists no frames", file=path, fix="give a JSON object with a non-empty list `frames`")
    return data


def resolve_image(path: Path) -> Path:
    """The image file of a path that may lack its suffix."""
    if path.suffix.lower() in _SUFFIXES:
        return path
    for suffix in _SUFFIXES:
        if path.with_name(path.name + suffix).is_file():
            return path.with_name(path.name + suffix)
    return path.with_name(path.name + ".png")


def find_mask(image: Path, root: Path) -> Path | None:
    """The mask of an image: `masks/` beside the image's folder or in the root, the same name or `<name>.png`."""
    for folder in (image.parent / "masks", image.parent.parent / "masks", root / "masks"):
        for name in (image.name, image.stem + ".png", image.name + ".png"):
            if (folder / name).is_file():
                return folder / name
    return None


def read_rgba(image: Path, mask: Path | None) -> Rgba:
    """Read a view as (H, W, 4) straight RGBA; colour is 0 where alpha is 0. A mask goes before an alpha channel.

    Raises:
        InputError: neither alpha nor mask, or sizes differ.
    """
    pixels = read_image(image)
    colour = np.repeat(pixels[:, :, None], 3, axis=2) if pixels.ndim == 2 else pixels[:, :, :3]
    if mask is not None:
        cover = read_image(mask)
        alpha = cover if cover.ndim == 2 else (cover[:, :, 3] if cover.shape[2] == 4 else cover[:, :, :3].max(axis=2))
        if alpha.shape != colour.shape[:2]:
            raise InputError(
                f"is {alpha.shape[1]} x {alpha.shape[0]} px but its image {colour.shape[1]} x {colour.shape[0]} px",
                file=mask,
                fix="give a mask of the image's size",
            )
        if alpha.max() == 1:  # written as 0 and 1
            alpha = alpha * np.uint8(255)
    elif pixels.ndim == 3 and pixels.shape[2] == 4:
        alpha = pixels[:, :, 3]
    else:
        raise InputError(
            "has no alpha channel, and there is no mask for it",
            file=image,
            fix="give RGBA images, or masks of the same names in a folder masks/ (white inside, black outside)",
        )
    rgba = np.dstack([colour, alpha])
    rgba[alpha == 0] = 0
    return rgba


def check_size(pixels: NDArray[np.uint8], width: int, height: int, file: Path) -> None:
    """Raise `InputError` unless an image has the size that its camera says."""
    if pixels.shape[:2] != (height, width):
        raise InputError(
            f"is {pixels.shape[1]} x {pixels.shape[0]} px but its camera is {width} x {height} px",
            file=file,
            fix="give the image that the cameras were calibrated with, or calibrate again",
        )

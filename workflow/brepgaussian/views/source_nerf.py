"""Source `nerf`: images with a `transforms.json` as Blender, instant-ngp and nerfstudio write it."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.errors import InputError
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.checks import check_intrinsics, check_pose
from brepgaussian.views.images import read_json, read_size, resolve_image
from brepgaussian.views.photos import Photo, load_photos, require_size
from brepgaussian.views.poses import opencv_from_opengl
from brepgaussian.views.source import Loaded

_NAMES = ("transforms.json", "transforms_train.json")
_PINHOLE = ("", "PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "RADIAL", "SIMPLE_RADIAL", "PERSPECTIVE")
_DISTORTION = ("k1", "k2", "p1", "p2", "k3")
_UNSUPPORTED = ("k4", "k5", "k6")


def load_nerf(name: str, path: str, truth: str, want_truth: bool, settings: ViewsSettings, threads: int) -> Loaded:
    """Load a folder with `transforms.json`, or that file; `truth` is a STEP in the same world frame, or empty."""
    file = _camera_file(Path(path))
    data = read_json(file)
    photos = [_photo(frame, data, file, index) for index, frame in enumerate(data["frames"])]
    return load_photos(name, photos, file.parent, truth, want_truth, settings, threads)


def _camera_file(path: Path) -> Path:
    if path.is_file():
        return path
    if not path.is_dir():
        raise InputError("does not exist", file=path, fix="give the folder that holds transforms.json")
    for name in _NAMES:
        if (path / name).is_file():
            return path / name
    raise InputError(f"holds no {_NAMES[0]}", file=path, fix="put the camera file beside the images")


def _photo(frame: Any, data: dict[str, Any], file: Path, index: int) -> Photo:
    """One frame; its own keys go before those of the whole file."""
    if not isinstance(frame, dict) or "file_path" not in frame or "transform_matrix" not in frame:
        raise InputError(
            f"frame {index} lacks file_path or transform_matrix", file=file, fix="export the cameras again"
        )
    keys = {**data, **frame}
    view = str(frame["file_path"])
    image = resolve_image(file.parent / view)
    mask = keys.get("mask_path")
    size = _size(keys, image, file, view)
    return Photo(
        image=image,
        mask=file.parent / str(mask) if mask else None,
        intrinsics=_intrinsics(keys, size, file, view),
        distortion=_distortion(keys, file, view),
        camera_to_world=opencv_from_opengl(_pose(frame["transform_matrix"], file, view)),
        size=size,
    )


def _size(keys: dict[str, Any], image: Path, file: Path, view: str) -> tuple[int, int]:
    if "w" in keys and "h" in keys:
        return require_size((_number(keys, "w", file, view), _number(keys, "h", file, view)), file, view)
    return read_size(image)


def _intrinsics(keys: dict[str, Any], size: tuple[int, int], file: Path, view: str) -> NDArray[np.float64]:
    width, height = size
    if "fl_x" in keys:
        fx = _number(keys, "fl_x", file, view)
    elif "camera_angle_x" in keys:
        fx = width / 2 / np.tan(_number(keys, "camera_angle_x", file, view) / 2)
    else:
        raise InputError(f"{view}: no focal length", file=file, fix="give fl_x (px) or camera_angle_x (rad)")
    fy = fx
    if "fl_y" in keys:
        fy = _number(keys, "fl_y", file, view)
    elif "camera_angle_y" in keys and "fl_x" not in keys:
        fy = height / 2 / np.tan(_number(keys, "camera_angle_y", file, view) / 2)
    cx = _number(keys, "cx", file, view) if "cx" in keys else width / 2
    cy = _number(keys, "cy", file, view) if "cy" in keys else height / 2
    values = np.array([fx, fy, cx, cy], float)
    check_intrinsics(values, file, view)
    return values


def _distortion(keys: dict[str, Any], file: Path, view: str) -> NDArray[np.float64]:
    model = str(keys.get("camera_model", "")).upper()
    higher = [key for key in _UNSUPPORTED if key in keys and _number(keys, key, file, view) != 0]
    if model not in _PINHOLE or higher or keys.get("is_fisheye"):
        what = f"the camera model {model}" if model not in _PINHOLE else ", ".join(higher) or "fisheye"
        raise InputError(
            f"{view}: {what} is not supported",
            file=file,
            fix="undistort the images first (for example with COLMAP's image_undistorter)",
        )
    return np.array([_number(keys, key, file, view) if key in keys else 0.0 for key in _DISTORTION])


def _pose(values: Any, file: Path, view: str) -> NDArray[np.float64]:
    try:
        pose = np.array(values, float)
    except (TypeError, ValueError):
        pose = np.zeros(0)
    check_pose(pose, file, view)
    return pose


def _number(keys: dict[str, Any], key: str, file: Path, view: str) -> float:
    try:
        value = float(keys[key])
    except (TypeError, ValueError):
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{view}: {key} is {keys[key]!r}", file=file, fix="give a finite number")
    return value

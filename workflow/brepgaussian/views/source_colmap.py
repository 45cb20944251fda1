"""Source `colmap`: images with a sparse model, text or binary, as COLMAP writes it."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.errors import InputError
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.checks import check_intrinsics, check_pose
from brepgaussian.views.photos import Photo, load_photos, require_size
from brepgaussian.views.source import Loaded

Array = NDArray[np.float64]
_PLACES = ("sparse/0", "sparse", "0", ".")
# Binary ids of COLMAP's camera models; parameters per model.
_MODELS = {
    0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 2: ("SIMPLE_RADIAL", 4), 3: ("RADIAL", 5), 4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8), 6: ("FULL_OPENCV", 12), 7: ("FOV", 5), 8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5), 10: ("THIN_PRISM_FISHEYE", 12),
}  # fmt: skip
_AGAIN = "export the sparse model again (cameras and images, .txt or .bin)"


@dataclass(frozen=True)
class _Camera:
    model: str
    size: tuple[int, int]
    parameters: Array


@dataclass(frozen=True)
class _Image:
    name: str
    camera: int
    quaternion: Array  # wxyz, camera from world
    translation: Array


def load_colmap(name: str, path: str, truth: str, want_truth: bool, settings: ViewsSettings, threads: int) -> Loaded:
    """Load a folder with a sparse model and `images/`; `truth` is a STEP in the same world frame, or empty."""
    folder = Path(path)
    if not folder.is_dir():
        raise InputError("is not a folder", file=folder, fix="give the folder that holds sparse/ and images/")
    cameras_file, images_file = _model_files(folder)
    try:
        cameras = dict(_read_cameras(cameras_file))
        images = list(_read_images(images_file))
    except (ValueError, IndexError, KeyError, struct.error, OSError) as error:
        raise InputError(f"is damaged ({error})", file=images_file.parent, fix=_AGAIN) from error
    images.sort(key=lambda image: image.name)
    root = folder / "images" if (folder / "images").is_dir() else folder
    photos = [_photo(image, cameras, root, images_file) for image in images]
    if not photos:
        raise InputError("registers no image", file=images_file, fix=_AGAIN)
    return load_photos(name, photos, folder, truth, want_truth, settings, threads)


def _model_files(folder: Path) -> tuple[Path, Path]:
    for place in _PLACES:
        for suffix in (".bin", ".txt"):
            cameras, images = folder / place / f"cameras{suffix}", folder / place / f"images{suffix}"
            if cameras.is_file() and images.is_file():
                return cameras, images
    raise InputError("holds no sparse model", file=folder, fix="put cameras and images (.bin or .txt) into sparse/0")


def _photo(image: _Image, cameras: dict[int, _Camera], root: Path, file: Path) -> Photo:
    if image.camera not in cameras:
        raise InputError(f"{image.name}: its camera {image.camera} is missing", file=file, fix=_AGAIN)
    camera = cameras[image.camera]
    intrinsics, distortion = _calibration(camera, file, image.name)
    check_intrinsics(intrinsics, file, image.name)
    pose = np.eye(4)
    if not np.isfinite(image.quaternion).all() or np.linalg.norm(image.quaternion) < 1e-9:
        raise InputError(f"{image.name}: the rotation is not a quaternion", file=file, fix=_AGAIN)
    rotation = rotation_matrix(image.quaternion)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ image.translation
    check_pose(pose, file, image.name)
    return Photo(root / image.name, None, intrinsics, distortion, pose, camera.size)


def _calibration(camera: _Camera, file: Path, view: str) -> tuple[Array, Array]:
    """fx, fy, cx, cy (COLMAP's pixel centres lie at integer + 0.5 too) and OpenCV's k1, k2, p1, p2, k3."""
    p, none = camera.parameters, [0.0] * 5
    if camera.model == "SIMPLE_PINHOLE":
        return np.array([p[0], p[0], p[1], p[2]]), np.array(none)
    if camera.model == "PINHOLE":
        return p[:4], np.array(none)
    if camera.model in ("SIMPLE_RADIAL", "RADIAL"):
        k2 = p[4] if camera.model == "RADIAL" else 0.0
        return np.array([p[0], p[0], p[1], p[2]]), np.array([p[3], k2, 0.0, 0.0, 0.0])
    if camera.model == "OPENCV":
        return p[:4], np.array([*p[4:8], 0.0])
    raise InputError(
        f"{view}: the camera model {camera.model} is not supported",
        file=file,
        fix="undistort the images first (COLMAP's image_undistorter)",
    )


def rotation_matrix(quaternion: Array) -> Array:
    """(3, 3) rotation of a quaternion wxyz."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _read_cameras(file: Path) -> Iterator[tuple[int, _Camera]]:
    if file.suffix == ".txt":
        for line in _lines(file):
            if line.strip():
                number, model, width, height, *rest = line.split()
                size = require_size((float(width), float(height)), file, f"camera {number}")
                yield int(number), _Camera(model, size, np.array(rest, float))
        return
    with file.open("rb") as stream:
        (count,) = struct.unpack("<Q", stream.read(8))
        for _ in range(count):
            number, model_id, width, height = struct.unpack("<iiQQ", stream.read(24))
            model, length = _MODELS[model_id]
            values = struct.unpack(f"<{length}d", stream.read(8 * length))
            yield number, _Camera(model, require_size((width, height), file, f"camera {number}"), np.array(values))


def _read_images(file: Path) -> Iterator[_Image]:
    if file.suffix == ".txt":
        for line in _lines(file)[::2]:  # every second line lists 2D points
            if not line.strip():
                continue
            fields = line.split(maxsplit=9)
            numbers = np.array(fields[1:8], float)
            yield _Image(fields[9].strip(), int(fields[8]), numbers[:4], numbers[4:])
        return
    with file.open("rb") as stream:
        (count,) = struct.unpack("<Q", stream.read(8))
        for _ in range(count):
            _, *pose, camera = struct.unpack("<i7di", stream.read(64))
            name = bytearray()
            while (character := stream.read(1)) != b"\0":
                if not character:
                    raise ValueError("ends within a name")
                name += character
            (points,) = struct.unpack("<Q", stream.read(8))
            stream.seek(24 * points, 1)
            values = np.array(pose)
            yield _Image(name.decode("utf-8"), camera, values[:4], values[4:])


def _lines(file: Path) -> list[str]:
    return [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]

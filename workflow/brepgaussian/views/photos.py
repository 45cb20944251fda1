"""From a user's calibrated images to views: read, undistort, pad to one size, find the unit frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth
from brepgaussian.artifacts.views import Views
from brepgaussian.errors import InputError
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.log import get_logger, progress
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.checks import OPAQUE, check_fit, check_silhouettes
from brepgaussian.views.hull import bounding_box
from brepgaussian.views.images import check_size, find_mask, read_rgba
from brepgaussian.views.poses import cam_from_unit, cam_from_world
from brepgaussian.views.source import Loaded, chosen_views
from brepgaussian.views.truth import frame_of_box

LOG = get_logger("views")
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Photo:
    """One calibrated image of the user.

    Attributes:
        image: its file.
        mask: its mask, or None to look for one, or for an alpha channel.
        intrinsics: (4,) fx, fy, cx, cy in px, pixel centres at integer + 0.5.
        distortion: (5,) OpenCV's k1, k2, p1, p2, k3.
        camera_to_world: (4, 4), OpenCV axes.
        size: width and height that the camera was calibrated for, or None if it isn't said.
    """

    image: Path
    mask: Path | None
    intrinsics: Array
    distortion: Array
    camera_to_world: Array
    size: tuple[int, int] | None


def load_photos(
    name: str,
    photos: Sequence[Photo],
    folder: Path,
    truth: str,
    want_truth: bool,
    settings: ViewsSettings,
    threads: int,
) -> Loaded:
    """Read photos and bring them into the unit frame, estimated from the silhouettes.

    Args:
        name: the object's name.
        photos: in any world frame and unit.
        folder: where they come from, for messages and `masks/`.
        truth: a STEP file whose numbers in mm are the world frame's numbers, or empty.
        want_truth: whether the truth is asked for.
        settings: settings of the stage.
        threads: for ray casting.
    """
    chosen = [photos[i] for i in chosen_views(len(photos), settings.view_count)]
    pictures = [_read(photo, folder) for photo in progress(chosen, "reading images", len(chosen))]
    height = max(picture.shape[0] for picture in pictures)
    width = max(picture.shape[1] for picture in pictures)
    rgba = np.zeros((len(chosen), height, width, 4), np.uint8)  # smaller images are padded right and below
    for target, picture in zip(rgba, pictures, strict=True):
        target[: picture.shape[0], : picture.shape[1]] = picture
    world = Cameras(
        intrinsics=np.stack([photo.intrinsics for photo in chosen]),
        cam_from_unit=np.stack([cam_from_world(photo.camera_to_world) for photo in chosen]),
        width=width,
        height=height,
    )
    views = Views(
        object_name=name,
        names=tuple(photo.image.name for photo in chosen),
        rgb=rgba[..., :3],
        alpha=rgba[..., 3],
        cameras=world,
        world_from_unit=np.eye(4),
    )
    check_silhouettes(views, folder)
    low, high = bounding_box(views.alpha >= OPAQUE, world, views.names, folder)
    world_from_unit = np.asarray(np.linalg.inv(frame_of_box(low, high)), np.float64)
    LOG.info("bounding box from the silhouettes: %s to %s in the world frame", np.round(low, 4), np.round(high, 4))
    poses = np.stack([cam_from_unit(pose, world_from_unit) for pose in world.cam_from_unit])
    views = replace(views, cameras=replace(world, cam_from_unit=poses), world_from_unit=world_from_unit)
    return Loaded(views, _truth(views, Path(truth), settings, threads) if want_truth and truth else None)


def _read(photo: Photo, folder: Path) -> NDArray[np.uint8]:
    """One image as (H, W, 4) straight RGBA without distortion."""
    pixels = read_rgba(photo.image, photo.mask or find_mask(photo.image, folder))
    if photo.size is not None:
        check_size(pixels, *photo.size, photo.image)
    return undistort(pixels, photo.intrinsics, photo.distortion) if photo.distortion.any() else pixels


def undistort(rgba: NDArray[np.uint8], intrinsics: Array, distortion: Array) -> NDArray[np.uint8]:
    """Resample an image (H, W, 4) as a pinhole camera with the same intrinsics would see it."""
    import cv2

    fx, fy, cx, cy = intrinsics
    calibration = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])  # OpenCV counts from pixel centres
    height, width = rgba.shape[:2]
    columns, rows = cv2.initUndistortRectifyMap(
        calibration, distortion, np.eye(3), calibration, (width, height), cv2.CV_32FC1
    )
    alpha = rgba[..., 3:].astype(np.float32) / 255
    premultiplied = np.concatenate([rgba[..., :3] * alpha, alpha], axis=2).astype(np.float32)
    moved = np.clip(cv2.remap(premultiplied, columns, rows, cv2.INTER_LINEAR, borderValue=(0, 0, 0, 0)), 0, 255)
    cover = np.clip(moved[..., 3:], 0, 1)
    colour = np.where(cover > 0, moved[..., :3] / np.maximum(cover, 1e-6), 0)
    result = np.clip(np.rint(np.concatenate([colour, 255 * cover], axis=2)), 0, 255).astype(np.uint8)
    result[result[..., 3] == 0] = 0
    return result


def _truth(views: Views, file: Path, settings: ViewsSettings, threads: int) -> Truth:
    """The truth of a STEP file that shares the user's world frame."""
    from brepgaussian.views.render import face_ids
    from brepgaussian.views.step_file import read_solid
    from brepgaussian.views.truth import transformed, truth_of_solid

    unit_from_world = np.asarray(np.linalg.inv(views.world_from_unit), np.float64)
    known, mesh = truth_of_solid(transformed(read_solid(file), unit_from_world), settings)
    ids = face_ids(mesh.vertices, mesh.triangles, mesh.triangle_face, views.cameras, threads)
    check_fit(views, ids, file)
    return replace(known, face_ids=ids)


def require_size(size: tuple[float, float], file: Path, view: str) -> tuple[int, int]:
    """Width and height as whole numbers.

    Raises:
        InputError: they aren't.
    """
    width, height = round(float(size[0])), round(float(size[1]))
    if width <= 0 or height <= 0:
        raise InputError(f"{view}: the image size is {size[0]} x {size[1]}", file=file, fix="give w and h in pixels")
    return width, height

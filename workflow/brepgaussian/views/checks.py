"""Checks of a user's images and cameras, each with what is wrong and how to mend it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.errors import InputError

MINIMUM_VIEWS = 8  # below this no surface is seen by enough views
OPAQUE = 128  # of 255; silhouettes are cut here
_ORTHONORMAL_TOLERANCE = 1e-3  # of a rotation's rows; poses are published with 4 digits or more
_CUT_SHARE = 0.5  # of the views in which the object may touch the border of the image
TRUTH_IOU = 0.97  # of silhouettes; a truth that fits gives .999, one of another object or frame far less


def check_pose(pose: NDArray[np.float64], file: Path, view: str) -> None:
    """Check a camera-to-world matrix (4, 4): finite, its rotation orthonormal up to a common scale."""
    fix = "export the cameras again"
    if pose.shape not in ((4, 4), (3, 4)) or not np.isfinite(pose).all():
        raise InputError(f"{view}: the pose is not a finite 4x4 matrix", file=file, fix=fix)
    rotation = pose[:3, :3]
    determinant = float(np.linalg.det(rotation))
    if abs(determinant) < 1e-12:
        raise InputError(f"{view}: the pose is singular", file=file, fix=fix)
    if determinant < 0:
        raise InputError(
            f"{view}: the pose mirrors (determinant {determinant:.3f})", file=file, fix="use right-handed axes"
        )
    scaled = rotation / np.cbrt(determinant)
    if np.abs(scaled @ scaled.T - np.eye(3)).max() > _ORTHONORMAL_TOLERANCE:
        raise InputError(f"{view}: the pose's axes are not orthogonal", file=file, fix=fix)


def check_intrinsics(values: NDArray[np.float64], file: Path, view: str) -> None:
    """Check fx, fy, cx, cy."""
    if not np.isfinite(values).all() or (values[:2] <= 0).any():
        raise InputError(
            f"{view}: focal length or principal point is {np.round(values, 3).tolist()}",
            file=file,
            fix="give positive, finite intrinsics in pixels",
        )


def check_silhouettes(views: Views, path: str | Path) -> None:
    """Check number of views and silhouettes: present in each, mostly inside the image.

    Raises:
        InputError: fewer than 8 views, an empty or full silhouette, or an object cut off in most views.
    """
    count = len(views.names)
    if count < MINIMUM_VIEWS:
        raise InputError(f"has {count} views", file=path, fix=f"give at least {MINIMUM_VIEWS} views from all sides")
    cut = 0
    for name, alpha in zip(views.names, views.alpha, strict=True):
        inside = alpha >= OPAQUE
        if not inside.any():
            raise InputError(
                f"{name}: the silhouette is empty", file=path, fix="remove the view or mend its alpha channel or mask"
            )
        if inside.all():
            raise InputError(
                f"{name}: the silhouette fills the whole image",
                file=path,
                fix="give images whose alpha channel (or mask) is 0 outside the object",
            )
        cut += bool(inside[0].any() or inside[-1].any() or inside[:, 0].any() or inside[:, -1].any())
    if cut > _CUT_SHARE * count:
        raise InputError(
            f"the object is cut off by the image border in {cut} of {count} views",
            file=path,
            fix="move the cameras back or use wider images, so that the whole object is seen",
        )


def check_fit(views: Views, face_ids: NDArray[np.int16], file: Path) -> float:
    """Check that a truth, seen as (V, H, W) `face_ids`, covers the silhouettes; gives their IoU.

    Raises:
        InputError: it does not: another object, frame or unit.
    """
    covered, seen = views.alpha >= OPAQUE, face_ids >= 0
    iou = float((covered & seen).sum() / max(1, (covered | seen).sum()))
    if iou < TRUTH_IOU:
        raise InputError(
            f"does not fit the silhouettes (IoU {iou:.3f})",
            file=file,
            fix="give the truth of this very object, in the world frame and unit of the cameras",
        )
    return iou

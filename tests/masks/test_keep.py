"""Regions that the geometry does not know: a disc inside a square face, drawn by hand."""

import numpy as np
import pytest
from brepgaussian.masks.keep import components, kept_regions
from brepgaussian.masks.repair import repair
from scipy import ndimage

SIDE, CENTRE, RADIUS = 90, 45, 16
Y, X = np.mgrid[:SIDE, :SIDE]
DISC = (X - CENTRE) ** 2 + (Y - CENTRE) ** 2 <= RADIUS**2


def scene(step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One patch, the disc and its surroundings as detected, and a ridge of the step's height between them."""
    patches = np.ones((SIDE, SIDE), np.int16)
    edge = ndimage.binary_dilation(DISC) & ~ndimage.binary_erosion(DISC)
    return patches, np.where(DISC, 7, 3).astype(np.int16), np.where(edge, step, 0.0).astype(np.float32)


@pytest.mark.parametrize(("step", "noise", "kept"), [(20, 0.3, True), (4, 0.3, False), (20, 6, False)])
def test_a_clearly_bounded_region_keeps_an_id_of_its_own(step, noise, kept):
    result = kept_regions(*scene(step), noise, first=50)
    assert np.array_equal(result, np.where(DISC & kept, 50, 1))


def test_thin_regions_and_those_of_two_patches_follow_the_patches():
    patches, detected, ridge = scene(20)
    strip = np.where(np.abs(X - 20) <= 2, 7, 3)  # a border that is misplaced by a few pixels
    found = kept_regions(patches, strip, np.full_like(ridge, 20), 0.3, 50)
    assert (found[:, 18:] == 1).all()
    assert (found[:, :18] == 50).all()  # what the strip cuts off is wide
    halves = np.where(X < CENTRE, 1, 2).astype(np.int16)
    assert np.array_equal(kept_regions(halves, detected, ridge, 0.3, 50), halves)


def test_most_of_a_patch_is_the_patch():
    patches = np.where(DISC, 2, 1).astype(np.int16)
    detected = np.where(ndimage.binary_erosion(DISC), 7, 3)
    assert np.array_equal(kept_regions(patches, detected, np.full((SIDE, SIDE), 20.0, np.float32), 0.3, 50), patches)


def test_components_of_equal_label():
    labels = np.array([[1, 1, 0, 1], [0, 2, 2, 1]])
    part, count = components(labels)
    assert count == 3
    assert np.array_equal(part > 0, labels > 0)
    assert part[0, 0] == part[0, 1] != part[0, 3] == part[1, 3]


def test_a_face_without_samples_is_kept_in_each_view_under_another_id(box, box_samples):
    views, ids = box
    xyz, normals, label = box_samples
    merged = np.where(label == 5, 3, label)  # the samples take the top for the face beside it
    patches = repair(views, xyz, normals, merged, detected=(ids + 1).astype(np.int16))
    both = [view for view, i in enumerate(ids) if (i == 5).any() and (i == 3).any()]
    own = [int(patches[view][(ids[view] == 5) | (ids[view] == 3)].max()) for view in both]
    assert own
    assert len(set(own)) == len(own)
    assert min(own) > merged.max() + 1
    found = [set(view[view > merged.max() + 1].tolist()) for view in patches]
    assert sum(map(len, found)) == len(set().union(*found))

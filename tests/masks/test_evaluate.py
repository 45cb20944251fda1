import numpy as np
import pytest
from brepgaussian.masks.edges import region_edges
from brepgaussian.masks.evaluate import EdgeScore, score_edges, score_regions, true_regions


@pytest.fixture
def faces():
    ids = np.full((60, 80), -1, int)
    ids[10:50, 10:40] = 0
    ids[10:50, 40:70] = 1
    return ids


def test_perfect_masks(faces):
    score = score_regions(faces + 1, faces)
    assert (score.f_50, score.f_75, score.over, score.under) == (1, 1, 0, 0)
    edges = region_edges(faces + 1, 3)
    assert score_edges(edges, faces).f == 1
    assert score_edges(edges, faces, interior=True).f == 1


def test_joined_faces_are_under_segmented(faces):
    score = score_regions((faces >= 0).astype(int), faces)
    assert (score.hits_50, score.found, score.wanted, score.joined) == (0, 1, 2, 1)
    assert score.under == 1
    interior = score_edges(region_edges(faces >= 0, 1), faces, interior=True)
    assert (interior.recall, interior.found) == (0, 0)


def test_split_face_is_over_segmented(faces):
    patches = faces + 1
    patches[30:50, 10:40] = 7
    score = score_regions(patches, faces)
    assert score.hits_50 == 1  # halves have an IoU of exactly one half, which is no hit
    assert score.over == 0.5
    assert score.f_50 == pytest.approx(2 / 5)


def test_iou_thresholds(faces):
    patches = faces + 1
    patches[:, 40:49] = np.where(patches[:, 40:49] > 0, 1, 0)  # face 1 keeps 70 %
    score = score_regions(patches, faces)
    assert (score.hits_50, score.hits_75) == (2, 1)


def test_slivers_count_neither_way(faces):
    faces[10:50, 39] = 2  # 40 px
    score = score_regions(faces + 1, faces)
    assert (score.found, score.wanted) == (2, 2)


def test_parts_of_one_face_are_regions_of_their_own(faces):
    faces[faces == 1] = 0
    faces[:, 38:42] = -1
    assert true_regions(faces).max() == 2


def test_tolerance_is_three_pixels(faces):
    near, far = np.zeros((2, 60, 80), np.uint8)
    near[14:46, 42] = 255
    far[14:46, 44] = 255
    assert score_edges(near, faces, interior=True).precision == 1
    assert score_edges(far, faces, interior=True).precision == 0


def test_views_are_pooled():
    total = EdgeScore(1, 2, 3, 4) + EdgeScore(1, 2, 1, 4)
    assert (total.precision, total.recall) == (0.5, 0.5)

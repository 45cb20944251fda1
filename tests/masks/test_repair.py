import numpy as np
import pytest
from brepgaussian.errors import StageError
from brepgaussian.masks.benchmark import add_noise
from brepgaussian.masks.evaluate import RegionScore, score_regions
from brepgaussian.masks.repair import eroded_markers, prepare, projected_labels, repair


@pytest.mark.parametrize("noise", ["clean", "sigma5", "jpeg85"])
def test_box_has_the_same_ids_in_all_views(box, box_samples, noise):
    views, ids = box
    patches = repair(add_noise(views, noise, 8), *box_samples)
    assert (patches == ids + 1).mean() > 0.995
    score = sum((score_regions(p, i) for p, i in zip(patches, ids, strict=True)), RegionScore())
    assert score.f_75 == 1


def test_borders_without_a_luminance_step_stay_where_the_samples_put_them(box, box_samples):
    views, ids = box
    flat = np.where(views.alpha[..., None] > 0, 128, 0).astype(np.uint8).repeat(3, -1)
    import dataclasses

    patches = repair(dataclasses.replace(views, rgb=flat), *box_samples)
    assert (patches == ids + 1).mean() > 0.98


def test_two_threads_give_the_same(box, box_samples):
    assert np.array_equal(repair(box[0], *box_samples, threads=1), repair(box[0], *box_samples, threads=2))


def test_unlabelled_samples_mark_nothing(box, box_samples):
    xyz, normals, label = box_samples
    patches = repair(box[0], xyz, normals, np.where(label == 5, -1, label))
    assert not (patches == 6).any()
    with pytest.raises(StageError, match="no surface sample"):
        repair(box[0], xyz, normals, np.full(len(xyz), -1))


def test_thin_regions_keep_a_marker():
    raw = np.ones((40, 60), np.int32)
    raw[:, 25:28] = 2
    raw[:, 28:] = 3
    markers, _ = eroded_markers(raw, 6.0)
    assert set(np.unique(markers)) == {0, 1, 2, 3}
    assert (markers[raw == 2] == 2).any()
    assert (markers[:, 20:25] == 0).all()  # wide regions keep their distance


def test_spacing_of_uniform_samples():
    rng = np.random.default_rng(1)
    xyz = np.column_stack([rng.random((4000, 2)), np.zeros(4000)])
    samples = prepare(xyz, np.tile([0, 0, 1.0], (4000, 1)), np.zeros(4000, np.int64))
    assert samples.spacing == pytest.approx(4000**-0.5, rel=0.1)


def test_votes_stay_within_an_edge_bounded_cell():
    cells = np.ones((20, 20), np.int32)
    cells[8:12, 8:12] = 2
    inside = np.ones(cells.shape, bool)
    y, x = np.mgrid[0:20:2, 0:20:2]
    pixel = np.column_stack([x.ravel() + 0.5, y.ravel() + 0.5])
    hole = cells[pixel[:, 1].astype(int), pixel[:, 0].astype(int)] == 2
    label = np.where(hole, 4, 1)
    raw = projected_labels(pixel, label, inside, cells)
    assert np.array_equal(raw == 5, cells == 2)

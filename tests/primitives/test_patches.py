"""Islands, strays and noise of labelled points."""

import numpy as np
from brepgaussian.artifacts.points import Points
from brepgaussian.geometry.surfaces import plane
from brepgaussian.primitives.patches import Patch, contacts, islands, make_cloud, owners, trimmed_rms, without_strays


def grid(x, y, count, rng, z=0.0):
    return np.column_stack([rng.uniform(x, x + 0.1, count), rng.uniform(y, y + 0.1, count), np.full(count, z)])


def cloud_of(xyz, label):
    normals = np.tile([0.0, 0, 1], (len(xyz), 1))
    empty = np.zeros(len(xyz))
    return make_cloud(
        Points(
            xyz.astype(np.float32), normals.astype(np.float32), empty.astype(np.float32),
            np.asarray(label, np.int32), np.full(len(xyz), -1, np.int32),
        ),
        10,
    )  # fmt: skip


def test_islands_are_the_connected_pieces():
    rng = np.random.default_rng(0)
    xyz = np.concatenate([grid(0, 0, 300, rng), grid(0.5, 0, 200, rng), grid(0, 0.5, 100, rng)])
    cloud = cloud_of(xyz, np.zeros(600))
    pieces = islands(cloud, np.arange(600))
    assert [len(p) for p in pieces] == [300, 200, 100]
    assert set(pieces[1]) == set(range(300, 500))


def test_strays_are_dropped_but_real_pieces_stay():
    rng = np.random.default_rng(1)
    xyz = np.concatenate([grid(0, 0, 400, rng), grid(0.5, 0, 200, rng), grid(0.05, 0.05, 6, rng, 0.7)])
    other = grid(0.05, 0.05, 300, rng, 0.7)
    cloud = cloud_of(np.concatenate([xyz, other]), np.r_[np.zeros(606), np.ones(300)])
    kept = np.concatenate(without_strays(cloud, np.flatnonzero(cloud.label == 0)))
    assert set(kept) == set(range(600))


def test_a_label_of_few_points_keeps_its_largest_piece():
    cloud = cloud_of(np.random.default_rng(2).uniform(0, 1, (7, 3)), np.zeros(7))
    assert len(without_strays(cloud, np.arange(7))) == 1


def test_trimmed_rms_is_sigma_despite_outliers():
    rng = np.random.default_rng(3)
    values = np.abs(0.004 * rng.normal(size=20000))
    assert abs(trimmed_rms(values) - 0.004) < 1e-4
    values[:600] = 1.0
    assert trimmed_rms(values) < 0.0046


def test_contacts_count_pairs_of_touching_patches():
    rng = np.random.default_rng(4)
    xyz = np.concatenate([grid(0, 0, 300, rng), grid(0.1, 0, 300, rng), grid(0.6, 0, 300, rng)])
    cloud = cloud_of(xyz, np.repeat([0, 1, 2], 300))
    surface = plane(np.zeros(3), [0.0, 0, 1])
    patches = [Patch((i,), np.arange(300 * i, 300 * (i + 1)), surface, 0.0, 0.0) for i in range(3)]
    table = contacts(cloud, owners(patches, 900), 3)
    assert (table == table.T).all()
    assert table[0, 1] > 20
    assert table[0, 2] == table[1, 2] == 0

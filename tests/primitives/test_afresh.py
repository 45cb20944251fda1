"""Badly reconstructed regions: few surfaces along the design's directions instead of pieces of many kinds."""

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.primitives.afresh import alternatives
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.primitives import PrimitivesSettings

SETTINGS = PrimitivesSettings()
SIGMA, BULGE = 0.0008, 0.004  # of good faces, and how far the bad face's middle lies off


def reconstructed(truth, bad, pieces, rng):
    """Points of a truth; one face bulges (its normals with it) and comes in pieces, each with a label of its own."""
    xyz = truth.points + SIGMA * rng.normal(size=truth.points.shape)
    normals = truth.normals + 0.02 * rng.normal(size=truth.normals.shape)
    label = truth.point_face.astype(np.int64).copy()
    on = np.flatnonzero(label == bad)
    offset = truth.points[on] - truth.points[on].mean(axis=0)
    long, wide = np.linalg.eigh(np.cov(offset.T))[1].T[:0:-1]
    around = np.arctan2(offset @ wide, offset @ long)
    waves = np.sin(3 * around + 40 * np.linalg.norm(offset, axis=1))
    xyz[on] += BULGE * (1 + waves)[:, None] / 2 * truth.normals[on]
    normals[on] += 0.2 * np.cos(3 * around)[:, None] * long
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    piece = np.floor((around / np.pi + 1) / 2 * pieces).astype(int).clip(0, pieces - 1)
    label[on] = np.where(piece == 0, bad, label.max() + piece)
    none, curve = np.zeros(len(label), np.float32), np.full(len(label), -1, np.int32)
    return Points(xyz.astype(np.float32), normals.astype(np.float32), none, label.astype(np.int32), curve)


def kinds_on(primitives, truth, face):
    """Kinds of the primitives most of whose support lies on one true face."""
    return [p.surface.kind for p in primitives.items if np.mean(truth.point_face[p.support] == face) > 0.5]


@pytest.mark.parametrize(("name", "bad"), [("stepped_shaft", 0), ("stepped_shaft", 5), ("pillow_block", 0)])
def test_a_bulging_plane_in_pieces_becomes_one(truth_maker, name, bad):
    truth = truth_maker(name)
    points = reconstructed(truth, bad, 5, np.random.default_rng(3))
    primitives = primitives_of(points, SETTINGS)
    assert len(kinds_on(primitives, truth, bad)) > 1
    first = next(iter(alternatives(points, primitives, SETTINGS)))
    for face, kind in enumerate(truth.face_types):
        found = kinds_on(first, truth, face)
        assert found in ([kind], [])  # [] where a face shares its surface with a larger one
    assert kinds_on(first, truth, bad) == ["plane"]


def test_a_bulging_groove_is_among_the_alternatives(truth_maker):
    truth = truth_maker("ring_groove")
    points = reconstructed(truth, 1, 5, np.random.default_rng(3))
    found = alternatives(points, primitives_of(points, SETTINGS), SETTINGS)
    assert ["torus"] in [kinds_on(a, truth, 1) for a in found]


def test_nothing_is_explained_afresh_where_all_patches_are_sure(truth_maker, point_maker):
    points = point_maker(truth_maker("block_hole"), 0.002, 0.0, np.random.default_rng(1))
    primitives = primitives_of(points, SETTINGS)
    assert list(alternatives(points, primitives, SETTINGS)) == []

"""Badly reconstructed regions: few surfaces along the design's directions instead of pieces of many kinds."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.primitives.afresh import alternatives
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.primitives import PrimitivesSettings

SETTINGS = PrimitivesSettings()
SIGMA, BULGE = 0.0008, 0.004  # of good faces, and how far the bad face's middle lies off


def reconstructed(truth, bad, pieces, rng, sigma=SIGMA, turn=0.02):
    """Points of a truth; one face bulges (its normals with it) and comes in pieces, each with a label of its own."""
    xyz = truth.points + sigma * rng.normal(size=truth.points.shape)
    normals = truth.normals + turn * rng.normal(size=truth.normals.shape)
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


@pytest.mark.parametrize(("name", "bad"), [("stepped_shaft", 5), ("pillow_block", 0)])
def test_a_bulging_plane_in_pieces_that_are_planes_is_one_at_once(truth_maker, name, bad):
    truth = truth_maker(name)
    points = reconstructed(truth, bad, 5, np.random.default_rng(3))
    assert kinds_on(primitives_of(points, SETTINGS), truth, bad) == ["plane"]


@pytest.mark.parametrize(("name", "bad"), [("stepped_shaft", 0)])
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


def test_points_without_any_noise_have_believable_noise(truth_maker):
    """All faces but one are exact, so that the median of the normals' noise is nought."""
    truth = truth_maker("l_bracket")
    points = reconstructed(truth, 0, 9, np.random.default_rng(3), sigma=0.0, turn=0.0)
    along = np.abs(truth.normals) > 1 - 1e-6  # faces along the frame's axes: exact in float32, too
    points = replace(points, normals=np.where(along, np.round(points.normals), points.normals))
    primitives = primitives_of(points, SETTINGS)
    exact = [replace(p, surface=replace(p.surface, axis=np.round(p.surface.axis, 3))) for p in primitives.items]
    first = next(iter(alternatives(points, replace(primitives, items=tuple(exact)), SETTINGS)))
    assert kinds_on(first, truth, 0) == ["plane"]


def test_nothing_is_explained_afresh_where_all_patches_are_sure(truth_maker, point_maker):
    points = point_maker(truth_maker("block_hole"), 0.002, 0.0, np.random.default_rng(1))
    primitives = primitives_of(points, SETTINGS)
    assert list(alternatives(points, primitives, SETTINGS)) == []


def test_walls_of_a_keyway_that_bulge_like_cylinders_are_planes_in_an_alternative():
    """A bore with a keyway: its three walls bulge, the corners are rounded, labels mix them."""
    rng = np.random.default_rng(5)
    bore, half, floor = 0.2, 0.05, 0.25

    def wall(count, start, end, bulge):
        """Points between two corners (x, y), normals to the left, its ends bent into the air."""
        t, z = rng.uniform(0, 1, (count, 1)), rng.uniform(-0.25, 0.25, count)
        length = np.linalg.norm(np.subtract(end, start))
        along = np.subtract(end, start) / length
        left = np.array([-along[1], along[0]])
        xy = start + t * length * along + bulge * (1 - 4 * t * (1 - t)) * left
        normal = left - 4 * bulge / length * (2 * t - 1) * along
        return np.column_stack([xy, z]), np.column_stack([normal, np.zeros(count)])

    edge = np.sqrt(bore**2 - half**2)
    parts = [
        wall(600, (floor, -half), (floor, half), 0.005),
        wall(250, (edge, -half), (floor, -half), 0.002),
        wall(250, (floor, half), (edge, half), 0.002),
    ]
    turn = rng.uniform(np.arcsin(half / bore), 2 * np.pi - np.arcsin(half / bore), 6000)
    round_ = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(6000)])
    parts.append((bore * round_ + [0, 0, 1] * rng.uniform(-0.25, 0.25, (6000, 1)), -round_))
    for side in (-1, 1):
        disc = rng.uniform(-0.5, 0.5, (20000, 2))
        disc = disc[(np.linalg.norm(disc, axis=1) > 0.3)]
        parts.append((np.column_stack([disc, np.full(len(disc), 0.25 * side)]), np.tile([0, 0, side], (len(disc), 1))))
    xyz = np.concatenate([p for p, _ in parts]) + 0.5
    xyz += SIGMA * rng.normal(size=xyz.shape)
    normals = np.concatenate([n for _, n in parts]) + 0.03 * rng.normal(size=xyz.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    label = np.repeat(np.arange(len(parts)), [len(p) for p, _ in parts])
    none, curve = np.zeros(len(label), np.float32), np.full(len(label), -1, np.int32)
    points = Points(xyz.astype(np.float32), normals.astype(np.float32), none, label.astype(np.int32), curve)
    primitives = primitives_of(points, SETTINGS)
    upright = [
        sorted(
            np.argmax(np.bincount(label[p.support]))
            for p in found.items
            if p.surface.kind == "plane" and abs(p.surface.axis[2]) < 0.1
        )
        for found in alternatives(points, primitives, SETTINGS)
    ]
    assert [0, 1, 2] in upright

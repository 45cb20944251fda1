"""Faces that a label had swallowed, against those that the nodes were made of."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.points.batchfit import Noise
from brepgaussian.points.cut import refit
from brepgaussian.points.graph import Graph, largest_connected, neighbour_pairs, spacing_of
from brepgaussian.points.merge import Nodes
from brepgaussian.points.split import _apart, planar_pieces, uncover_planes, uncover_strips
from brepgaussian.settings.points import PointsSettings

NOISE = Noise(0.002, np.radians(3.0))


def shoulder(rng, width, fillet=0.07, inner=0.2):
    """A shaft's fillet and the ring of a plane beside it, `width` wide, with noise: nodes, face of each."""
    angle = rng.uniform(0, 2 * np.pi, 6000)
    along = rng.uniform(0, np.pi / 2 * fillet + width, 6000)  # on the profile, from the shaft outwards
    turn = np.minimum(along / fillet, np.pi / 2)
    radius = inner + fillet * (1 - np.cos(turn)) + np.maximum(along - fillet * np.pi / 2, 0)
    height = fillet * (1 - np.sin(turn))
    kept = rng.random(6000) < radius / radius.max()
    angle, turn, radius, height = (v[kept][:1500] for v in (angle, turn, radius, height))
    across = np.column_stack([np.cos(angle), np.sin(angle)])
    xyz = np.column_stack([radius[:, None] * across, height]) + rng.normal(0, 0.0007, (len(angle), 3))
    normals = np.column_stack([np.cos(turn)[:, None] * across, np.sin(turn)]) + rng.normal(0, 0.02, (len(angle), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    count = len(xyz)
    nodes = Nodes(
        xyz, normals, np.ones(count), np.ones(count, bool), np.full(count, np.nan), np.full((count, 3), np.nan)
    )
    return nodes, (turn >= np.pi / 2).astype(int)


def one_region(nodes):
    """Neighbours of which every view says that they are of one region."""
    pairs, distance = neighbour_pairs(nodes.xyz, nodes.normals, 10)
    votes = np.full(len(pairs), 8.0)
    return Graph(pairs, distance, votes, votes, np.zeros(len(pairs)))


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_a_ring_beside_a_fillet_gets_its_own_label(seed):
    nodes, face = shoulder(np.random.default_rng(seed), 0.06)
    labels, spacing = np.zeros(len(face), np.int64), spacing_of(nodes.xyz)
    found = uncover_planes(
        nodes, one_region(nodes), labels, NOISE, spacing, PointsSettings(smallest_patch=20, seed=seed)
    )
    assert found.max() == 1
    plane = np.bincount(found[face == 1]).argmax()
    assert (found[face == 1] == plane).mean() > 0.95
    assert (found[face == 0] == plane).mean() < 0.15  # where the fillet starts it is as flat
    assert refit(nodes, found, NOISE, 0).kinds[plane] == "plane"


@pytest.mark.parametrize("seed", [21, 22])
def test_a_fillet_alone_stays_whole(seed):
    nodes, face = shoulder(np.random.default_rng(seed), 0.0)
    labels = np.zeros(len(face), np.int64)
    found = uncover_planes(
        nodes, one_region(nodes), labels, NOISE, spacing_of(nodes.xyz), PointsSettings(smallest_patch=20, seed=seed)
    )
    np.testing.assert_array_equal(found, labels)


@pytest.mark.parametrize("seed", [25, 26])
def test_a_narrow_ring_gets_its_own_label_though_borders_are_near(seed):
    """A chamfer beside it, both near one torus; no node of either speaks for a patch in the views."""
    nodes, face = shoulder(np.random.default_rng(seed), 0.06)
    core = np.zeros(len(face), bool)
    core[::5] = True
    nodes, labels = replace(nodes, core=core, trust=np.where(core, 1.0, 0.05)), np.zeros(len(face), np.int64)
    settings = PointsSettings(smallest_patch=20, seed=seed)
    found = uncover_planes(nodes, one_region(nodes), labels, NOISE, spacing_of(nodes.xyz), settings)
    assert found.max() == 1
    plane = np.bincount(found[face == 1]).argmax()
    assert (found[face == 1] == plane).mean() > 0.8


def test_a_proposal_lies_on_the_plane():
    nodes, face = shoulder(np.random.default_rng(24), 0.08)
    labels, graph = np.zeros(len(face), np.int64), one_region(nodes)
    models = refit(nodes, labels, NOISE, 0)
    (piece,) = planar_pieces(nodes, graph, labels, models, NOISE, spacing_of(nodes.xyz), 20, 0)
    assert np.abs(nodes.xyz[piece, 2]).max() < 0.005
    assert face[piece].mean() > 0.8


def test_largest_connected_part():
    graph = Graph(np.array([[0, 1], [1, 2], [4, 5]]), *np.zeros((4, 3)))
    assert largest_connected(graph, np.array([0, 1, 2, 4, 5]), 6).tolist() == [0, 1, 2]
    assert largest_connected(graph, np.array([0, 2, 4, 5]), 6).tolist() == [4, 5]


def sheet_end(rng, thickness, end):
    """Top, bottom and, `end` or not, the narrow face at the end of a sheet, with noise: nodes, face of each."""
    count = 1400
    x, y = rng.uniform(0, 0.3, count), rng.uniform(0, 0.3, count)
    face = rng.integers(0, 2, count)
    xyz = np.column_stack([x, y, face * thickness])
    normals = np.column_stack([np.zeros((count, 2)), 2.0 * face - 1])
    if end:
        few = int(count * thickness / 0.6)
        xyz = np.concatenate([xyz, np.column_stack([np.zeros(few), y[:few], rng.uniform(0, thickness, few)])])
        normals = np.concatenate([normals, np.tile([-1.0, 0, 0], (few, 1))])
        face = np.concatenate([face, np.full(few, 2)])
    xyz, normals = xyz + rng.normal(0, 0.0007, xyz.shape), normals + rng.normal(0, 0.02, xyz.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    trust = np.where(face == 2, 0.05, 1.0)  # a border is near in every view
    grey, slopes = np.full(len(xyz), np.nan), np.full((len(xyz), 3), np.nan)
    return Nodes(xyz, normals, trust, face < 2, grey, slopes), face


@pytest.mark.parametrize("seed", [31, 32, 33])
@pytest.mark.parametrize("thickness", [0.036, 0.045])
def test_the_end_of_a_sheet_gets_its_own_label(seed, thickness):
    nodes, face = sheet_end(np.random.default_rng(seed), thickness, True)
    labels, spacing = np.where(face == 2, 0, face), spacing_of(nodes.xyz)
    found = uncover_strips(nodes, one_region(nodes), labels, NOISE, spacing, PointsSettings(seed=seed))
    assert found.max() == 2
    strip = np.bincount(found[face == 2]).argmax()
    clear = np.abs(nodes.xyz[:, 2] - thickness / 2) < thickness / 2 - 3 * NOISE.distance
    assert (found[(face == 2) & clear] == strip).mean() > 0.7  # those beside an edge may be its neighbours'
    assert (found[face != 2] == strip).mean() < 0.05


def test_faces_without_a_strip_stay_as_they_are():
    nodes, face = sheet_end(np.random.default_rng(34), 0.03, False)
    found = uncover_strips(nodes, one_region(nodes), face, NOISE, spacing_of(nodes.xyz), PointsSettings())
    np.testing.assert_array_equal(found, face)


def test_two_faces_of_one_surface_stay_apart_and_a_swallowed_one_is_gone():
    """A wall parts a floor: no node knows on which half of it that is, so a cut gives both one label."""
    path = np.array([[0, 1], [1, 2], [3, 4], [4, 5]])
    halves = np.array([0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(_apart(Graph(path, *np.zeros((4, 4))), halves, np.zeros(6, np.int64)), halves)
    joined = Graph(np.concatenate([path, [[2, 3]]]), *np.zeros((4, 5)))
    np.testing.assert_array_equal(_apart(joined, halves, np.zeros(6, np.int64)), np.zeros(6, np.int64))


def test_a_strip_beside_a_parted_floor_gets_its_own_label():
    nodes, face = sheet_end(np.random.default_rng(35), 0.045, True)
    floor = face == 0

    def twice(values, moved=0.0):
        return np.concatenate([values, values[floor] + moved])

    both = Nodes(
        twice(nodes.xyz, np.array([0.34, 0, 0])), twice(nodes.normals), twice(nodes.trust),
        np.concatenate([nodes.core, nodes.core[floor]]), twice(nodes.grey), twice(nodes.gradients),
    )  # fmt: skip
    labels = np.concatenate([np.where(face == 2, 0, face), np.full(floor.sum(), 2)])
    found = uncover_strips(both, one_region(both), labels, NOISE, spacing_of(both.xyz), PointsSettings())
    assert found.max() == 3

"""Planes that a curved label had swallowed, against the faces that the nodes were made of."""

import numpy as np
import pytest
from brepgaussian.points.batchfit import Noise
from brepgaussian.points.cut import refit
from brepgaussian.points.graph import Graph, largest_connected, neighbour_pairs, spacing_of
from brepgaussian.points.merge import Nodes
from brepgaussian.points.split import planar_pieces, uncover_planes
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

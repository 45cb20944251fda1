"""Parts that no primitive explains are joined where the images show one region, unless they plainly are two faces.

Narrow bores, around which no two normals are alike, are parts if stage 1 has told their walls.
"""

import numpy as np
import pytest
from brepgaussian.points import labels, merge
from brepgaussian.points.batchfit import Noise
from brepgaussian.points.graph import Graph, neighbour_pairs
from brepgaussian.points.merge import Merger, Nodes
from brepgaussian.settings.points import PointsSettings
from scipy.spatial import cKDTree

NOISE = Noise(0.0015, np.radians(2.5))
JAGGED, TURNED = 0.004, np.radians(11)  # errors that no primitive explains to within the noise


def jagged(xyz, normals, rng):
    """Nodes with errors far beyond the noise, and a graph whose borders the images do not show."""
    normals = normals + TURNED * rng.normal(size=normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    count = len(xyz)
    unknown = np.full((count, 3), np.nan)
    nodes = Nodes(xyz + JAGGED * rng.normal(size=xyz.shape), normals, np.ones(count), np.ones(count, bool),
                  np.full(count, np.nan), unknown)  # fmt: skip
    pairs = cKDTree(xyz).query_pairs(0.013, output_type="ndarray")
    seen, zero = np.full(len(pairs), 8.0), np.zeros(len(pairs))
    return nodes, Graph(pairs, np.linalg.norm(np.diff(xyz[pairs], axis=1)[:, 0], axis=1), seen, seen, zero)


def wall(turn, middle, half, high=0.05, spacing=0.01):
    """A flat wall that faces a direction in the xy plane."""
    u, v = np.meshgrid(np.arange(-half, half, spacing), np.arange(0, high, spacing), indexing="ij")
    normal = np.array([np.cos(turn), np.sin(turn), 0])
    along = np.array([-normal[1], normal[0], 0])
    xyz = middle * normal + u.reshape(-1, 1) * along + v.reshape(-1, 1) * [0, 0, 1]
    return xyz, np.tile(-normal, (len(xyz), 1))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_walls_of_a_slot_stay_apart(seed):
    parts = [wall(k * np.pi / 2, (0.12, 0.05)[k % 2], (0.05, 0.12)[k % 2]) for k in range(4)]
    xyz, normals = (np.concatenate([part[k] for part in parts]) for k in range(2))
    labels = np.repeat(np.arange(4), [len(part[0]) for part in parts])
    nodes, graph = jagged(xyz, normals, np.random.default_rng(seed))
    found = Merger(nodes, graph, labels, NOISE, seed).run()
    assert len({tuple(np.unique(found[labels == k])) for k in range(4)}) == 4


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_strips_of_a_jagged_bore_become_one(seed):
    angle, high = np.meshgrid(np.linspace(0, 2 * np.pi, 28, endpoint=False), np.arange(0, 0.06, 0.01), indexing="ij")
    normals = np.column_stack([-np.cos(angle.ravel()), -np.sin(angle.ravel()), np.zeros(angle.size)])
    xyz = -0.045 * normals + high.reshape(-1, 1) * [0, 0, 1]
    labels = (angle.ravel() // (np.pi / 2 + 1e-9)).astype(np.int64)
    nodes, graph = jagged(xyz, normals, np.random.default_rng(seed))
    assert min(Merger(nodes, graph, labels, NOISE, seed).own.values()) > merge.UNEXPLAINED
    assert len(np.unique(Merger(nodes, graph, labels, NOISE, seed).run())) == 1


@pytest.mark.parametrize("told", [True, False])
def test_a_bore_of_few_nodes_is_a_part_where_stage_1_has_told_its_wall(told):
    """Two dozen nodes, 36 degrees from each to the next one around, among those of the plate."""
    angle, high = np.meshgrid(np.linspace(0, 2 * np.pi, 10, endpoint=False), [-0.02, -0.05], indexing="ij")
    around = np.column_stack([np.cos(angle.ravel()), np.sin(angle.ravel()), np.zeros(angle.size)])
    bore = 0.04 * around + high.reshape(-1, 1) * [0, 0, 1]
    u, v = np.meshgrid(np.arange(-0.4, 0.4, 0.025), np.arange(-0.4, 0.4, 0.025), indexing="ij")
    plane = np.column_stack([u.ravel(), v.ravel(), np.zeros(u.size)])
    plane = plane[np.hypot(*plane[:, :2].T) > 0.045]
    xyz, normals = np.concatenate([bore, plane]), np.concatenate([-around, np.tile([0, 0, 1.0], (len(plane), 1))])
    count, on_bore = len(xyz), np.arange(len(xyz)) < len(bore)
    nodes = Nodes(
        xyz, normals, np.ones(count), np.ones(count, bool), np.full(count, np.nan), np.full((count, 3), np.nan),
        np.where(on_bore, 7, -1) if told else None,
    )  # fmt: skip
    pairs, distance = neighbour_pairs(xyz, normals, 16)
    within = on_bore[pairs[:, 0]] == on_bore[pairs[:, 1]]
    graph = Graph(pairs, distance, np.where(within, 6.0, 0.0), np.full(len(pairs), 8.0), np.zeros(len(pairs)))
    found = labels.label_nodes(nodes, graph, 0.025, PointsSettings()).labels
    own = np.bincount(found[on_bore]).argmax()
    alone = (found[on_bore] == own).mean() > 0.9 and not (found[~on_bore] == own).any()
    assert alone == told

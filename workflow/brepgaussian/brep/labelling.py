"""Which cells are inside: a minimum cut over all evidence."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow

from brepgaussian.brep.cells import OUTSIDE, Arrangement
from brepgaussian.brep.evidence import Evidence

Array = NDArray[np.float64]

_SCALE = 1e6  # capacities are whole numbers: a millionth of the unit square is below every face
_LARGEST = 2**29  # and fit into 32 bits, sums of two included


@dataclass(frozen=True)
class Weights:
    """How the kinds of evidence weigh against each other (points' votes have weight 1).

    Attributes:
        unsupported: cost of a chosen facet's area that no point covers.
        smooth: cost of any chosen facet's area: prefers the simpler of equal explanations.
        free: length by which the volume that a camera sees through is divided to become an area.
        filled: the same for volume within all silhouettes, as weak evidence for material.
    """

    unsupported: float = 1.0
    smooth: float = 0.02
    free: float = 0.02
    filled: float = 1.0


def label(arrangement: Arrangement, evidence: Evidence, weights: Weights) -> NDArray[np.bool_]:
    """(C,) whether each cell is inside, by minimum cut between material (source) and air (sink)."""
    cells = arrangement.cells
    source, sink = cells, cells + 1
    inside_cost, outside_cost = np.zeros(cells + 2), np.zeros(cells + 2)
    front = np.where(arrangement.front == OUTSIDE, sink, arrangement.front)
    back = np.where(arrangement.back == OUTSIDE, sink, arrangement.back)
    # a facet whose normal points out: the cell before it is air, the cell behind it is material
    for votes, air, material in (
        (np.maximum(evidence.outward, 0), front, back),
        (np.maximum(-evidence.outward, 0), back, front),
    ):
        np.add.at(inside_cost, air, votes)
        np.add.at(outside_cost, material, votes)
    inside_cost[:cells] += evidence.free / weights.free
    outside_cost[:cells] += weights.filled * (evidence.volume - evidence.free)
    bare = arrangement.area * (weights.unsupported * (1 - evidence.coverage) + weights.smooth)
    return _cut(front, back, bare, inside_cost[:cells], outside_cost[:cells], source, sink)


def one_body(arrangement: Arrangement, inside: NDArray[np.bool_], volume: Array, small: float) -> NDArray[np.bool_]:
    """Keep the largest connected body and fill hollows below `small` times its volume.

    Bodies that touch the largest in an edge or a corner only would make it non-manifold.
    """
    front = np.where(arrangement.front == OUTSIDE, arrangement.cells, arrangement.front)
    back = np.where(arrangement.back == OUTSIDE, arrangement.cells, arrangement.back)
    state, volumes = np.append(inside, False), np.append(volume, np.inf)
    same = state[front] == state[back]
    size = arrangement.cells + 1
    graph = coo_matrix((np.ones(same.sum()), (front[same], back[same])), shape=(size, size))
    _, body = connected_components(graph, directed=False)
    total = np.bincount(body, volumes)
    bodies = np.unique(body[:-1][inside])
    if not len(bodies):
        return inside
    largest = bodies[np.argmax(total[bodies])]
    hollow = ~inside & (total[body[:-1]] < small * total[largest])
    return (body[:-1] == largest) | hollow


def _cut(
    front: NDArray[np.int64],
    back: NDArray[np.int64],
    pair: Array,
    inside_cost: Array,
    outside_cost: Array,
    source: int,
    sink: int,
) -> NDArray[np.bool_]:
    """Source side of the minimum cut: leaving the source costs `outside_cost`, staying costs `inside_cost`."""
    cells = np.arange(len(inside_cost))
    real = front != back
    rows = np.concatenate([front[real], back[real], np.full(len(cells), source), cells])
    columns = np.concatenate([back[real], front[real], cells, np.full(len(cells), sink)])
    values = np.concatenate([pair[real], pair[real], outside_cost, inside_cost])
    scaled = np.minimum(np.round(values * _SCALE), _LARGEST).astype(np.int64)
    size = len(cells) + 2
    graph = coo_matrix((scaled, (rows, columns)), shape=(size, size)).tocsr()
    graph.data = np.minimum(graph.data, _LARGEST)
    graph = graph.astype(np.int32)
    flow = maximum_flow(graph, source, sink).flow
    residual = (graph - flow).tocsr()
    residual.data = np.where(residual.data > 0, residual.data, 0)
    residual.eliminate_zeros()
    reached = breadth_first_order(residual, source, return_predecessors=False)
    inside = np.zeros(size, bool)
    inside[reached] = True
    return inside[: len(cells)]

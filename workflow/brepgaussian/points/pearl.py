"""Labels and primitives in turns: graph cut by alpha-expansion, refit, drop (PEARL, Isack and Boykov, IJCV 2012)."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from brepgaussian.points.graph import Index

Array = NDArray[np.float64]
_SCALE = 1000  # capacities are integers: thousandths of a unit of cost
_FAR = 1e6  # cost of a label that a node cannot take


def energy(data: Array, pairs: Index, weights: Array, labels: Index) -> float:
    """Sum of the nodes' costs and of the weights of cut pairs."""
    cut = labels[pairs[:, 0]] != labels[pairs[:, 1]]
    return float(data[np.arange(len(labels)), labels].sum() + weights[cut].sum())


def expand(data: Array, pairs: Index, weights: Array, labels: Index, alpha: int, reach: float) -> Index:
    """The best move in which any node may change its label to alpha (Boykov, Veksler, Zabih, 2001).

    Only nodes for which alpha costs at most `reach` more than their label take part; the others keep theirs.
    """
    count = len(labels)
    now = data[np.arange(count), labels]
    free = (labels != alpha) & (data[:, alpha] - now < reach) & (data[:, alpha] < _FAR)
    if not free.any():
        return labels
    local = np.full(count, -1)
    members = np.flatnonzero(free)
    local[members] = np.arange(len(members))
    stay, move = now[members].copy(), data[members, alpha].copy()
    i, j = pairs.T
    inner = free[i] & free[j]
    for one, other in ((i, j), (j, i)):  # pairs with one free end
        rim = free[one] & ~free[other]
        node, fixed, w = local[one[rim]], labels[other[rim]], weights[rim]
        np.add.at(stay, node, w * (labels[one[rim]] != fixed))
        np.add.at(move, node, w * (fixed != alpha))
    a, b, w = local[i[inner]], local[j[inner]], weights[inner]
    # E00 = w [fa != fb], E01 = E10 = w, E11 = 0; written as unary terms and one directed edge
    both_stay = w * (labels[i[inner]] != labels[j[inner]])
    np.add.at(stay, a, both_stay)
    np.add.at(move, a, w)
    np.add.at(move, b, -w)
    capacity = 2 * w - both_stay
    base = np.minimum(stay, move)
    stay, move = stay - base, move - base
    n = len(members)
    source, sink = n, n + 1
    # source side = stay; cutting source->i pays `move`, cutting i->sink pays `stay`
    rows = np.concatenate([np.full(n, source), np.arange(n), a, b])
    columns = np.concatenate([np.arange(n), np.full(n, sink), b, a])
    values = np.concatenate([move, stay, capacity, np.zeros_like(capacity)])
    whole = np.round(values * _SCALE).astype(np.int32)
    network = coo_matrix((whole, (rows, columns)), shape=(n + 2, n + 2)).tocsr()
    flow = maximum_flow(network, source, sink, method="dinic").flow
    residual = network - flow
    residual.data[residual.data < 0] = 0
    residual.eliminate_zeros()
    reached = breadth_first_order(residual, source, return_predecessors=False)
    stays = np.zeros(n + 2, bool)
    stays[reached] = True
    moved = labels.copy()
    moved[members[~stays[:n]]] = alpha
    return moved


def alpha_expansion(data: Array, pairs: Index, weights: Array, labels: Index, reach: float, sweeps: int = 3) -> Index:
    """Expand every label in turn until no move lowers the energy.

    Args:
        data: (N, L) cost of each label for each node; pairs: (E, 2); weights: (E,) cost of cutting a pair.
        labels: (N,) start, 0..L-1.
        reach: see `expand`.
        sweeps: most passes over all labels.
    """
    best = energy(data, pairs, weights, labels)
    since = 0
    for _ in range(sweeps):
        for alpha in range(data.shape[1]):
            trial = expand(data, pairs, weights, labels, alpha, reach)
            value = energy(data, pairs, weights, trial)
            if value < best - 1e-6:
                labels, best, since = trial, value, 0
            else:
                since += 1
            if since >= data.shape[1]:
                return labels
    return labels

"""Join neighbouring parts while one primitive explains both."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.points import batchfit
from brepgaussian.points.batchfit import Noise, Sets
from brepgaussian.points.graph import Graph, Index, compact

Array = NDArray[np.float64]
KIND_PENALTY = {"plane": 0.0, "cylinder": 0.1, "sphere": 0.12, "cone": 0.18, "torus": 0.25}
LEAST_GAIN = 0.15  # of the cost of a plane that a curved primitive must save: errors are smooth, not white
SMALL_WELL = 15.0  # more for a part of one node, less with the root of their number
WELL = 1.5  # cost of a part that its own primitive explains well enough; what is above is no reason to merge
SAMPLE = 32  # points that stand for a part in a fit
_NEUTRAL_SHARE, _NEUTRAL_VIEWS = 0.8, 6.0  # prior of the votes of a border: what chance and bad masks give
_CORRELATED = 0.5  # rise in cost that chance gives a large part: errors of the nodes are correlated
_SINGLE = 4.0  # and one node
_MOST_ROUNDS = 60
# Smooth errors of reconstructed faces: hulls bulge between the contours that they touch, training follows.
_BULGE_TURN = float(np.radians(5.0))  # rms of the normal's difference
_BULGE_HEIGHT = 0.03  # of a face's width, rms: what such a turn makes of it
_BULGE_MOST = 0.004  # unit frame; wide faces have contours in between
_FLAT = 0.5  # cost in those errors by which a plane may be dearer than a curved primitive before it is none
_GOOD = 0.5  # of the tolerance; a primitive that fits as well needs no rival


UNEXPLAINED = 5.0  # cost of a part that no primitive explains
_SURE_VIEWS, _SURE_SHARE = 10.0, 0.95  # votes of a border, and their share for one region, that suffice alone
# ratio beyond which even failed geometry speaks against: pieces of one face had up to 2.0, two faces 2.3 and more
_NOT_FAR = 2.1
_DEARER = 1.9  # cost of one primitive for both over the lower of their own; pieces of one face had up to 1.8
_LAST = 0.95  # ratio of such a merge: after all that the primitives ask for


@dataclass(frozen=True)
class Nodes:
    """What fits need of the nodes.

    Attributes:
        xyz, normals: (N, 3); trust: (N,) weight in fits, low near edges where normals are blurred.
        core: (N,) whether a node speaks for a patch; the others, at edges, follow.
        grey: (N,) grey level, NaN = not seen; gradients: (N, 3) its tangential gradient, NaN = unknown.
        wall: (N,) which piece of a concavity's wall a node lies on, -1 = none that stage 1 has told; None: no node.
    """

    xyz: Array
    normals: Array
    trust: Array
    core: NDArray[np.bool_]
    grey: Array
    gradients: Array
    wall: Index | None = None

    def sets(self, chosen: Index, weights: Array) -> Sets:
        """Nodes (B, M) as sets with weights (B, M)."""
        return Sets(self.xyz[chosen], self.normals[chosen], self.gradients[chosen], weights)


@dataclass(frozen=True)
class Models:
    """The best primitive of each of C parts: kinds (C,), rows (C, 10), mean cost (C,)."""

    kinds: NDArray[np.str_]
    rows: Array
    cost: Array


class Sampler:
    """Points and weights that stand for each part, the same ones whenever it is asked."""

    def __init__(self, nodes: Nodes, seed: int) -> None:
        self.nodes = nodes
        self._rank = np.random.default_rng(seed).permutation(len(nodes.xyz))

    def __call__(self, parts: list[Index], size: int = SAMPLE) -> Sets:
        """C sets of `size` nodes; weights are zero where a part has fewer."""
        chosen = np.zeros((len(parts), size), np.int64)
        weights = np.zeros((len(parts), size))
        for row, part in enumerate(parts):
            if self.nodes.core[part].any():
                part = part[self.nodes.core[part]]
            if len(part) > size:
                part = part[np.argpartition(self._rank[part], size)[:size]]
            chosen[row, : len(part)] = part
            weights[row, : len(part)] = self.nodes.trust[part]
        return self.nodes.sets(chosen, weights)


def parts_of(labels: Index) -> list[Index]:
    """Node indices of each label 0, 1, ..."""
    order = np.argsort(labels, kind="stable")
    order = order[labels[order] >= 0]
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1) if len(order) else []


def best_models(sets: Sets, noise: Noise) -> Models:
    """The kind of lowest mean cost, simpler kinds preferred, of each of B sets."""
    count = len(sets.points)
    chosen = np.full(count, "plane", dtype="<U8")
    rows = batchfit.fit("plane", sets, noise)
    cost = _mean(batchfit.costs("plane", rows, sets, noise), sets.weights)
    rank = cost.copy()
    curved = np.flatnonzero(cost > 2 * KIND_PENALTY["cylinder"])
    for kind, penalty in KIND_PENALTY.items():
        if kind == "plane" or not len(curved):
            continue
        some = sets.take(curved)
        found = batchfit.fit(kind, some, noise)
        value = _mean(batchfit.costs(kind, found, some, noise), some.weights)
        better = value + penalty < np.where(chosen[curved] == "plane", 1 - LEAST_GAIN, 1.0) * rank[curved]
        where = curved[better]
        chosen[where], rows[where], cost[where] = kind, found[better], value[better]
        rank[where] = value[better] + penalty
    return Models(chosen, rows, cost)


def flattened(sets: Sets, models: Models, noise: Noise) -> Models:
    """Planes instead of curved primitives that bend no more than a badly reconstructed plane does.

    What the grey levels say about curvature counts in full, they do not follow the bulges of a hull.
    """
    curved = np.flatnonzero(models.kinds != "plane")
    if not len(curved):
        return models
    kinds, rows, cost = models.kinds.copy(), models.rows.copy(), models.cost.copy()
    for i in curved:
        one = sets.take(np.array([i]))
        bulge = min(_BULGE_HEIGHT * _width(one), _BULGE_MOST)
        if bulge < noise.distance:  # a strip so narrow does not bulge visibly: if it seems bent, it is
            continue
        plane = batchfit.fit("plane", one, noise)
        loose = replace(
            noise, distance=float(np.hypot(noise.distance, bulge)), normal=float(np.hypot(noise.normal, _BULGE_TURN))
        )
        flat = _mean(batchfit.costs("plane", plane, one, loose), one.weights)[0]
        bent = _mean(batchfit.costs(str(kinds[i]), rows[i : i + 1], one, loose), one.weights)[0]
        if flat < bent + _FLAT:
            kinds[i], rows[i] = "plane", plane[0]
            cost[i] = _mean(batchfit.costs("plane", plane, one, noise), one.weights)[0]
    return Models(kinds, rows, cost)


def _width(one: Sets) -> float:
    """The smaller side of a rectangle that spreads like the points of one set."""
    share = one.weights[0] / one.weights[0].sum()
    centred = one.points[0] - share @ one.points[0]
    return float(np.sqrt(12 * np.linalg.eigvalsh(centred.T @ (share[:, None] * centred))[1]))


def _mean(costs: Array, weights: Array) -> Array:
    return (costs * weights).sum(1) / np.maximum(weights.sum(1), 1e-9)


def tolerance(same: Array, both: Array, extra: Array) -> Array:
    """How much dearer a part may become: less where the images show a border, more where they show none."""
    share = (same + _NEUTRAL_SHARE * _NEUTRAL_VIEWS) / (both + _NEUTRAL_VIEWS)
    value = np.interp(share, [0.3, 0.55, 0.8, 0.9, 0.97], [0.05, 0.25, 0.8, 1.8, 4.5])
    return value * np.exp(np.clip(extra, -2.0, 1.0))


def certainty(size: Array) -> Array:
    """Factor on a part's rise in cost: the mean over many nodes is known better, yet their errors are correlated."""
    return 1 / (_CORRELATED + _SINGLE / np.sqrt(np.maximum(size, 1)))


@dataclass
class _Pair:
    same: float
    both: float
    extra: float  # mean over the links
    links: int
    ratio: float = np.nan


class Merger:
    """Parts, their models and the pairs of neighbours among them."""

    def __init__(self, nodes: Nodes, graph: Graph, labels: Index, noise: Noise, seed: int) -> None:
        self.noise = noise
        self.sampler = Sampler(nodes, seed)
        self.parts: dict[int, Index] = dict(enumerate(parts_of(labels)))
        self.sets: dict[int, tuple[Array, ...]] = {}
        self.own: dict[int, float] = {}
        self.pairs: dict[tuple[int, int], _Pair] = {}
        self._count = len(labels)
        self._describe(list(self.parts))
        self._find_pairs(graph, labels)

    def _describe(self, ids: list[int]) -> None:
        if not ids:
            return
        sets = self.sampler([self.parts[i] for i in ids])
        models = best_models(sets, self.noise)
        for row, i in enumerate(ids):
            self.sets[i] = (sets.points[row], sets.normals[row], sets.gradients[row], sets.weights[row])
            self.own[i] = float(models.cost[row])

    def _find_pairs(self, graph: Graph, labels: Index) -> None:
        a, b = labels[graph.pairs[:, 0]], labels[graph.pairs[:, 1]]
        cross = (a != b) & (a >= 0) & (b >= 0)
        low, high = np.minimum(a, b)[cross], np.maximum(a, b)[cross]
        keys, inverse = np.unique(low * (labels.max(initial=0) + 1) + high, return_inverse=True)
        links = np.bincount(inverse)
        sums = [np.bincount(inverse, values[cross]) for values in (graph.same, graph.both, graph.extra)]
        for k, key in enumerate(keys.tolist()):
            pair = divmod(key, int(labels.max(initial=0)) + 1)
            self.pairs[pair] = _Pair(sums[0][k], sums[1][k], sums[2][k] / links[k], int(links[k]))

    def run(self) -> Index:
        """Merge until no pair fits within its tolerance; (N,) labels."""
        for _ in range(_MOST_ROUNDS):
            self._judge([key for key, pair in self.pairs.items() if np.isnan(pair.ratio)])
            merges = self._mutual_best()
            if not merges:
                break
            self._merge(merges)
        labels = np.full(self._count, -1, np.int64)
        for i, part in self.parts.items():
            labels[part] = i
        return compact(labels)

    def _judge(self, keys: list[tuple[int, int]]) -> None:
        """Cost of one primitive for both parts of each pair, over the tolerance."""
        if not keys:
            return
        one = [np.stack([self.sets[a][f] for a, _ in keys]) for f in range(4)]
        two = [np.stack([self.sets[b][f] for _, b in keys]) for f in range(4)]
        size_a = np.array([len(self.parts[a]) for a, _ in keys], float)[:, None]
        size_b = np.array([len(self.parts[b]) for _, b in keys], float)[:, None]
        # square roots: a large part leads without silencing the small one
        w_a = one[3] * np.sqrt(size_a) / np.maximum(one[3].sum(1, keepdims=True), 1e-9)
        w_b = two[3] * np.sqrt(size_b) / np.maximum(two[3].sum(1, keepdims=True), 1e-9)
        points, normals, gradients = (np.concatenate([one[f], two[f]], 1) for f in range(3))
        joint = Sets(points, normals, gradients, np.concatenate([w_a, w_b], 1))
        pairs = [self.pairs[k] for k in keys]
        allowed = tolerance(
            np.array([p.same for p in pairs]), np.array([p.both for p in pairs]), np.array([p.extra for p in pairs])
        )
        surer_a, surer_b = certainty(size_a[:, 0]), certainty(size_b[:, 0])
        excused = WELL + SMALL_WELL / np.sqrt(np.concatenate([size_a, size_b], 1))
        own = np.minimum(np.array([[self.own[a], self.own[b]] for a, b in keys]), excused)
        ratio, together = np.full(len(keys), np.inf), np.full(len(keys), np.inf)
        todo = np.arange(len(keys))
        for kind, penalty in KIND_PENALTY.items():
            some = joint.take(todo)
            cost = batchfit.costs(kind, batchfit.fit(kind, some, self.noise), some, self.noise)
            first, second = _mean(cost[:, :SAMPLE], w_a[todo]), _mean(cost[:, SAMPLE:], w_b[todo])
            together[todo] = np.minimum(together[todo], np.maximum(first, second))
            rise = np.column_stack([first, second]) - own[todo] + penalty
            worse = np.maximum(rise[:, 0] * surer_a[todo], rise[:, 1] * surer_b[todo])
            ratio[todo] = np.minimum(ratio[todo], worse / allowed[todo])
            todo = todo[ratio[todo] > _GOOD]
            if not len(todo):
                break
        for pair, value, cost_of_both, (a, b) in zip(pairs, ratio.tolist(), together.tolist(), keys, strict=True):
            lost = min(self.own[a], self.own[b]) > UNEXPLAINED
            one_region = pair.both >= _SURE_VIEWS and pair.same >= _SURE_SHARE * pair.both
            near = value < _NOT_FAR and cost_of_both < _DEARER * min(self.own[a], self.own[b])
            # where geometry failed (walls of narrow bores), the images alone decide
            pair.ratio = min(value, _LAST) if lost and one_region and near else value

    def _mutual_best(self) -> list[tuple[int, int]]:
        best: dict[int, tuple[float, tuple[int, int]]] = {}
        for key, pair in self.pairs.items():
            if pair.ratio < 1:
                for i in key:
                    if i not in best or (pair.ratio, key) < best[i]:
                        best[i] = (pair.ratio, key)
        chosen = {key for _, key in best.values()}
        return sorted(key for key in chosen if best[key[0]][1] == key and best[key[1]][1] == key)

    def _merge(self, merges: list[tuple[int, int]]) -> None:
        into = {b: a for a, b in merges}
        changed = [a for a, _ in merges]
        for a, b in merges:
            self.parts[a] = np.sort(np.concatenate([self.parts[a], self.parts.pop(b)]))
            del self.sets[b], self.own[b]
        touched = set(changed)
        pairs: dict[tuple[int, int], _Pair] = {}
        for (a, b), pair in self.pairs.items():
            a, b = into.get(a, a), into.get(b, b)
            if a == b:
                continue
            key = (min(a, b), max(a, b))
            if a in touched or b in touched:
                pair.ratio = np.nan
            old = pairs.get(key)
            if old is None:
                pairs[key] = pair
            else:
                links = old.links + pair.links
                extra = (old.extra * old.links + pair.extra * pair.links) / links
                pairs[key] = _Pair(old.same + pair.same, old.both + pair.both, extra, links)
        self.pairs = pairs
        self._describe(changed)

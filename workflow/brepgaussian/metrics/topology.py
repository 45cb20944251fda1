"""Whether two B-Reps have the same faces in the same neighbourhood."""

from collections.abc import Sequence

import networkx as nx
import numpy as np
from numpy.typing import NDArray

_NODE = "type"


def topology_match(
    types: Sequence[str],
    pairs: NDArray[np.integer],
    truth_types: Sequence[str],
    truth_pairs: NDArray[np.integer],
) -> bool:
    """Equal face count and isomorphic face-adjacency graphs with surface types as labels.

    Args:
        types, truth_types: surface type of each face.
        pairs, truth_pairs: (A, 2) adjacent faces.
    """
    first, second = _graph(types, pairs), _graph(truth_types, truth_pairs)
    return len(types) == len(truth_types) and bool(nx.vf2pp_is_isomorphic(first, second, node_label=_NODE))


def _graph(types: Sequence[str], pairs: NDArray[np.integer]) -> nx.Graph:
    graph = nx.Graph()
    graph.add_nodes_from((i, {_NODE: kind}) for i, kind in enumerate(types))
    graph.add_edges_from((int(a), int(b)) for a, b in np.asarray(pairs).reshape(-1, 2) if a != b)
    return graph

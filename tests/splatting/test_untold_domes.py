"""A hole whose floor rays don't tell has no cap that they tell either."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import depth
from brepgaussian.splatting.concave.shapes import STRAIGHT, Shape


class _Opening:
    """One whose rays dislike a deeper floor by `told` more than a cap."""

    told = 0.0
    ends, face, shallowest = (80.0,), 0.0, 2.0

    def __init__(self, *_):
        pass

    def costs(self, shape: Shape) -> Shape:
        return shape

    def advantage(self, _worse: Shape, _better: Shape) -> float:
        return self.told

    def score(self, _shape: Shape) -> tuple[float, float]:
        return 0.1, 0.02

    def closed(self) -> float:
        return 1.0

    def keep_clear(self, _grow: float | None) -> None:
        pass


@pytest.mark.parametrize(("told", "domed"), [(0.0, False), (1e6, True)])
def test_a_cap_is_told_where_the_floor_is(monkeypatch, told, domed):
    cap, flat = replace(STRAIGHT, depth=30.0, grow=0.5, domed=True), replace(STRAIGHT, depth=27.0, grow=0.5)
    monkeypatch.setattr(_Opening, "told", told)
    monkeypatch.setattr(depth, "Opening", _Opening)
    monkeypatch.setattr(depth, "looked_into", lambda *_: (None, None, None))
    monkeypatch.setattr(depth, "best_depth", lambda _opening, _count, like=STRAIGHT: replace(like, depth=27.0))
    for same in ("_refine", "_again", "_deepen"):
        monkeypatch.setattr(depth, same, lambda *given: next(g for g in reversed(given) if isinstance(g, Shape)))
    monkeypatch.setattr(depth, "_leaning", lambda *_: cap)
    monkeypatch.setattr(depth, "_refuted", lambda *_: True)
    outline = np.hypot(*(np.mgrid[:41, :41] - 20)) < 12
    prism, _ = depth.measure(SimpleNamespace(lattice=SimpleNamespace(pitch=0.01)), outline, None, None, 2.0)
    assert prism.domed is domed
    assert prism.endless is not domed
    assert prism.depth == pytest.approx((cap if domed else flat).depth * 0.01)

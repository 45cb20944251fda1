"""Pockets that were opened down to the tops of the bosses in them only."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.raised import raised

PITCH, DEPTH, HIGH = 0.005, 0.15, 0.12
POCKET, PADS = (slice(10, 110), slice(10, 70)), ((slice(30, 42), slice(25, 55)), (slice(70, 82), slice(25, 55)))


def prism(height, depth, *boxes, **changes):
    """An opening of some boxes of cells, upwards at a height."""
    outline = np.zeros((120, 80), bool)
    for box in boxes:
        outline[box] = True
    lattice = Lattice(np.array([0.2, 0.2, height]), *np.eye(3), PITCH, outline.shape)
    return replace(Prism(lattice, outline, depth, False, 0.0), **changes)


def pocket_and_floor(shoulder=0, **changes):
    """A pocket down to its pads' tops, and the opening around these in its floor, off its walls by some cells."""
    rows, columns = ((s.start + shoulder, s.stop - shoulder) for s in POCKET)
    around = prism(0.6 - DEPTH, HIGH, (slice(*rows), slice(*columns)))
    for pad in PADS:
        around.outline[pad] = False
    return prism(0.6, DEPTH, POCKET), replace(around, **changes)


def believing(asked, believed=True):
    """Looks for bosses: all likely ones stand, or none."""

    def standing(k, whole, likely):
        asked.append((k, whole, likely))
        found = [Prism(whole.lowered(t.depth), t.outline, whole.depth - t.depth, False, 0.0) for t in likely]
        return replace(whole, islands=tuple(found) if believed else ())

    return standing


def test_a_pocket_around_tops_is_deeper_and_has_bosses():
    pocket, around = pocket_and_floor()
    beside = prism(0.6 - DEPTH, 0.11, (slice(50, 65), slice(20, 60)))  # a part of it, found once more
    hole = prism(0.6, 0.3, (slice(112, 118), slice(30, 40)))
    asked = []
    deeper, left = raised([hole, pocket], [beside, around], believing(asked))
    assert list(deeper) == [1]
    assert deeper[1].depth == pytest.approx(DEPTH + HIGH)
    assert [island.depth for island in deeper[1].islands] == pytest.approx([HIGH, HIGH])
    tops = np.any([island.outline for island in deeper[1].islands], axis=0)
    pads = prism(0.6, 0.1, *PADS).outline
    assert (tops & pads).sum() > 0.9 * pads.sum()
    assert not (tops & ~pads).any()
    assert left == []
    assert [k for k, _, _ in asked] == [1]


@pytest.mark.parametrize("other", ["views", "shoulder", "through", "bosses", "elsewhere", "whole"])
def test_other_openings_stay(other):
    pocket, around = pocket_and_floor(shoulder=6 if other == "shoulder" else 0)
    if other == "through":
        around = replace(around, through=True)
    elif other == "bosses":
        pocket = replace(pocket, islands=(prism(0.5, 0.05, PADS[0]),))
    elif other == "elsewhere":
        around = replace(around, lattice=replace(around.lattice, origin=around.lattice.origin + np.array([0, 0, 0.05])))
    elif other == "whole":  # nothing is left of the floor
        around = prism(0.6 - DEPTH, HIGH, POCKET)
    asked = []
    deeper, left = raised([pocket], [around], believing(asked, believed=other != "views"))
    assert deeper == {}
    assert len(left) == 1
    assert left[0] is around

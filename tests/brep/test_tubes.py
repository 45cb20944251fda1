"""Pieces of a pipe beside a bend, against a solid whose parts are known by hand."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.artifacts.primitives import Primitive
from brepgaussian.brep import assemble
from brepgaussian.brep.job import Job, Rung
from brepgaussian.brep.patches import make_patches, supported
from brepgaussian.brep.tubes import bent_tubes, even_tubes
from brepgaussian.geometry.surfaces import cylinder, plane, torus, unit
from brepgaussian.primitives.relations import RESIDUALS
from brepgaussian.settings.brep import BrepSettings

RING, TUBE, LEG, NOISE = 0.3, 0.12, 0.25, 0.0008
X, Y, Z = np.eye(3)
CENTRE = np.array([0.7, 0.5, 0.3])  # of the bend: a quarter about y, from a leg down z to a leg along x


def rod(kit, off=0.0, shift=0.0, seed=0):
    """Patches of a bent round rod: bend, a leg down that is `off` wider and `shift` aside, a leg along x, ends."""
    rng = np.random.default_rng(seed)
    low, right = CENTRE - RING * X, CENTRE + RING * Z
    surfaces = [
        torus(CENTRE, Y, RING, TUBE),
        cylinder(low + shift * X, Z, TUBE + off),
        cylinder(right, X, TUBE),
        plane(low - LEG * Z, -Z),
        plane(right + LEG * X, X),
    ]
    count = 4000
    turn, around = rng.uniform(0, np.pi / 2, count), rng.uniform(0, 2 * np.pi, count)
    out = np.column_stack([-np.cos(turn), 0 * turn, np.sin(turn)])
    clouds = [CENTRE + RING * out + TUBE * (np.cos(around)[:, None] * out + np.sin(around)[:, None] * Y)]
    for middle, along, sign in ((low, 2, -1.0), (right, 0, 1.0)):
        across = np.eye(3)[[a for a in range(3) if a != along]]
        circle = np.cos(around)[:, None] * across[0] + np.sin(around)[:, None] * across[1]
        clouds.append(middle + TUBE * circle + sign * LEG * rng.uniform(0, 1, (count, 1)) * np.eye(3)[along])
    for middle, along, sign in ((low, 2, -1.0), (right, 0, 1.0)):
        across = np.eye(3)[[a for a in range(3) if a != along]]
        disc = TUBE * np.sqrt(rng.uniform(0, 1, (count // 4, 1)))
        ring = np.cos(around[: count // 4, None]) * across[0] + np.sin(around[: count // 4, None]) * across[1]
        clouds.append(middle + sign * LEG * np.eye(3)[along] + disc * ring)
    normals = np.concatenate([s.normals(c) for s, c in zip(surfaces, clouds, strict=True)])
    xyz = np.concatenate(clouds)
    label = np.repeat(np.arange(5), [len(c) for c in clouds])
    points = kit.make_points(xyz + NOISE * rng.normal(size=xyz.shape), normals, label)
    items = [Primitive(s, i, np.flatnonzero(label == i), NOISE) for i, s in enumerate(surfaces)]
    return make_patches(items, points, 0.05)


def built(patches):
    job = Job(tuple(patches), (), np.zeros((0, 3)), (), None, BrepSettings())
    return assemble.attempt(job, Rung("support", 0.04, silhouettes=False)).verdict


@pytest.mark.parametrize(("off", "seed"), [(-1.6, 1), (2.5, 2)])
def test_a_leg_that_is_a_little_too_wide_or_narrow_is_as_wide_as_its_bend(kit, off, seed):
    patches = rod(kit, off * NOISE, seed=seed)
    even = even_tubes(patches, NOISE)
    assert [p.surface.radius for p in even[1:3]] == [TUBE, TUBE]
    assert all(new is old for k, (new, old) in enumerate(zip(even, patches, strict=True)) if k != 1)
    verdict = built(even)
    assert verdict.faces == 5
    assert verdict.doubts == ()
    expected = np.pi * TUBE**2 * (2 * LEG + RING * np.pi / 2)
    assert verdict.volume == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("off", "shift", "lean"), [(1.6, 0.5, 0.0), (0.0, 0.5, 0.0), (1.6, 0.0, 3e-3), (-2.0, -0.4, 2e-3)]
)
def test_a_pipe_that_misses_its_bend_by_less_than_the_noise_goes_on_smoothly(kit, off, shift, lean):
    """Points refuse the relation where they show a leg too narrow, and then its axis is its own, too."""
    patches = rod(kit, off * NOISE, shift * NOISE, seed=5)
    leg = patches[1].surface
    patches[1] = replace(patches[1], surface=replace(leg, axis=unit(leg.axis + lean * X)))
    even = even_tubes(patches, NOISE)
    assert np.abs(RESIDUALS["bend"](even[1].surface, even[0].surface)).max() < 1e-12
    assert even[1].surface.axis @ leg.axis > np.cos(1.5 * lean + 1e-6)
    verdict = built(even)
    assert verdict.faces == 5
    assert verdict.doubts == ()


@pytest.mark.parametrize(
    ("off", "shift"), [(0.0, 0.0), (10.0, 0.0), (1.6, 0.02)], ids=["even", "a step", "beside the bend's centre line"]
)
def test_what_is_even_or_is_no_pipe_stays(kit, off, shift):
    patches = rod(kit, off * NOISE, shift, seed=3)
    assert all(new is old for new, old in zip(even_tubes(patches, NOISE), patches, strict=True))


def test_a_bore_and_a_rod_are_not_one_pipe(kit):
    patches = rod(kit, 1.6 * NOISE, seed=4)
    bore = replace(patches[1], surface=replace(patches[1].surface, flipped=True))
    assert even_tubes([patches[0], bore, *patches[2:]], NOISE)[1] is bore


def mislabelled(patches, wrong=0.03):
    """Patches of a rod of whose lower leg the bend has all points but those that look to one side, and a torus that
    is wider for it; labels of the other leg begin late."""
    bend, leg, other, *ends = patches
    mine = (leg.normals @ X > 0.7) | (leg.xyz[:, 2] < CENTRE[2] - 0.6 * LEG)
    late = other.xyz[:, 0] > CENTRE[0] + 0.2 * LEG
    xyz = np.concatenate([bend.xyz, leg.xyz[~mine], other.xyz[~late]])
    normals = np.concatenate([bend.normals, leg.normals[~mine], other.normals[~late]])
    ring = torus(CENTRE + wrong * (X - Z), Y, RING + wrong, TUBE - 2 * NOISE)
    pieces = [(leg, mine), (other, late)]
    return [
        supported(bend, ring, xyz, normals),
        *(supported(p, p.surface, p.xyz[m], p.normals[m]) for p, m in pieces),
        *ends,
    ]


@pytest.mark.parametrize(("wrong", "seed"), [(0.02, 6), (-0.02, 7), (0.0, 8)])
def test_a_bend_that_has_points_of_its_pipe_is_tangent_to_it_and_gives_them_back(kit, wrong, seed):
    patches = mislabelled(rod(kit, seed=seed), wrong)
    bend, leg, other, *ends = bent_tubes(patches, NOISE)
    assert bend.surface.radius == pytest.approx(RING, abs=5 * NOISE)
    np.testing.assert_allclose(bend.surface.origin, CENTRE, atol=5 * NOISE)
    for piece in (leg, other):
        assert np.abs(RESIDUALS["bend"](piece.surface, bend.surface)).max() < 1e-12
    assert (leg.xyz[:, 2] < CENTRE[2] + 5 * NOISE).all()
    assert len(leg.xyz) == pytest.approx(4000, rel=0.05)
    assert sum(len(p.xyz) for p in (bend, leg, other)) == sum(len(p.xyz) for p in patches[:3])
    verdict = built([bend, leg, other, *ends])
    assert (verdict.faces, verdict.doubts) == (5, ())


def test_a_bore_that_bends_stays_one(kit):
    patches = [replace(p, surface=p.surface.flip()) for p in mislabelled(rod(kit, seed=9))]
    assert all(p.surface.flipped for p in bent_tubes(patches, NOISE)[:3])


@pytest.mark.parametrize("spoil", ["labels", "beside", "step", "bore"])
def test_a_bend_whose_labels_are_right_or_that_is_no_pipes_stays(kit, spoil):
    patches = rod(kit, seed=10) if spoil == "labels" else mislabelled(rod(kit, seed=10))
    leg = patches[1].surface
    leg = {
        "labels": leg,
        "beside": replace(leg, origin=leg.origin + 0.02 * Y),
        "step": replace(leg, radius=leg.radius * 1.05),
        "bore": leg.flip(),
    }[spoil]
    patches[1] = replace(patches[1], surface=leg)
    assert all(new is old for new, old in zip(bent_tubes(patches, NOISE), patches, strict=True))

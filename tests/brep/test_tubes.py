"""Pieces of a pipe beside a bend, against a solid whose parts are known by hand."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.artifacts.primitives import Primitive
from brepgaussian.brep import assemble
from brepgaussian.brep.job import Job, Rung
from brepgaussian.brep.patches import make_patches
from brepgaussian.brep.tubes import even_tubes
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

"""Relations: zero where they hold by construction, derivatives, and the constrained solve against a reference."""

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.geometry.fit import PARAMETERS, fit, moved
from brepgaussian.geometry.surfaces import cone, cylinder, plane, sphere, torus
from brepgaussian.primitives.ends import end_at
from brepgaussian.primitives.patches import Noise, Patch, make_cloud
from brepgaussian.primitives.propose import State, _back_to_back, directions
from brepgaussian.primitives.relations import Link, direction_angle
from brepgaussian.primitives.solve import EFFECTIVE, Evidence, covariance, derivative, independent, significance, solve
from brepgaussian.settings.primitives import PrimitivesSettings
from hypothesis import given, settings
from hypothesis import strategies as st
from sampled_surfaces import noisy, random_surface, sample
from scipy.optimize import minimize

Z = np.array([0.0, 0, 1])
X = np.array([1.0, 0, 0])
O = np.full(3, 0.5)  # noqa: E741

HOLDING = [
    ("parallel", plane(O, Z), cylinder(O, -Z, 0.2)),
    ("perpendicular", plane(O, Z), plane(O, X)),
    ("angle_60", plane(O, Z), plane(O, [np.sin(np.pi / 3), 0, -np.cos(np.pi / 3)])),
    ("coaxial", cylinder(O, Z, 0.2), cone(O + 0.3 * Z, -Z, 0.1, 0.5)),
    ("coaxial", torus(O, Z, 0.3, 0.1), sphere(O + 0.1 * Z, 0.2)),
    ("equal_radius", cylinder(O, Z, 0.2), cylinder(O + X, X, 0.2)),
    ("equal_radius", torus(O, Z, 0.3, 0.05), torus(O, Z, 0.4, 0.05)),
    ("equal_angle", cone(O, Z, 0.2, 0.7), cone(O, X, 0.1, 0.7)),
    ("same", plane(O, Z), plane(O + X, Z)),
    ("same", cylinder(O, Z, 0.2), cylinder(O + 0.4 * Z, -Z, 0.2)),
    ("same", cone(O, Z, 0.2, np.pi / 4), cone(O + 0.1 * Z, Z, 0.3, np.pi / 4)),
    ("same", torus(O, Z, 0.2, 0.1), torus(O, -Z, 0.2, 0.1)),
    ("same", sphere(O, 0.2), sphere(O, 0.2)),
    ("tangent", plane(O, Z), cylinder(O - 0.2 * Z, X, 0.2)),
    ("tangent", cylinder(O + 0.2 * Z, X, 0.2), plane(O, Z)),
    ("tangent", plane(O, Z), sphere(O - 0.2 * Z, 0.2)),
    ("tangent", plane(O, Z), torus(O - 0.05 * Z, Z, 0.2, 0.05)),
    ("tangent", cylinder(O, Z, 0.2), torus(O, Z, 0.15, 0.05)),
    ("tangent", cylinder(O, Z, 0.2), torus(O, Z, 0.25, 0.05)),
    ("tangent", cylinder(O, Z, 0.2), sphere(O + 0.1 * Z, 0.2)),
    ("tangent", cylinder(O, Z, 0.2), cylinder(O + 0.3 * X, Z, 0.1)),
    ("tangent", cylinder(O, Z, 0.2), cylinder(O + 0.1 * X, Z, 0.1)),
    ("tangent", torus(O, Z, 0.3, 0.1), sphere(O + 0.3 * X, 0.1)),
    ("tangent", sphere(O - 0.3 * X, 0.1), torus(O, Z, 0.3, 0.1)),
    ("tangent", torus(O, Z, 0.3, 0.1), sphere(O + 0.4 * Z, 0.4)),
    ("tangent", sphere(O + 0.4 * Z, 0.6), torus(O, Z, 0.3, 0.1)),
    ("tangent", plane(O + 0.2 * X, np.array([np.cos(0.3), 0, -np.sin(0.3)])), cone(O, Z, 0.2, 0.3)),
    ("tangent", plane(O + 0.2 * X, np.array([-np.cos(0.3), 0, np.sin(0.3)])), cone(O, Z, 0.2, 0.3, flipped=True)),
    ("tangent", cone(O, Z, 0.2, 0.3), torus(O + 0.1 * Z, Z, 0.2 + 0.1 * np.tan(0.3) + 0.05 / np.cos(0.3), 0.05)),
    ("tangent", torus(O, Z, 0.2 - 0.05 / np.cos(0.3), 0.05), cone(O, -Z, 0.2, 0.3)),
    ("tangent", cone(O, Z, 0.2, 0.3), sphere(O, 0.2 * np.cos(0.3))),
    ("tangent", sphere(O + 0.1 * Z, (0.2 + 0.1 * np.tan(0.3)) * np.cos(0.3)), cone(O, Z, 0.2, 0.3)),
    ("equal_cone", cone(O, Z, 0.2, 0.3), cone(O + 0.4 * X + 0.1 * Z, Z, 0.2 + 0.1 * np.tan(0.3), 0.3)),
    ("bend", cylinder(O + 0.3 * X, [0, 1, 0], 0.1), torus(O, Z, 0.3, 0.1)),
    ("bend", torus(O, Z, 0.3, 0.1), cylinder(O + 0.2 * X - [0, 0.3, 0], -X, 0.1)),
]


@pytest.mark.parametrize(("kind", "first", "second"), HOLDING)
def test_residual_is_zero_where_the_relation_holds_and_only_there(kind, first, second):
    link = Link(kind, 0, 1)
    np.testing.assert_allclose(link.residual(first, second), 0, atol=1e-12)
    rng = np.random.default_rng(0)
    other = moved(second, 0.02 * rng.normal(size=PARAMETERS[second.kind]))
    assert np.abs(link.residual(first, other)).max() > 1e-3


@pytest.mark.parametrize(("kind", "first", "second"), HOLDING)
def test_derivative_predicts_a_small_move(kind, first, second):
    rng = np.random.default_rng(1)
    first = moved(first, 0.01 * rng.normal(size=PARAMETERS[first.kind]))
    link = Link(kind, 0, 1)
    value, jacobians = derivative(link, [first, second])
    delta = 1e-4 * rng.normal(size=PARAMETERS[second.kind])
    np.testing.assert_allclose(link.residual(first, moved(second, delta)), value + jacobians[1] @ delta, atol=1e-6)


def evidence_of(points, sigma=0.003):
    return Evidence(points, np.full(len(points), 1 / sigma**2), float(len(points)))


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_solve_agrees_with_a_slow_reference(seed):
    """Two planes and a cylinder with right angles, tangency: against SLSQP on the same local parameters."""
    rng = np.random.default_rng(seed)
    clouds = []
    for truth in (plane(O, Z), plane(O, X), cylinder(O - 0.1 * Z + 0.3 * X, [0.0, 1, 0], 0.1)):
        points, normals = sample(truth, 80, rng, arc=2.0)
        clouds.append(noisy(points, normals, 0.003, rng, 0.03))
    start = [fit(k, *c) for k, c in zip(("plane", "plane", "cylinder"), clouds, strict=True)]
    evidence = [evidence_of(c[0]) for c in clouds]
    links = [Link("perpendicular", 0, 1), Link("tangent", 0, 2)]
    solved, left = solve(start, evidence, links)
    assert left.max() < 1e-9

    cuts = np.cumsum([PARAMETERS[s.kind] for s in start])[:-1]

    def at(x):
        return [moved(s, d) for s, d in zip(start, np.split(x, cuts), strict=True)]

    def total(surfaces):
        return sum(float(s.signed_distance(e.xyz) ** 2 @ e.weights) for s, e in zip(surfaces, evidence, strict=True))

    def cost(x):
        return total(at(x))

    def holds(x):
        surfaces = at(x)
        return np.concatenate([k.residual(surfaces[k.first], surfaces[k.second]) for k in links])

    reference = minimize(
        cost,
        np.zeros(sum(PARAMETERS[s.kind] for s in start)),
        constraints={"type": "eq", "fun": holds},
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 300},
    )
    ours = total(solved)
    assert ours <= reference.fun * 1.01 + 0.5


def test_redundant_relations_do_no_harm_and_contradictions_show():
    rng = np.random.default_rng(2)
    clouds = [noisy(*sample(plane(O, a), 200, rng), 0.002, rng, 0.03) for a in np.eye(3)]
    start = [fit("plane", *c) for c in clouds]
    evidence = [evidence_of(c[0]) for c in clouds]
    right = [Link("perpendicular", 0, 1), Link("perpendicular", 1, 2), Link("perpendicular", 0, 2)]
    solved, left = solve(start, evidence, right + right)
    assert left.max() < 1e-9
    axes = np.array([s.axis for s in solved])
    np.testing.assert_allclose(np.abs(axes @ axes.T), np.eye(3), atol=1e-9)
    _, left = solve(start, evidence, [*right, Link("parallel", 0, 1)])
    assert left.max() > 1e-3


def test_significance_counts_standard_deviations():
    """Residuals of a true relation over its covariance are about one, whatever the noise."""
    rng = np.random.default_rng(3)
    for sigma in (0.001, 0.005):
        ratios = []
        for _ in range(40):
            clouds = [noisy(*sample(plane(O, a), 50, rng), sigma, rng) for a in (Z, X)]
            surfaces = [fit("plane", *c) for c in clouds]
            covariances = [covariance(s, evidence_of(c[0], sigma)) for s, c in zip(surfaces, clouds, strict=True)]
            ratios.append(significance(Link("perpendicular", 0, 1), surfaces, covariances))
        assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5


@pytest.mark.parametrize("kind", PARAMETERS)
def test_without_relations_nothing_moves(kind):
    rng = np.random.default_rng(4)
    surface = random_surface(kind, rng)
    points, _ = sample(surface, 50, rng)
    solved, left = solve([surface], [evidence_of(points)], [])
    assert len(left) == 0
    np.testing.assert_allclose(solved[0].signed_distance(points), surface.signed_distance(points), atol=1e-12)


@pytest.mark.parametrize(("slow", "low", "high"), [(0.0, 4 * EFFECTIVE, 1200), (1.0, EFFECTIVE, 2 * EFFECTIVE)])
def test_only_independent_errors_count_one_by_one(slow, low, high):
    """White noise: every point is an observation; waves across the whole patch: hardly more than `EFFECTIVE`."""
    rng = np.random.default_rng(5)
    points, normals = sample(plane(O, Z), 1200, rng)
    waves = np.sqrt(2) * np.sin(12 * points[:, 0] + 1) * slow
    points[:, 2] += 0.004 * (waves + (1 - slow) * rng.normal(size=len(points)))
    label = np.zeros(len(points), np.int32)
    none = np.zeros(len(points), np.float32)
    cloud = make_cloud(Points(points.astype(np.float32), normals.astype(np.float32), none, label, label - 1), 10)
    patch = Patch((0,), np.arange(len(points)), fit("plane", points, normals), 0.004, 0.01)
    assert low <= independent(patch, cloud, 0.015) <= high


@pytest.mark.parametrize(("degrees", "snapped"), [(5.0, False), (0.8, True)])
def test_a_narrow_wall_knows_its_direction_along_its_length(degrees, snapped):
    """A slot's wall .3 long and .04 high beside a large wall: about its length it may lean by much, not about z."""
    rng = np.random.default_rng(6)
    turn = np.radians(degrees)
    axis = np.array([np.sin(turn), np.cos(turn), 0.0])
    long = np.array([axis[1], -axis[0], 0.0])
    strip = O + (rng.random((150, 1)) - 0.5) * 0.3 * long + (rng.random((150, 1)) - 0.5) * 0.04 * Z
    wide = O + np.column_stack([rng.random(900) - 0.5, np.full(900, 0.3), rng.random(900) - 0.5])
    clouds = [p + 0.005 * rng.normal(size=p.shape) for p in (wide, strip)]
    surfaces = [fit("plane", p, np.tile(a, (len(p), 1))) for p, a in zip(clouds, ([0, 1.0, 0], axis), strict=True)]
    covariances = [covariance(s, evidence_of(p, 0.005)) for s, p in zip(surfaces, clouds, strict=True)]
    touching = np.zeros((2, 2), bool)
    noise = Noise(0.005, 0.1)
    state = State(surfaces, covariances, [900, 150], touching, noise, PrimitivesSettings(), [0.005, 0.005], touching)
    assert direction_angle(*surfaces) < state.angle_tolerance(0, 1)
    assert [(link.kind, link.first, link.second) for link in directions(state)] == (
        [("parallel", 0, 1)] if snapped else []
    )


def test_a_thin_wall_is_no_tangency():
    """A bore whose far side grazes a plane from within is not smooth with it; a rounding is."""
    top = plane(O, Z)
    assert _back_to_back(top, cylinder(O - 0.2 * Z, X, 0.2, flipped=True))
    assert _back_to_back(cylinder(O + 0.2 * Z, X, 0.2), top)
    assert not _back_to_back(top, cylinder(O - 0.2 * Z, X, 0.2))
    assert not _back_to_back(top, cylinder(O + 0.2 * Z, X, 0.2, flipped=True))


def test_balls_touch_tori_and_cones_with_one_side_of_the_material():
    ring, end = torus(O, Z, 0.3, 0.1), O + 0.3 * X
    assert not _back_to_back(ring, sphere(end, 0.1))
    assert _back_to_back(sphere(end, 0.1, flipped=True), ring)
    hollow = torus(O, Z, 0.3, 0.1, flipped=True)  # a fillet between a ball and a plate
    assert not _back_to_back(hollow, sphere(O + 0.4 * Z, 0.4))
    assert _back_to_back(ring, sphere(O + 0.4 * Z, 0.4))
    assert not _back_to_back(ring, sphere(O + 0.4 * Z, 0.6))
    assert not _back_to_back(cone(O, Z, 0.2, 0.3), sphere(O, 0.2))
    assert _back_to_back(cone(O, Z, 0.2, 0.3), sphere(O, 0.2, flipped=True))


@pytest.mark.parametrize(
    ("degrees", "height", "ends"), [(90, 0.2, True), (70, 0.2, False), (130, 0.2, False), (90, 0.4, False)]
)
def test_a_rounding_ends_at_a_wall_of_which_no_point_is_near(degrees, height, ends):
    """An arc of a cylinder up to where a plane at some height would touch it; the plane's points lie far off."""
    rng = np.random.default_rng(1)
    angle = np.radians(rng.uniform(0, degrees, 900))
    arc = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), rng.random(900)])
    far = np.column_stack([-0.5 - 0.3 * rng.random(900), np.full(900, height), rng.random(900)])
    xyz = np.concatenate([arc, far]) + 0.0005 * rng.normal(size=(1800, 3))
    normals = np.concatenate([arc * [5, 5, 0], np.tile([0, 1.0, 0], (900, 1))])
    label = np.repeat([0, 1], 900).astype(np.int32)
    data = Points(xyz.astype(np.float32), normals.astype(np.float32), np.zeros(1800, np.float32), label, label * 0 - 1)
    wall = plane(np.array([0, height, 0]), np.array([0, 1.0, 0]))
    patches = [
        Patch((0,), np.arange(900), cylinder(O * 0, Z, 0.2), 0.0005, 0.01),
        Patch((1,), np.arange(900, 1800), wall, 0.0005, 0.01),
    ]
    assert end_at(patches, make_cloud(data, 10)).tolist() == [[False, ends], [ends, False]]

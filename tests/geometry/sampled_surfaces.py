"""Random surfaces and noisy samples of pieces of them, for the tests of fitting."""

import numpy as np
from brepgaussian.geometry.surfaces import Surface, cone, cylinder, plane, sphere, torus, unit


def random_surface(kind: str, rng: np.random.Generator) -> Surface:
    origin, axis = rng.uniform(0.3, 0.7, 3), unit(rng.normal(size=3))
    flipped = bool(rng.integers(2))
    if kind == "plane":
        return plane(origin, axis)
    if kind == "sphere":
        return sphere(origin, rng.uniform(0.1, 0.4), flipped)
    if kind == "cylinder":
        return cylinder(origin, axis, rng.uniform(0.05, 0.4), flipped)
    if kind == "cone":
        return cone(origin, axis, rng.uniform(0.15, 0.4), np.radians(rng.uniform(15, 70)), flipped)
    return torus(origin, axis, rng.uniform(0.2, 0.4), rng.uniform(0.05, 0.12), flipped)


def sample(surface: Surface, count: int, rng: np.random.Generator, arc: float = 2 * np.pi, height: float = 0.3):
    """(count, 3) points and outward normals on a piece: `arc` about the axis, `height` along the profile."""
    x, y, axis = surface.frame()
    turn = rng.uniform(-arc / 2, arc / 2, count)
    radial = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y
    t = rng.uniform(-height / 2, height / 2, count)
    if surface.kind == "plane":
        points = surface.origin + t[:, None] * x + rng.uniform(-height / 2, height / 2, count)[:, None] * y
    elif surface.kind == "sphere":
        lift = np.clip(t / surface.radius, -1.5, 1.5)
        points = surface.origin + surface.radius * (np.cos(lift)[:, None] * radial + np.sin(lift)[:, None] * axis)
    elif surface.kind == "cylinder":
        points = surface.origin + surface.radius * radial + t[:, None] * axis
    elif surface.kind == "cone":
        t = t * surface.radius / np.tan(surface.angle) / height  # half way to the apex and as far out
        points = surface.origin + (surface.radius + t * np.tan(surface.angle))[:, None] * radial + t[:, None] * axis
    else:
        tube = rng.uniform(0.2, np.pi / 2 + 0.2, count)
        rho = surface.radius + surface.minor * np.cos(tube)
        points = surface.origin + rho[:, None] * radial + (surface.minor * np.sin(tube))[:, None] * axis
    return points, surface.normals(points)


def noisy(points, normals, sigma: float, rng: np.random.Generator, angle: float = 0.0):
    """Points with isotropic noise and normals turned by about `angle` radians."""
    turned = normals + angle / np.sqrt(2) * rng.normal(size=normals.shape)
    return points + sigma * rng.normal(size=points.shape), turned / np.linalg.norm(turned, axis=1, keepdims=True)

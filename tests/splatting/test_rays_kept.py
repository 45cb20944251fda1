"""Rays at the object and what they hit, kept for the next question about the same hull."""

import numpy as np
from blocks import BLOCK
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.agreement import rays_at_object
from build123d import Align, Box
from rendered import rendered


def test_rays_are_the_same_object_and_hits_those_of_a_fresh_scene(tmp_path):
    images = Images.of(rendered(tmp_path, Box(50, 50, 50, align=(Align.MIN,) * 3), 8)[0])
    rays, scene = rays_at_object(images), BLOCK.scene()
    assert rays_at_object(images) is rays
    assert rays_at_object(images, 8) is not rays
    kept = scene.hits_of(rays)
    assert scene.hits_of(rays) is kept
    some = rays.chosen(np.arange(5))
    for answer, asked in ((scene.hits_of(some), some), (scene.hits_of(rays), rays)):
        fresh = BLOCK.scene().hits(asked.origin, asked.direction)
        assert all(np.array_equal(a, b) for a, b in zip(answer, fresh, strict=True))

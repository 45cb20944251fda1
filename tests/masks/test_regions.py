import numpy as np
import pytest
from brepgaussian.masks.regions import RegionGraph, merge_regions, oversegment
from brepgaussian.masks.steps import step_strength, without_shading
from hypothesis import given, settings
from hypothesis import strategies as st


def segment(grey, inside, noise=0.3, depth=0.4):
    strength, _ = step_strength(grey, inside, 3)
    labels = oversegment(strength, inside, depth)
    return merge_regions(
        labels, grey, without_shading(strength, 3), noise=noise, step=2.0, significance=2.0, minimum_area=60
    )


def test_polynomials_of_merged_regions_equal_a_direct_fit():
    rng = np.random.default_rng(3)
    labels = np.ones((40, 50), np.int32)
    labels[:, 20:] = 2
    labels[:, 35:] = 3
    y, x = np.mgrid[:40, :50]
    grey = (50 + 2 * x + 0.05 * y * x + rng.normal(0, 1, x.shape)).astype(np.float32)
    graph = RegionGraph(labels, grey, np.zeros_like(grey), 1.0)
    kept = graph.merge(1, 2)
    coefficients, _ = graph._fit(kept)
    near = np.zeros(labels.shape, bool)
    near[:, 19:21] = near[:, 34:36] = True
    chosen = labels < 3
    weight = np.sqrt(np.where(near[chosen], 0.02, 1.0))
    basis = graph._monomials(x[chosen].astype(float), y[chosen].astype(float))
    direct = np.linalg.lstsq(basis * weight[:, None], grey[chosen] * weight, rcond=None)[0]
    assert coefficients == pytest.approx(direct, abs=1e-3)


def test_shaded_cylinder_stays_whole_and_small_step_is_found():
    y, x = np.mgrid[:90, :160]
    inside = (y > 4) & (y < 85) & (x > 4) & (x < 155)
    grey = 70 + 130 * np.sqrt(np.clip(1 - ((x - 80) / 110) ** 2, 0, 1))
    grey = np.rint(np.where(y > 50, grey - 6, grey)).astype(np.float32)
    labels = segment(grey, inside)
    assert len(np.unique(labels[inside])) == 2
    assert (labels[10:45, 10:150] == labels[20, 20]).all()
    assert (labels[56:80, 10:150] == labels[60, 20]).all()


@pytest.mark.parametrize("sigma", [2.0, 5.0])
def test_noise_does_not_split_faces(sigma):
    rng = np.random.default_rng(23)
    inside = np.zeros((110, 140), bool)
    inside[5:105, 5:135] = True
    grey = np.where(np.mgrid[:110, :140][1] < 70, 120.0, 150.0)
    noisy = np.rint(grey + rng.normal(0, sigma, grey.shape)).astype(np.float32)
    labels = segment(noisy, inside, noise=sigma, depth=0.25 * sigma)
    assert len(np.unique(labels[inside])) == 2
    wanted = np.where(grey < 130, labels[50, 20], labels[50, 120])
    assert (labels[inside] == wanted[inside]).mean() > 0.98


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_every_object_pixel_gets_one_region(seed):
    rng = np.random.default_rng(seed)
    inside = np.zeros((48, 56), bool)
    inside[4:44, 4:52] = True
    grey = np.kron(rng.integers(0, 255, (6, 7)), np.ones((8, 8))).astype(np.float32)
    labels = segment(grey, inside)
    assert ((labels > 0) == inside).all()
    assert set(np.unique(labels[inside])) == set(range(1, labels.max() + 1))

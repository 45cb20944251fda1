"""Features as they are seen: a mean over what a surfel shows in, by hand."""

import numpy as np
from brepgaussian.splatting.samples import Samples
from brepgaussian.splatting.stage2 import as_seen
from scipy.sparse import csr_array


def test_a_surfel_takes_the_mean_of_what_it_shows_in():
    features = np.array([[1, 0], [0, 1], [0.6, 0.8]], np.float32)
    weights = csr_array(np.array([[0.5, 0.5, 0], [0.9, 0, 0]], np.float32))
    found = as_seen(features, [Samples(weights, np.array([1, 2], np.int16))])
    diagonal = np.array([1, 1]) / np.sqrt(2)
    first = 0.5 * diagonal + 0.9 * np.array([1, 0])
    np.testing.assert_allclose(found[0], first / np.linalg.norm(first), atol=1e-6)
    np.testing.assert_allclose(found[1], diagonal, atol=1e-6)
    np.testing.assert_allclose(found[2], features[2], atol=1e-6)  # in no sample: unchanged

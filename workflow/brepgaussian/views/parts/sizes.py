"""Sizes of a bundled part: nominal for seed 0, drawn around the nominal for every other seed."""

import zlib

import numpy as np

DEFAULT_SPREAD = 0.15  # of the nominal size, either way: changes the ratios, keeps every feature apart from the others


class Sizes:
    """Draws the sizes of one part; the same name and seed give the same sizes on every machine.

    Args:
        name: name of the part (so that two parts of one seed don't share their draws).
        seed: 0 for the nominal part.
    """

    def __init__(self, name: str, seed: int) -> None:
        self.nominal = seed == 0
        self._random = np.random.default_rng([seed, zlib.crc32(name.encode())])

    def __call__(self, nominal: float, spread: float = DEFAULT_SPREAD) -> float:
        """One size in mm or degrees: `nominal`, or uniform within `spread` (a fraction) of it."""
        factor = self._random.uniform(1 - spread, 1 + spread)
        return nominal if self.nominal else round(float(nominal * factor), 3)

    def count(self, nominal: int, low: int, high: int) -> int:
        """A number of features: `nominal`, or uniform in low..high."""
        drawn = int(self._random.integers(low, high + 1))
        return nominal if self.nominal else drawn

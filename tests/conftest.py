"""Settings of the test run."""

import os

from hypothesis import settings

# the same examples on every run of the continuous integration, new ones at every desk
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("desk", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "desk")

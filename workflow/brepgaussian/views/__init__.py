"""Stage `views`: calibrated images of one object, and its truth where one is known, as files."""

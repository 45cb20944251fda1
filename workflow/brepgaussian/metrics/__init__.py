"""Scores of labelled points and solids against a known model; see docs/metrics.md."""

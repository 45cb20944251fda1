"""Primitives: a regularised analytic surface for every labelled patch."""

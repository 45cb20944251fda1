"""Primitives to a closed solid: arrangement, minimum cut, gate, STEP."""

"""What all parts agree on."""

from __future__ import annotations

import math

THETA = math.radians(10)
MU = math.tan(THETA)

Pairs = list[tuple[int, float]]
"""Edges and fractions of the contacts of a grasp."""

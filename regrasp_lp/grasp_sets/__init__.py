"""Grasp sets: which combinations of edges hold the object, and where."""

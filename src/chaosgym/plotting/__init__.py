"""Figures from result objects: each function takes an optional ``ax``, returns the Axes, and computes no physics."""

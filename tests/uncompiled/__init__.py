"""Kernels as plain Python: what compilation hides from coverage, and a second word on every vector operation."""

"""Compiled kernels that serve every machine; they know numpy and numba only."""

"""Compiled kernels that machines share; they import numpy and numba only."""

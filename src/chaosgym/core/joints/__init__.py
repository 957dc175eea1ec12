"""Kernels of machines of a few modes and any number of joints."""

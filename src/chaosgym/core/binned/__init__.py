"""Kernels of machines whose matrices vary with an angle: held over each bin of it, contacts along rows."""

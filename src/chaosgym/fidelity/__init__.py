"""The fidelity ladder: cost and accuracy of its rungs."""

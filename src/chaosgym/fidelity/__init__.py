"""The fidelity ladder: cost and accuracy of its rungs, and their outcome at extreme parameters."""

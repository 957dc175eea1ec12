"""The thesis' statements and figures, computed on the machines of chaosgym."""

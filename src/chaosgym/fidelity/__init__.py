"""The fidelity ladder: what accuracy costs, and where a model stops answering."""

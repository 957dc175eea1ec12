"""The outcome of the models at extreme parameters."""

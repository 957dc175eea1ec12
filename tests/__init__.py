"""Tests; a loaded computer is no reason to fail one, so that no example has a deadline."""

from hypothesis import settings

settings.register_profile("chaosgym", deadline=None)
settings.load_profile("chaosgym")

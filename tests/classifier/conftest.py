"""A sweep with known answers, and a classifier trained on it once."""

import pytest

from tests.classifier.made_up import made_up_sweep, trained_on


@pytest.fixture(scope="session")
def sweep():
    """Made once."""
    return made_up_sweep()


@pytest.fixture(scope="session")
def trained(sweep):
    """Trained once, with the learning curve."""
    return trained_on(sweep, seed=3)

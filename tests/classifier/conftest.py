"""A sweep with known answers, and a classifier trained on it once."""

import pytest

from chaosgym.classifier.train import train_classifier
from tests.classifier.made_up import made_up_sweep


@pytest.fixture(scope="session")
def sweep():
    """Made once."""
    return made_up_sweep()


@pytest.fixture(scope="session")
def trained(sweep):
    """Trained once."""
    return train_classifier(sweep, seed=3)

"""Fixtures of several rooms."""

import os

# tests run on all processors already, and OpenMP's threads spin while they wait: one training of trees takes 2 s of
# processor time alone, and 40 s with two threads beside another worker
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numpy as np
import pytest


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A policy that always goes one trim step down."""
    from chaosgym.control.policies import TrainedPolicy, save_policy
    from chaosgym.control.policies.network import Dense, Network
    from tests.control.made_up import ENV

    layer = Dense(np.zeros((6, 14), np.float32), np.array([0, 1, 0, 0, 0, 0], np.float32), "none")
    path = tmp_path_factory.mktemp("policy")
    save_policy(TrainedPolicy(ENV, "trim", Network(None, (layer,))), path)
    return path

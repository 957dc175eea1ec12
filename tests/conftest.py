"""Fixtures of several rooms."""

import os

# tests run on all processors already, and OpenMP's threads spin while they wait: one training of trees takes 2 s of
# processor time alone, and 40 s with two threads beside another worker
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numpy as np
import pytest

LONG = (
    "tests/test_package.py",
    "tests/golden/test_digests.py",
    "tests/uncompiled/test_uncompiled.py",
    "tests/test_kills.py",
    "tests/test_own_machine_page.py",
    "tests/test_site.py",
    "tests/cli/test_answers.py",
    "tests/cli/test_full_disk.py",
    "tests/diagnosis/test_attractors.py",
    "tests/diagnosis/test_whole_box.py",
    "tests/branches/test_branch.py",
    "tests/recordings/test_judge.py",
    "tests/recordings/test_noisy_machines.py",
    "tests/design/test_report.py",
    "tests/fit/test_model_fit.py",
    "tests/series/test_slips.py",
    "tests/sweeps/test_cluster.py",
)
"""Files of minutes. They begin first, so that a run does not end with one of them on one processor."""


def pytest_configure(config):
    """Let pytest-xdist keep the order of files: by itself it begins with those of many tests, and ends with one."""
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(items):
    """Begin with the long files."""
    items.sort(key=lambda item: next((k for k, name in enumerate(LONG) if item.nodeid.startswith(name)), len(LONG)))


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

"""Trained policies: loaded without pickle, played by numpy alone.

policy = shipped_policy("chaosgym/ImpactBeamTolerance-v1")
"""

from chaosgym.control.policies.policy import TrainedPolicy, load_policy, save_policy
from chaosgym.control.policies.shipped import shipped_policy

__all__ = ["TrainedPolicy", "load_policy", "save_policy", "shipped_policy"]

"""The learned classifier: the response type of a machine in microseconds, from its parameters or a short record."""

from chaosgym.classifier.answer import Classification
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.shipped import MachineClassifier, default_classifier

__all__ = ["Classification", "MachineClassifier", "ResponseClassifier", "default_classifier"]

"""The learned classifier: the response type of a machine as fast as its certainty allows, and what a record shows."""

from chaosgym.classifier.answer import Classification, NatureAnswer
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.machine_classifier import MachineClassifier
from chaosgym.classifier.shipped import classifier_for, default_classifier
from chaosgym.recordings.record_answer import RecordAnswer

__all__ = [
    "Classification",
    "MachineClassifier",
    "NatureAnswer",
    "RecordAnswer",
    "ResponseClassifier",
    "classifier_for",
    "default_classifier",
]

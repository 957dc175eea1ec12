"""The learned classifier: the response type of a machine in microseconds, from its parameters alone."""

from chaosgym.classifier.model import RESPONSE_TYPES, Classification, ResponseClassifier, default_classifier

__all__ = ["RESPONSE_TYPES", "Classification", "ResponseClassifier", "default_classifier"]

"""What is computed for every row of the classifier: compiled kernels, cached by the content of these sources."""

from pathlib import Path

from chaosgym.core.compilation import cached_by_content

with cached_by_content(Path(__file__).parent):
    from chaosgym.classifier.kernels import nearest, pairs, parameters, records, scaling, trees  # noqa: F401

"""What the thesis states in numbers, and how each statement is compared.

``targets.csv`` lists every quantitative statement of the source, with its conditions and with what its own text
contradicts. ``comparisons.toml`` says of each how it is computed here, or why it is not.

Source: P. Gu, "Chaotic Vibration in Machine Systems and Its Implications for Design", PhD thesis, Department of
Mechanical Engineering, Massachusetts Institute of Technology, 1994. Transcribed from the printed text; a number that
is only drawn in a figure is not in it.
"""

from thesis.statements.comparisons import Comparison, Tolerance, conditions, read_comparisons, read_measured
from thesis.statements.statements import Statement, read_statements

__all__ = ["Comparison", "Statement", "Tolerance", "conditions", "read_comparisons", "read_measured", "read_statements"]

"""The simulated figures of the thesis, drawn again on the machines here."""

from thesis.figures.figure import Finding, ThesisFigure
from thesis.figures.produce import Drawn, draw_figures
from thesis.figures.registry import FIGURES, chosen, listing

__all__ = ["FIGURES", "Drawn", "Finding", "ThesisFigure", "chosen", "draw_figures", "listing"]

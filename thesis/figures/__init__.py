"""What does the thesis show, and what do the machines here show in its place? Its simulated figures, drawn again."""

from thesis.figures.figure import Finding, ThesisFigure
from thesis.figures.produce import Drawn, draw_figures
from thesis.figures.registry import FIGURES, chosen, listing

__all__ = ["FIGURES", "Drawn", "Finding", "ThesisFigure", "chosen", "draw_figures", "listing"]

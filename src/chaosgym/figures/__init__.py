"""What does the thesis show, and what do the machines here show in its place? Its simulated figures, drawn again."""

from chaosgym.figures.figure import Finding, ThesisFigure
from chaosgym.figures.produce import Drawn, draw_figures
from chaosgym.figures.registry import FIGURES, chosen, listing

__all__ = ["FIGURES", "Drawn", "Finding", "ThesisFigure", "chosen", "draw_figures", "listing"]

"""The Spatial Slider Crank of the thesis."""

from chaosgym.machines.slider_crank.machine import THESIS_SLIDER_CRANK, SliderCrank

__all__ = ["THESIS_SLIDER_CRANK", "SliderCrank"]

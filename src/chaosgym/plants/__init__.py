"""Machines that are not simulated here: plants of classes, of programs behind lines, and of FMUs."""

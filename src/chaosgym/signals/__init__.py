"""Measured signals: one reader for every file, cycles of a series, and the error of a sensor."""

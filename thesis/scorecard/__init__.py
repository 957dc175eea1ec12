"""The scorecard and the calibration: how close the machines here are to the published ones."""

"""How close are the machines here to the published ones? Calibration, scorecard and figures of the thesis."""

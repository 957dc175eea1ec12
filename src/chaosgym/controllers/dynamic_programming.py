"""What is the best schedule by the table of regimes? Dynamic programming over speed, steps left and damage.

With this machine's own table it is the clairvoyant reference by which scores are measured; with the nominal table it is
what a planner does who trusts the drawing.
"""

from typing import ClassVar

import numpy as np

from chaosgym.controllers.controller import Action, Controller, Knowledge, Observation
from chaosgym.envs.forecast import Model, forecast_for, worth_of_steps


class DynamicProgramming(Controller):
    """Plays the best schedule of this machine's table; the slew limit is respected, transients are not foreseen."""

    knows: ClassVar[Knowledge] = "machine"
    model: ClassVar[Model] = "machine"

    def reset(self) -> None:
        """Solve the job from its end."""
        self._forecast = forecast_for(self.env, self.model)
        self._worth = worth_of_steps(self._forecast)
        self._damage = 0.0

    def __call__(self, observation: Observation) -> Action:
        """Go where the rest of the job is worth most."""
        forecast, step = self._forecast, self.step_of(observation)
        within = forecast.within_reach(int(forecast.place_of(self.seen(observation, "speed"))))
        worth = forecast.worth_after(self._worth[step], np.full(len(within), self._damage), within)
        place = within[worth.argmax()]
        self._damage += float(forecast.wear[forecast.level_of(self._damage), place])
        return self.command(float(forecast.speeds[place]))


class NominalProgramming(DynamicProgramming):
    """Plays the best schedule of the nominal machine's table."""

    knows = "nominal"
    model = "nominal"

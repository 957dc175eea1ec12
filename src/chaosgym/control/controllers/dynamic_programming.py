"""What is the best schedule by the table of regimes? Dynamic programming over speed, steps left and damage.

With this machine's own table it is the clairvoyant reference by which scores are measured; with the nominal table it is
what a planner does who trusts the drawing.
"""

from typing import ClassVar

import numpy as np

from chaosgym.control.controllers.controller import Action, Controller, Knowledge, Observation
from chaosgym.control.forecast import Forecast, Model, forecast_for, forecast_of, worth_of_steps
from chaosgym.envs.pools import Pool


class DynamicProgramming(Controller):
    """Plays the best schedule of this machine's table; the slew limit is respected, transients are not foreseen."""

    knows: ClassVar[Knowledge] = "machine"
    model: ClassVar[Model] = "machine"

    def forecast(self) -> Forecast:
        """What steps of the present job will bring."""
        return forecast_for(self.env, self.model)

    def reset(self) -> None:
        """Solve the job from its end."""
        self._forecast = self.forecast()
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


class NeighbourProgramming(DynamicProgramming):
    """Plays the best schedule of the mean table of the training machines that are nearest to this one.

    It is told the machine's parameters exactly, but not its table: what identifying a machine can be worth to one who
    knows the tables of the training machines alone.
    """

    neighbours: ClassVar[int] = 5

    def forecast(self) -> Forecast:
        """Mean of the forecasts of the neighbours, by the distance of their factors in tolerances."""
        pool: Pool = self.env.pool
        training = pool.sister("training")
        widths = np.array(list(pool.tolerances.values()))
        steps = (training.drawn - pool.drawn[self.env.machine_number]) / np.where(widths > 0.0, widths, 1.0)
        distance = np.linalg.norm(steps, axis=1)
        nearest = np.argsort(np.where(distance > 0.0, distance, np.inf))[: self.neighbours].tolist()
        near = [forecast_of(training, training.regimes(k), self.task) for k in nearest]
        means = {name: np.mean([getattr(one, name) for one in near], axis=0) for name in ("type_iii", "wear")}
        return near[0]._replace(**means)

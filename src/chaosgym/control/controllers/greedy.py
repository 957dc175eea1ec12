"""What does the shipped classifier achieve? The next step that promises most, by its probabilities.

The classifier judges the nominal machine at all speeds from its parameters, and what was measured at a speed that was
held for some cycles from the record of peak forces; the latter replaces the former there.
"""

from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.classifier import default_classifier
from chaosgym.control.controllers.controller import Action, Array, Controller, Observation
from chaosgym.control.forecast import forecast_for
from chaosgym.simulation.batch import at_speed

LEAST_RECORD = 8
"""Cycles at one speed from which on the record is judged."""


class GreedyClassifier(Controller):
    """Takes the speed within reach whose next step has the best expected reward."""

    knows = "nominal"

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self._classifier = default_classifier(self.env.nominal.name)
        speeds = self.env.pool.speeds
        fields = self._classifier.fields
        machines = [at_speed(self.env.nominal, float(speed)) for speed in speeds]
        values = np.array([[getattr(machine, name) for name in fields] for machine in machines])
        known = self._classifier.parameters
        self._before = self._irregular(known, values)
        self._force = known.predict_peak_force(known.features(values), values)[:, 1]

    @staticmethod
    def _irregular(known: Any, values: Array, **record: Any) -> Array:
        """Probability (n,) that a response is not periodic."""
        chances = known.predict_nature_proba(values, **record)
        return np.asarray(1.0 - chances[:, list(known.natures_).index("periodic")])

    def reset(self) -> None:
        """Forget what was measured."""
        self._chance = self._before.copy()
        self._forecast = forecast_for(self.env, "nominal")
        self._held: tuple[int, list[float]] = (-1, [])

    def __call__(self, observation: Observation) -> Action:
        """Judge what was measured, then take the best speed within reach."""
        forecast, task = self._forecast, self.task
        place = int(forecast.place_of(self.seen(observation, "speed")))
        self._note(place, self.peaks(observation))
        within = forecast.within_reach(place)
        forces = np.repeat(self._force[within, None, None], task.cycles_per_step, axis=1)
        promise = (
            forecast.time[within]
            - task.damage_weight * task.damage(forces)[:, 0]
            - task.type_iii_step * self._chance[within]
        )
        return self.command(float(forecast.speeds[within[promise.argmax()]]))

    def _note(self, place: int, peaks: Array) -> None:
        """Collect the peaks measured at a place, and judge them once there are enough."""
        record = [*self._held[1], *peaks.tolist()] if place == self._held[0] else peaks.tolist()
        self._held = (place, record)
        records = self._classifier.records
        if len(record) >= LEAST_RECORD and records is not None:
            error = np.array([self.env.rules.sensor_error])
            self._chance[place] = self._irregular(records, np.array([record[-64:]]), sensor_error=error)[0]

"""A trained agent's job on the page: the machine follows the speeds that the agent chose."""

from collections.abc import Callable
from typing import Any

from bokeh.document import Document
from bokeh.layouts import column
from bokeh.models import Button, Div

from chaosgym.control.policies import shipped_policy
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.control.rollout import play
from chaosgym.machines import Machine

MILLISECONDS = 150
"""Between two steps."""


class Playback:
    """A button that plays the job of the shipped policy on the first machine kept for evaluation."""

    def __init__(self, document: Document, show: Callable[[Machine], None]) -> None:
        self._document, self._show = document, show
        self._timer: Any = None
        self._told = Div(text="")
        self._button = Button(label="Play an agent's job", name="play")
        self._button.on_click(self._pressed)

    def panel(self, machine: Machine) -> Any:
        """The button, for a machine that an agent was trained on."""
        self._env = f"chaosgym/{type(machine).__name__}Tolerance-v1"
        self._button.visible = shipped_folder(self._env).is_dir()
        return column(self._button, self._told)

    def _pressed(self) -> None:
        if self._timer is not None:
            self._stop()
            return
        import gymnasium as gym

        self._job = play(shipped_policy(self._env), self._env, [0])
        env: Any = gym.make(self._env).unwrapped
        env.reset(options={"machine": 0})
        self._machine, self._step = env.machine, 0
        self._show(self._machine.at(float(self._job.speed[0, 0])))
        self._button.label = "Stop"
        self._timer = self._document.add_periodic_callback(self._next, MILLISECONDS)

    def _next(self) -> None:
        job, k = self._job, self._step
        if k >= len(job.speed):
            self._stop()
            return
        speed = float(job.speed[k, 0])
        self._move(speed)
        wild = "Type III" if job.type_iii[k, 0] > 0.5 else "calm"
        self._told.text = (
            f"step {k + 1} of {len(job.speed)}: asked for {job.demand[k, 0]:.2f} {job.unit}, "
            f"runs at {speed:.2f} {job.unit}, {wild}"
        )
        self._step += 1

    def _move(self, speed: float) -> None:
        """Move the speed's slider, as a hand would."""
        widget: Any = self._document.select_one({"name": self._machine.speed_field})
        widget.value = speed

    def _stop(self) -> None:
        self._document.remove_periodic_callback(self._timer)
        self._timer = None
        self._button.label = "Play an agent's job"

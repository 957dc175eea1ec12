"""An FMU in a process of its own, which is asked by lines of JSON on standard input and answers so.

Run as a script, so that it loads FMPy and the FMU alone. What the FMU prints goes to standard error. It knows no units
and no tasks: an input is held for some cycles, and the outputs are read after each step.
"""

import json
import os
import signal
import sys
from contextlib import suppress
from typing import Any

import fmpy.fmi2
import fmpy.fmi3

Bounce = list[float]
"""Side of the present episode of bouncing, 0 for none yet, and instants of its first and its last touch [s]."""


class Instance:
    """An FMU at work.

    Parameters
    ----------
    about
        ``version`` "2" or "3", ``token``, ``identifier`` and ``folder`` of the FMU; value references ``input``,
        ``outputs`` (1 or 2) and ``measured`` (0 or 1); ``start``, triples of type, value reference and value;
        ``threshold`` [N] above which a force is a contact.
    """

    def __init__(self, about: dict[str, Any]) -> None:
        self._about, self._time = about, 0.0
        kind = fmpy.fmi3.FMU3Slave if about["version"] == "3" else fmpy.fmi2.FMU2Slave
        self._fmu = kind(
            guid=about["token"],
            unzipDirectory=about["folder"],
            modelIdentifier=about["identifier"],
            instanceName="plant",
        )
        self._fmu.instantiate()
        three = about["version"] == "3"
        self._set = self._fmu.setFloat64 if three else self._fmu.setReal
        self._get = self._fmu.getFloat64 if three else self._fmu.getReal
        for name, reference, value in about["start"]:
            getattr(self._fmu, f"set{name}")([reference], [value])
        if not three:
            self._fmu.setupExperiment(startTime=0.0)
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        self._pressed = [False, False]
        self._bounce: Bounce = [0.0, 0.0, 0.0]

    def run(self, value: float, period: float, cycles: int, step: float) -> dict[str, Any]:
        """Hold the input for some cycles of a period [s], by steps [s]; return what each cycle and the whole gave."""
        self._set([self._about["input"]], [value])
        peaks, measured = [], []
        impacts, bouncing, begin = 0, 0.0, self._time
        references = [*self._about["outputs"], *self._about["measured"]]
        outputs = len(self._about["outputs"])
        for cycle in range(cycles):
            end = begin + (cycle + 1) * period
            high, low = -float("inf"), float("inf")
            while self._time + 0.5 * step < end:
                self._advance(step)
                values = self._get(references)
                upper, lower = (values[0], values[0]) if outputs == 1 else (values[0], -values[1])
                # written so that what is not a number stays
                high = high if high >= upper else upper
                low = low if low <= lower else lower
                measured += values[outputs:]
                touched, ended = self._touch((upper, -lower))
                impacts += touched
                bouncing += ended
            peaks.append([max(high, 0.0) if high == high else high, min(low, 0.0) if low == low else low])
        told = {"peaks": peaks, "impacts": impacts / cycles, "bouncing": bouncing / (cycles * period)}
        return told | ({"speed": sum(measured) / len(measured)} if measured else {})

    def _advance(self, step: float) -> None:
        try:
            answer = self._fmu.doStep(self._time, step)
        except Exception as error:
            raise RuntimeError(f"the step at t = {self._time:.6g} s failed: {error}") from None
        if answer is not None and answer[1]:
            raise RuntimeError(f"the FMU ended its simulation at t = {self._time:.6g} s")
        if answer is not None and answer[2]:
            raise RuntimeError(f"the FMU returned early from its step at t = {self._time:.6g} s")
        self._time += step

    def _touch(self, forces: tuple[float, float]) -> tuple[int, float]:
        """Contacts that began now, by the forces on both sides, and the time [s] of bouncing that ended."""
        begun, ended = 0, 0.0
        for side, force in enumerate(forces):
            pressed = force > self._about["threshold"]
            if pressed and not self._pressed[side]:
                begun += 1
                there, first, last = self._bounce
                if there != side + 1.0:
                    ended = last - first if there else 0.0
                    self._bounce[:2] = [side + 1.0, self._time]
                self._bounce[2] = self._time
            self._pressed[side] = pressed
        return begun, ended

    def end(self) -> None:
        """Let the FMU end."""
        self._fmu.terminate()
        self._fmu.freeInstance()


def main() -> None:
    """Answer lines until there are no more; Ctrl-C is for whoever asks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    instance: Instance | None = None
    for line in sys.stdin:
        word, given = json.loads(line)
        try:
            told: dict[str, Any] = {}
            if word == "reset":
                instance = Instance(given)
            elif word == "run":
                if instance is None:
                    raise RuntimeError("it does not run; call reset() first")
                told = instance.run(*given)
            elif word == "end" and instance is not None:
                ended = instance
                instance = None
                with suppress(Exception):  # after an error it may not be told to
                    ended.end()
        except Exception as error:
            told = {"error": f"{str(error).strip() or type(error).__name__}"}
        print(json.dumps(told), file=answers, flush=True)
    sys.stdout.flush()
    os._exit(0)  # without what libraries of the FMU do at the end of a process


if __name__ == "__main__":
    main()

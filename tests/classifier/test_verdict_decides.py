"""One verdict on a record: what the classifier has learned never says more than ``judge_peaks``."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lfilter

from chaosgym import default_classifier, judge_peaks
from chaosgym.classifier import RecordAnswer
from chaosgym.cli import app
from chaosgym.series import Diagnosis
from tests.classifier.made_up import settled

CYCLES = 200
NOISES = {"white 6 %": (0.0, 6.0), "AR(0.95) 6 %": (0.95, 6.0), "pink 1 %": (None, 1.0), "white 1 %": (0.0, 1.0)}
"""Memory of each random process, None for a spectrum of 1/f, and its standard deviation [N] around 100 N."""


def random_record(kind, seed):
    """Readings around 100 N that nothing but chance makes."""
    memory, size = NOISES[kind]
    white = np.random.default_rng(seed).normal(size=2 * CYCLES)
    if memory is None:
        spectrum = np.fft.rfft(white)
        spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
        spectrum[0] = 0.0
        noise = np.fft.irfft(spectrum)[:CYCLES]
    else:
        noise = lfilter([1.0], [1.0, -memory], white)[CYCLES:]
    return 100.0 + size * (noise - noise.mean()) / noise.std()


def agrees(answer):
    """The keys of an answer, each as ``--json`` prints it, say one thing."""
    chances, nature = answer["nature_probabilities"], answer["nature"]
    assert answer["abstained"] == (nature == "undetermined")
    assert bool(chances) == bool(answer["plausible"])
    assert not chances or (max(chances, key=chances.get) == nature and nature in answer["plausible"])
    assert nature not in ("undetermined", "quasiperiodic") or not chances
    assert chances or answer["reason"]


def printed(peaks, tmp_path, *options):
    """Text and JSON of ``classify``, and the JSON of ``judge``, on a record."""
    np.savetxt(tmp_path / "peaks.csv", peaks, header="peak [N]", comments="")
    record = (str(tmp_path / "peaks.csv"), *options)
    commands = (("classify", "impact-beam"), ("classify", "impact-beam", "--json"), ("judge", "--json"))
    text, answer, verdict = (CliRunner().invoke(app, [*words, *record]).stdout for words in commands)
    return text, json.loads(answer), json.loads(verdict)


@pytest.mark.parametrize("error", [None, 0.4])
@pytest.mark.parametrize("kind", NOISES)
@pytest.mark.parametrize("seed", range(10))
def test_random_readings_are_never_called_chaotic(kind, error, seed):
    """Noise is not chaos, whatever the classifier, which has seen machines alone, makes of it."""
    peaks = random_record(kind, seed)
    verdict = judge_peaks(peaks, sensor_error=error).diagnosis
    answer = default_classifier("impact-beam").classify_record(peaks, sensor_error=error).under(verdict)
    assert verdict.nature != "chaotic"
    assert answer.nature == verdict.nature
    assert "chaotic" not in answer.plausible
    assert answer.nature_probabilities.get("chaotic", 0.0) < 0.5
    agrees(answer.as_dict())


@pytest.mark.parametrize("options", [(), ("--sensor-error", "0.4 N")])
def test_commands_say_the_same_of_a_random_record(tmp_path, options):
    """``classify`` and ``judge`` call white noise of 6 % undetermined, in text and JSON, without a probability."""
    text, answer, verdict = printed(random_record("white 6 %", 0), tmp_path, *options)
    assert answer["nature"] == verdict["nature"] == answer["verdict"]["nature"] == "undetermined"
    assert "chaotic  " not in text
    assert re.search(r"no answer(: | \()the verdict is undetermined", text)
    agrees(answer)


def test_commands_say_the_same_of_chaos(tmp_path):
    """The logistic map at 3.9 is chaotic to both commands; then the learned probability is printed."""
    text, answer, verdict = printed(settled(3.9, 500), tmp_path, "--sensor-error", "0.1 N")
    assert answer["nature"] == verdict["nature"] == "chaotic"
    assert "exact nature: chaotic" in text
    assert answer["nature_probabilities"]["chaotic"] > 0.8
    agrees(answer)


LEARNED = RecordAnswer(
    irregular=True,
    irregular_probability=0.9,
    amplitude=2.0,
    nature="chaotic",
    nature_probabilities={"chaotic": 0.9, "periodic": 0.1},
    period=None,
    plausible=("chaotic",),
    abstained=False,
    reason="",
)


def test_a_verdict_within_the_error_leaves_no_learned_irregularity():
    """A record that is periodic within the sensor's error is not irregular beyond it; under a condition it may be."""
    calm = Diagnosis(nature="periodic", period=2, margin=1.0, reason="repeats", evidence={})
    answer = LEARNED.under(calm)
    assert (answer.nature, answer.period, answer.abstained) == ("periodic", 2, False)
    assert answer.irregular is answer.irregular_probability is None
    assert answer.reason == "the verdict contradicts what is learned"
    assert answer.nature_probabilities == {}
    scattering = replace(calm, condition="if its scatter of 2 % is random")
    assert LEARNED.under(scattering).irregular is True


def test_probabilities_stand_only_beside_a_plausible_nature():
    """A nature that is likelier than chaos, and yet outside what is plausible, is the verdict's alone."""
    peaks = 100.0 + np.random.default_rng(5).normal(size=300)
    learned = default_classifier("impact-beam").classify_record(peaks)
    assert (learned.nature, learned.plausible) == ("periodic", ("chaotic",))
    found = learned.under(judge_peaks(peaks).diagnosis)
    assert (found.nature, found.plausible, dict(found.nature_probabilities)) == ("periodic", (), {})
    assert found.reason == "the verdict contradicts what is learned"

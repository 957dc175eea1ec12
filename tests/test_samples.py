"""The recordings that the documentation judges: where they come from, and that their nature is no luck of one noise."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.documentation.sample_recordings import recordings
from chaosgym import judge_peaks, read_recording

DATA = Path(__file__).parents[1] / "docs" / "data"
NATURES = {"periodic": "periodic, period 1", "chaotic": "chaotic for at least 2000 cycles"}


@pytest.mark.parametrize("nature", NATURES)
def test_a_sample_is_decided_without_a_condition(nature):
    """A sensor that errs by 1 N tells the nature of the file, which names its machine, sensor and seed."""
    path = DATA / f"{nature}.csv"
    (peaks,) = read_recording(path).columns.values()
    assert judge_peaks(peaks, sensor_error=1.0).diagnosis.words == NATURES[nature]
    origin = path.read_text().splitlines()[:2]
    for word in ("Hz", "clearance", "sensor error", "default_rng(0)"):
        assert any(word in line for line in origin)


def test_other_errors_of_the_sensor_give_the_same_verdicts():
    """The machine decides, not the seed: three other noises leave both natures as they are."""
    for seed in range(1, 4):
        for file, text in recordings(seed).items():
            peaks = np.array(text.splitlines()[3:], float)
            assert judge_peaks(peaks, sensor_error=1.0).diagnosis.words == NATURES[file.removesuffix(".csv")], seed


def test_the_periodic_sample_is_what_its_command_makes():
    """The periodic file comes from the machine and the seed that it names; chaos would differ by its last digits."""
    made = recordings()["periodic.csv"].splitlines()
    shipped = (DATA / "periodic.csv").read_text().splitlines()
    assert made[:3] == shipped[:3]
    np.testing.assert_allclose(np.array(made[3:], float), np.array(shipped[3:], float), atol=0.011)

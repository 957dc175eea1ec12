"""Peaks or a series: files of both kinds are told apart, and those that may be either are refused."""

import numpy as np
import pytest

from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.recordings.kind import kind_of, looks_sampled
from chaosgym.recordings.read import read_recording
from chaosgym.simulation import simulate
from tests.recordings.records import KINDS, make

PEAKS = 50.0 + 10.0 * np.sin(2.4 * np.arange(200) ** 1.3)
"""Readings that jump from each to the next."""

SAMPLES = 20.0 * np.maximum(np.sin(0.2 * np.arange(600)), 0.0)
"""A force that comes and goes."""


def recording(tmp_path, heading, *columns):
    """A file of these columns."""
    path = tmp_path / "file.csv"
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=heading, comments="")
    return read_recording(path)


def kind(told, column="force", **stated):
    """What the file is taken for."""
    return kind_of(told, told.columns[column], **stated).kind


def test_records_of_every_kind_are_taken_for_peaks():
    """Drift, regimes, lost cycles and chaos: of 20 records of each kind, one in a hundred is refused at the most."""
    every = [make(name, 7000 + seed).peaks for name in KINDS if "simulated" not in name for seed in range(20)]
    assert sum(bool(looks_sampled(peaks)) for peaks in every) <= 2


@pytest.mark.parametrize("samples", [16, 64, 256])
@pytest.mark.parametrize("machine", [ImpactBeam(excitation_frequency=19.0), ImpactBeam(), SliderCrank()])
def test_forces_and_motions_of_machines_look_sampled(machine, samples):
    """From 16 samples a cycle on, with a sensor's noise of 1 % of the largest force, signed or not."""
    history = simulate(machine, 40, transient=50, samples_per_cycle=samples).history.reshape(-1, 3)
    force, noise = history[:, 2], np.random.default_rng(0).normal(size=len(history))
    force = force + 0.01 * np.abs(force).max() * noise
    for signal in (force, np.abs(force), history[:, 0], 5.0 * np.ptp(history[:, 0]) + history[:, 0]):
        assert looks_sampled(signal)


def test_a_file_with_neither_rate_nor_times_holds_peaks(tmp_path):
    """A count of the cycles is no time."""
    assert kind(recording(tmp_path, "cycle,force [N]", np.arange(1, 201), PEAKS)) == "peaks"
    assert kind(recording(tmp_path, "force [N]", PEAKS)) == "peaks"


def test_times_and_rates_make_a_series(tmp_path):
    """Fast times by themselves, slow ones if the readings swing on a curve."""
    for step, signal in ((1e-4, PEAKS), (1e-4, SAMPLES), (0.05, SAMPLES)):
        told = recording(tmp_path, "time [s],force [N]", step * np.arange(len(signal)), signal)
        assert kind(told) == "series"


def test_samples_without_a_rate_are_refused(tmp_path):
    """A column of forces over time that lost its times is no record of peaks; stated as such, it is taken so."""
    told = recording(tmp_path, "force [N]", SAMPLES)
    with pytest.raises(DiagnosisError, match=r"rest between impacts.*rate-hz=.*as=peaks"):
        kind(told)
    assert kind(told, stated="peaks") == "peaks"
    assert kind(told, of_series="a rate of 100 Hz") == "series"
    signed = recording(tmp_path, "acc [g]", np.random.default_rng(0).normal(size=500))
    with pytest.raises(DiagnosisError, match="swing about zero"):
        kind(signed, "acc")


@pytest.mark.parametrize("heading", ["time [s],force [N]", "stamp,force [N]"])
def test_stamped_peaks_may_be_either(tmp_path, heading):
    """Twenty readings a second that jump: one a cycle of 20 Hz, or a slow machine sampled; the file cannot tell."""
    told = recording(tmp_path, heading, 0.05 * np.arange(200), PEAKS)
    with pytest.raises(DiagnosisError, match=r"20 readings a second.*state --read as=peaks, or --read as=series"):
        kind(told)
    assert kind(told, stated="peaks") == "peaks"


def test_a_rate_of_one_that_a_recorder_writes_by_default_is_no_proof(tmp_path):
    """LabVIEW writes an increment of 1 s where none was set."""
    from dataclasses import replace

    told = replace(recording(tmp_path, "force [N]", PEAKS), rates={"wf_increment": 1.0})
    with pytest.raises(DiagnosisError, match="states a rate of 1 Hz"):
        kind(told)

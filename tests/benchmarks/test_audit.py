"""Loopholes, and how far the tables agree with a full diagnosis."""

import numpy as np
import pytest

from benchmarks.envs.audit import Plan, audit, plans_of
from benchmarks.envs.regime_check import check_regimes
from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.regimes import RegimeTable
from chaosgym.errors import ParameterError


def test_every_edge_is_dithered_over_and_hugged() -> None:
    """Two edges of one band give two pairs and two speeds beside them, none of which the table takes for the band's."""
    speeds = np.array([4.0, 5.0, 6.0, 7.0])
    table = RegimeTable(speeds, np.array([0, 2, 2, 0], np.int8), np.ones(4), np.ones(4))
    plans = list(plans_of(SpeedDrive(lowest_speed=4.0, highest_speed=7.0, slew_limit=0.5), table))
    assert [plan.speeds for plan in plans if plan.kind == "dithering"] == [(4.0, 5.0), (6.0, 7.0)]
    beside = [plan.speeds[0] for plan in plans if plan.kind == "beside an edge"]
    assert beside == pytest.approx([4.49, 6.51])
    assert not table.is_type_iii(beside).any()
    assert plans[-1] == Plan("sweeping", (7.0, 4.0), 6)


@pytest.mark.slow
def test_no_loophole_beats_the_best_constant_speed_of_the_beam() -> None:
    """Neither dithering, nor hugging an edge, nor sweeping returns more, and no step has a positive reward."""
    scores = audit("chaosgym/ImpactBeam-v0")
    best = max(score.total for score in scores if score.plan.kind == "constant")
    assert all(score.total < best for score in scores if score.plan.kind != "constant")
    assert max(score.best_step for score in scores) < 0.0
    assert sum(score.status == "job_done" for score in scores) > len(scores) / 2


def test_too_large_a_sample_is_named() -> None:
    """The jobs that are sampled have a finite number of steps."""
    with pytest.raises(ParameterError, match="samples = 100000 is out of range; allowed: 1 to"):
        check_regimes("chaosgym/ImpactBeamTolerance-v0", samples=100_000)


@pytest.mark.slow
def test_the_tables_of_the_beam_agree_with_a_full_diagnosis() -> None:
    """Of the steps of random jobs on held-out machines most are what a full diagnosis says."""
    found = check_regimes("chaosgym/ImpactBeamTolerance-v0", samples=40)
    assert found.samples == 40
    assert found.as_dict()["agreement"] > 0.6

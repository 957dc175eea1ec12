from chaosgym.machines import ImpactBeam
from thesis.figures.criterion import criterion_rate


def test_criterion_rate_counts():
    """Two of three chaotic points expected, one false expectation, one quiet point."""
    machines = [
        ImpactBeam(),
        ImpactBeam(),
        ImpactBeam(excitation_frequency=5.0),
        ImpactBeam(),
        ImpactBeam(clearance=1e-5),
    ]
    rate = criterion_rate(machines, ["chaotic", "chaotic", "chaotic", "periodic", "periodic"])
    assert (rate.points, rate.hit_rate, rate.precision, rate.quiet) == (5, 2 / 3, 2 / 3, 0.5)

"""The demo with a smaller sweep and fewer machines: ``python tests/small_demo.py demo`` and its options."""

from chaosgym import demo
from chaosgym.cli import main
from chaosgym.sweeps import Axis

SMALL = {
    "AXES": (Axis("excitation_frequency", 6.0, 30.0, 24, "log"), Axis("clearance", 1.07e-4, 1.47e-4, 5)),
    "TRAINING_STEPS": 3840,
    "MACHINES": 2,
}
"""What becomes of the constants of the demo; ``--train`` learns once from 60 steps of each of 64 machines."""

if __name__ == "__main__":
    vars(demo).update(SMALL)
    main()

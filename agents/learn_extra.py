"""Ends a script in one line where a package of the extra [learn] is missing: imported before these."""

import sys

try:
    import sb3_contrib  # noqa: F401
    import stable_baselines3  # noqa: F401
    import torch  # noqa: F401
except ImportError as error:
    sys.exit(f"Error: training needs the extra [learn]: pip install '.[learn]' in a clone of chaosgym ({error})")

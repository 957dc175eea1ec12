"""``python -m thesis scorecard|figures|calibrate``."""

from thesis.cli import main

main()

"""What the classifier's answers cost and are worth, and what a monitor misses."""

"""The contest of classifiers on held-out machines."""

"""Branches of periodic orbits of a machine: bifurcations, margins, routes to chaos."""

"""Audits of the environments."""

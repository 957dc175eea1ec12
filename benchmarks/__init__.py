"""Numbers about chaosgym itself, which a reader can rerun."""

"""Exploration in a browser: a machine's response while its sliders are dragged (extra ``[explore]``)."""

"""The picture of a machine in motion: moments that the browser shows one by one, and a button that holds them."""

from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.layouts import column
from bokeh.models import ColumnDataSource, CustomJS, DataRange1d, Div, Toggle
from bokeh.plotting import figure

from chaosgym.arrays import Array
from chaosgym.explore.point import FRAMES, PointView
from chaosgym.machines.picture import EDGE, INK, Shape, Sketch
from chaosgym.plotting.style import NATURE_COLOURS

MILLISECONDS = 33
"""From one moment to the next."""

PIXELS = 1.2
"""Pixels of a point of print."""

MARKERS = {"o": "circle", "^": "triangle", "v": "inverted_triangle"}
BASELINES = {"top": "top", "center": "middle", "bottom": "bottom"}

LOOKS = {name: name for name in ("line_color", "line_width", "line_alpha")}
FILLS = {name: name for name in ("fill_color", "fill_alpha")}

PLAY = f"""
const FRAMES = {FRAMES}, MILLISECONDS = {MILLISECONDS}
const at = (moving, k) => {{
    const n = moving.length / FRAMES
    return n == 1 ? moving[k] : new Float32Array(moving.buffer, moving.byteOffset + 4 * k * n, n)
}}
const show = k => Object.values(sources).forEach(source => {{
    const {{x, y, moving_x, moving_y, text, moving_text}} = source.data
    moving_x?.forEach((moving, i) => {{
        if (moving.length) [x[i], y[i]] = [at(moving, k), at(moving_y[i], k)]
    }})
    moving_text?.forEach((told, i) => {{ text[i] = told[k % told.length] }})
    source.change.emit()
}})
const began = performance.now() - (button.frame ?? 0) * MILLISECONDS
const step = now => {{
    if (!button.active || !panel.visible) return
    const k = Math.max(0, Math.floor((now - began) / MILLISECONDS)) % FRAMES
    if (k != button.frame) show(button.frame = k)
    button.loop = requestAnimationFrame(step)
}}
button.label = button.active ? "Pause" : "Play"
cancelAnimationFrame(button.loop)
show(button.frame ??= 0)
if (button.active) button.loop = requestAnimationFrame(step)
"""
"""Shows the moment at which the picture stands, and goes on from there while the button is pressed."""

CALM = "if (matchMedia('(prefers-reduced-motion: reduce)').matches) button.active = false"
"""Holds the picture of those who asked their browser for little motion."""


class MovingSketch:
    """The picture and its button; nothing is asked of the server while it moves."""

    def __init__(self, document: Document) -> None:
        self._corners = ColumnDataSource({"x": [], "y": []})
        empty = _columns(Sketch("", np.zeros(2), np.zeros(2), ()), INK)
        self._sources = {layer: ColumnDataSource(empty[layer], name=f"moving {layer}") for layer in empty}
        self._figure = figure(height=210, match_aspect=True, toolbar_location=None, name="moving")
        self._told = Div(sizing_mode="stretch_width")
        self._button = Toggle(active=True, label="Pause", width=80, name="pause")
        self.panel = column(self._figure, self._told, self._button, visible=False, sizing_mode="stretch_width")
        self._draw()
        play = CustomJS(args={"sources": self._sources, "button": self._button, "panel": self.panel}, code=PLAY)
        self._button.js_on_change("active", play)
        for source in self._sources.values():
            source.js_on_change("data", play)
        document.js_on_event("document_ready", CustomJS(args={"button": self._button}, code=CALM), play)

    def show(self, view: PointView) -> None:
        """Follow a view; hide where there is no picture."""
        self.panel.visible = view.sketch is not None
        if view.sketch is None:
            return
        sketch = view.sketch
        slower = 1e-3 * FRAMES * MILLISECONDS / view.span
        pace = f"{slower:,.1f} times slower" if slower >= 1.0 else f"{1.0 / slower:,.1f} times faster"
        self._told.text = f"{sketch.title}. Shown {pace} than it moves."
        self._corners.data = dict(zip("xy", np.stack([sketch.low, sketch.high], axis=1), strict=True))
        for layer, columns in _columns(sketch, NATURE_COLOURS[view.nature]).items():
            self._sources[layer].data = columns

    def _draw(self) -> None:
        made: Any = self._figure
        corner = made.scatter("x", "y", source=self._corners, alpha=0.0)
        made.x_range, made.y_range = (DataRange1d(renderers=[corner], range_padding=0.0) for _ in range(2))
        made.axis.visible, made.grid.visible, made.outline_line_color = False, False, None
        made.sizing_mode = "stretch_width"
        source = self._sources
        made.multi_line("x", "y", source=source["back"], **LOOKS)
        made.patches("x", "y", source=source["body"], **LOOKS, **FILLS)
        made.multi_line("x", "y", source=source["line"], line_cap="round", **LOOKS)
        made.scatter("x", "y", source=source["dot"], size="size", marker="marker", **LOOKS, **FILLS)
        words = {"text_align": "align", "text_baseline": "baseline", "text_font_size": "11px", "text_color": INK}
        made.text("x", "y", text="text", source=source["words"], **words)


def _columns(sketch: Sketch, colour: str) -> dict[str, dict[str, Any]]:
    """Columns of each layer's source, a row for each line, outline, dot and text."""
    words = {
        "x": [each.place[0] for each in sketch.words],
        "y": [each.place[1] for each in sketch.words],
        "text": [each.text[0] for each in sketch.words],
        "moving_text": [list(each.text) for each in sketch.words],
        "align": [each.across for each in sketch.words],
        "baseline": [BASELINES[each.up] for each in sketch.words],
    }
    layers = ("back", "body", "line", "dot")
    return {layer: _rows([shape for shape in sketch.shapes if shape.kind == layer], colour) for layer in layers} | {
        "words": words
    }


def _rows(shapes: list[Shape], colour: str) -> dict[str, Any]:
    """Columns of shapes of one kind: places at the first moment and, where they move, those of all in a row."""
    names = ("x", "y", "moving_x", "moving_y", *LOOKS, *FILLS, "size", "marker")
    rows = []
    for shape in shapes:
        edge = shape.colour or colour
        width = PIXELS * shape.width * (EDGE if shape.kind == "dot" else 1.0)
        looks = (edge, width, shape.alpha, shape.fill or edge, shape.alpha)
        for track in _tracks(shape):
            first = track[0, 0] if shape.kind == "dot" else track[0]
            all_of_them = track.astype(np.float32).reshape(-1, 2) if len(track) > 1 else np.empty((0, 2), np.float32)
            moving = [np.ascontiguousarray(way) for way in all_of_them.T]
            rows.append((*first.T.tolist(), *moving, *looks, PIXELS * shape.width, MARKERS[shape.marker]))
    return {name: [row[i] for row in rows] for i, name in enumerate(names)}


def _tracks(shape: Shape) -> list[Array]:
    """What makes a row of its source each (moments, points, 2): a dot, a line, or all pale lines with gaps between."""
    points = shape.points
    if shape.kind == "dot":
        return [points[:, i, j : j + 1] for i in range(points.shape[1]) for j in range(points.shape[2])]
    if shape.kind == "back":
        parted = np.concatenate([points, np.full_like(points[:, :, :1], np.nan)], axis=2)
        return [parted.reshape(len(points), -1, 2)]
    return [points[:, i] for i in range(points.shape[1])]

"""The page and its server on this computer: sliders, pictures that follow them, the verdict, the point as command."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from html import escape
from itertools import islice
from typing import Any

import numpy as np
from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import (
    BoxAnnotation,
    Button,
    ColumnDataSource,
    CustomJS,
    Div,
    Range1d,
    Select,
    Span,
    TextAreaInput,
)
from bokeh.models import Slider as Widget
from bokeh.plotting import figure
from bokeh.server.server import Server

from chaosgym.arrays import Array
from chaosgym.diagnosis import CalmRegion
from chaosgym.errors import ChaosgymError
from chaosgym.explore.gate import guard, new_secret
from chaosgym.explore.moving import MovingSketch
from chaosgym.explore.playback import Playback
from chaosgym.explore.point import (
    LOOKING,
    PointView,
    beside_of,
    command_of,
    link_of,
    machine_from,
    orbit_diagram,
    python_of,
    sliders_of,
    view_of,
)
from chaosgym.explore.safe import calm_search
from chaosgym.explore.saving import save_buttons
from chaosgym.explore.worker import Worker
from chaosgym.machines import MACHINES, Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.plotting.labels import called
from chaosgym.plotting.style import ACCENT, BAD, INK, MUTED, NATURE_COLOURS, PALE

PAUSE = 15
"""Milliseconds for which movements of a slider are gathered before the page follows."""

AT_ONCE = 4
"""Speeds of the orbit diagram, or runs of the calm region, that are computed between two looks at the sliders."""

TOOLS = "pan,wheel_zoom,box_zoom,reset,save"

SEEN_SCATTER = 0.01
"""Share of the motion that the axes of the section span at the least: a periodic motion scatters by rounding alone."""

NUMBERS = 400
"""Steps of a slider."""

LISTEN = """
const time = Array.from(motion.data.time, t => t / 1000), force = Array.from(motion.data.f, Math.abs)
const sound = new AudioContext(), span = time[time.length - 1] - time[0]
const buffer = sound.createBuffer(1, Math.ceil(span * sound.sampleRate), sound.sampleRate)
const samples = buffer.getChannelData(0), loudest = Math.max(...force) || 1
for (let k = 0, n = 0; k < samples.length; k++) {
    while (n < time.length - 2 && time[n + 1] - time[0] < k / sound.sampleRate) n++
    samples[k] = 0.8 * force[n] / loudest
}
const source = sound.createBufferSource()
source.buffer = buffer
source.loop = true
source.connect(sound.destination)
source.start()
source.stop(sound.currentTime + 3)
source.onended = () => sound.close()
"""
"""Three seconds of the contact force as sound: every impact is a click."""


NARROW = "@media (max-width: 900px) { :host { display: block !important } :host > * { width: calc(100% - 10px) } }"
WRAPS = ":host { flex-wrap: wrap }"
"""Rows that become a column on a narrow page, and rows that go on in the next line."""

TEMPLATE = """{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">
<style>html { scrollbar-gutter: stable } body { margin: 8px }</style>{% endblock %}
"""

HELP = (
    "Drag a slider: pictures and verdict follow. Below, <em>Save picture</em> keeps them with the settings, "
    "<em>Save command</em> the line that repeats them."
)

CALM_BY = "Type I: periodic throughout the tolerances of speed and clearance, by runs from rest."

LABEL = """
const roots = node => [...node.querySelectorAll('*')].flatMap(
    each => each.shadowRoot ? [each.shadowRoot, ...roots(each.shadowRoot)] : [])
const label = () => roots(document).forEach(root => {
    const title = root.querySelector('.bk-slider-title')
    root.querySelectorAll('.noUi-handle').forEach(
        handle => handle.setAttribute('aria-label', title ? title.textContent.split(':')[0] : 'value'))
})
label()
setInterval(label, 1000)
"""
"""Names the handles of the sliders, which Bokeh leaves without; sliders change with the machine."""


class Page:
    """The state behind one opened page.

    Parameters
    ----------
    document
        Bokeh's document of the session.
    machine
        What it shows first; a deep link overrides it.
    """

    def __init__(self, document: Document, machine: Machine) -> None:
        self._document, self.machine = document, machine
        self._waits = False
        self._region: CalmRegion | None = None
        self._search: Iterator[CalmRegion | None] | None = None
        self._worker, self._searcher = Worker(document), Worker(document)
        self._sources = {
            "motion": ColumnDataSource({"time": [], "x": [], "v": [], "f": []}),
            "section": ColumnDataSource({"x": [], "v": []}),
            "peaks": ColumnDataSource({"n": [], "peak": []}),
            "orbit": ColumnDataSource({"speed": [], "peak": []}),
        }
        self._window = Range1d(), Range1d()
        self._stops = [BoxAnnotation(fill_color=MUTED, fill_alpha=0.25) for _ in range(4)]
        self._here = Span(dimension="height", line_color=BAD, line_width=2)
        self._verdict = Div(sizing_mode="stretch_width")
        self._beside = Div(sizing_mode="stretch_width", name="beside")
        self._heading = Div(sizing_mode="stretch_width", name="heading")
        self._calm = Div(sizing_mode="stretch_width", name="calm")
        self._link = Div(visible=False, name="link")
        self._python = TextAreaInput(title="This point as Python", rows=5, sizing_mode="stretch_width", name="python")
        self._command = TextAreaInput(title="and as a command", rows=2, sizing_mode="stretch_width", name="command")
        choices: list[Any] = [(name, name) for name in MACHINES if name != machine.name]
        self._choice = Select(title="machine", value=machine.name, options=[*choices, (machine.name, called(machine))])
        self._choice.on_change("value", lambda name, old, new: self.show(MACHINES[new]()))
        self._panel = column(width=340, max_width=340)
        self._moving = MovingSketch(document)
        self._playback = Playback(document, self.show)
        document.template = TEMPLATE
        document.js_on_event("document_ready", CustomJS(code=LABEL))
        document.add_root(self._layout())
        self.show(machine)

    def show(self, machine: Machine) -> None:
        """Go to a machine: its sliders, and everything that follows from them."""
        self.machine, self._document.title = machine, f"{called(machine)} - chaosgym"
        self._heading.text = f'<h1 style="font-size:1.4em;margin:0">{escape(called(machine))}</h1>'
        self._choice.update(value=machine.name)
        self._sliders = sliders_of(machine)
        self._widgets = [self._widget(place) for place in range(len(self._sliders))]
        told = self._verdict, self._beside, self._calm
        self._panel.children = [self._choice, *self._widgets, self._playback.panel(machine), *told]
        self._follow()
        self._restart()

    def _widget(self, place: int) -> Widget:
        slider = self._sliders[place]
        low, high = slider.factor * slider.low, slider.factor * slider.high
        widget = Widget(
            title=slider.label,
            start=low,
            end=high,
            step=(high - low) / NUMBERS,
            value=slider.factor * float(getattr(self.machine, slider.field)),
            format="0.0000" if high < 1.0 else "0.00",
            sizing_mode="stretch_width",
            name=slider.field,
        )
        widget.on_change("value", lambda name, old, new: self._moved(place, new))
        return widget

    def _moved(self, place: int, value: float) -> None:
        slider = self._sliders[place]
        self.machine = with_settings(self.machine, {slider.field: value / slider.factor})
        if not self._waits:
            self._waits = True
            self._document.add_timeout_callback(self._follow, PAUSE)
        if place > 0:
            self._restart()

    def _follow(self) -> None:
        """Let everything but the orbit diagram follow the machine."""
        self._waits = False
        self._worker.ask("view", partial(view_of, self.machine), self._show_view)
        self._show_beside((LOOKING,))
        self._searcher.ask("motions", partial(beside_of, self.machine), self._show_beside)
        self._link.text = link_of(self.machine)
        self._python.value, self._command.value = python_of(self.machine), command_of(self.machine)
        self._here.location = float(getattr(self.machine, self.machine.speed_field))
        self._show_calm()

    def _show_view(self, view: PointView) -> None:
        self._draw(view)
        self._moving.show(view)
        colour = NATURE_COLOURS[view.nature]
        headline = f'<h2 style="color:{colour};margin:4px 0 8px">{escape(view.headline)}</h2>'
        self._verdict.text = headline + _paragraphs(view.lines)

    def _show_beside(self, lines: tuple[str, ...]) -> None:
        self._beside.text = _paragraphs(lines)

    def _draw(self, view: PointView) -> None:
        millimetres = 1e3 * view.displacement
        self._sources["motion"].data = {
            "time": 1e3 * view.time,
            "x": millimetres,
            "v": view.velocity,
            "f": view.force,
        }
        across, along = 1e3 * view.section[:, 0], view.section[:, 1]
        self._sources["section"].data = {"x": across, "v": along}
        for shown, dots, moved in zip(self._window, (across, along), (millimetres, view.velocity), strict=True):
            _show_around(shown, dots, float(np.ptp(moved)))
        self._sources["peaks"].data = {"n": np.arange(1, len(view.peaks) + 1), "peak": view.peaks}
        for box, (field, side) in zip(self._stops, (("bottom", 1), ("top", 0), ("left", 1), ("right", 0)), strict=True):
            place = view.room[side]
            box.update(**{field: 1e3 * place if math.isfinite(place) else None}, visible=math.isfinite(place))

    def _restart(self) -> None:
        """Begin anew what does not depend on the speed; it goes on piece by piece, and the sliders work meanwhile."""
        self._start_diagram()
        self._region, self._search = None, calm_search(self.machine, *self._sliders[:2])
        self._show_calm()
        self._more_calm()

    def _more_calm(self) -> None:
        search = self._search or iter(())
        self._worker.ask("calm region", lambda: (search, list(islice(search, AT_ONCE))), self._take_calm)

    def _take_calm(self, answer: tuple[Any, list[CalmRegion | None]]) -> None:
        search, found = answer
        if search is not self._search:
            return
        self._region = next((region for region in reversed(found) if region), self._region)
        if found:
            self._more_calm()
        else:
            self._search = None
        if not found or any(found):
            self._show_calm()

    def _show_calm(self) -> None:
        """Tell the calm region so far, with the speed that the machine has at present."""
        lines = [] if self._region is None else replace(self._region, machine=self.machine).lines
        lines += ["looking for calm speeds and clearances ..."] if self._search else [CALM_BY]
        self._calm.text = f'<h3 style="margin:4px 0 8px">What is calm</h3>{_paragraphs(lines)}'

    def _start_diagram(self) -> None:
        self._orbit = orbit_diagram(self.machine, self._sliders[0])
        self._sources["orbit"].data = {"speed": [], "peak": []}
        self._speed_axis.axis_label = self._sliders[0].label
        self._more_diagram()

    def _more_diagram(self) -> None:
        orbit = self._orbit
        self._worker.ask("diagram", lambda: (orbit, list(islice(orbit, AT_ONCE))), self._show_diagram)

    def _show_diagram(self, answer: tuple[Any, list[tuple[float, Any]]]) -> None:
        orbit, found = answer
        if orbit is self._orbit and found:
            speeds = [speed for speed, peaks in found for _ in peaks]
            self._sources["orbit"].stream({"speed": speeds, "peak": [peak for _, peaks in found for peak in peaks]})
            self._more_diagram()

    def _figure(self, title: str, across: str, up: str, **options: Any) -> Any:
        made = figure(
            title=title, x_axis_label=across, y_axis_label=up, height=250, tools=TOOLS, active_drag=None, **options
        )
        made.toolbar.logo = None
        made.toolbar.autohide = True
        made.sizing_mode = "stretch_width"
        made.grid.grid_line_color = PALE
        made.outline_line_color = None
        made.title.text_color = INK
        return made

    def _layout(self) -> Any:
        motion, section, peaks, orbit = self._sources.values()
        moves = self._figure("Motion between the stops", "time [ms]", "displacement [mm]")
        moves.line("time", "x", source=motion, color=ACCENT)
        force = self._figure("Contact force", "time [ms]", "force [N]", x_range=moves.x_range)
        force.line("time", "f", source=motion, color=ACCENT)
        portrait = self._figure("Phase portrait", "displacement [mm]", "velocity [m/s]")
        portrait.line("x", "v", source=motion, color=ACCENT)
        window = {"x_range": self._window[0], "y_range": self._window[1]}
        strobe = self._figure("Once a cycle: stroboscopic section", "displacement [mm]", "velocity [m/s]", **window)
        strobe.name = "section"
        strobe.xaxis[0].ticker.desired_num_ticks = 4
        strobe.scatter("x", "v", source=section, size=4, color=NATURE_COLOURS["chaotic"])
        record = self._figure("Peak force of every settled cycle", "cycle", "peak force [N]")
        record.scatter("n", "peak", source=peaks, size=3, color=ACCENT)
        record.y_range.start = 0
        diagram = self._figure("Orbit diagram: peak forces over speed", "speed", "peak force [N]")
        diagram.scatter("speed", "peak", source=orbit, size=2, color=INK, alpha=0.6)
        diagram.add_layout(self._here)
        self._speed_axis = diagram.xaxis[0]
        for box in self._stops[:2]:
            moves.add_layout(box)
        for box in self._stops[2:]:
            portrait.add_layout(box)
        keep_link = CustomJS(args={"link": self._link}, code="history.replaceState(null, '', '?' + link.text)")
        self._link.js_on_change("text", keep_link)
        self._figures = [moves, force, portrait, strobe, diagram, record]
        pictures = column(
            _row(moves, force),
            _row(portrait, strobe),
            _row(diagram, record),
            _row(self._python, column(self._command, self._buttons(), sizing_mode="stretch_width")),
            sizing_mode="stretch_width",
        )
        machine = column(self._moving.panel, self._panel, width=340, max_width=340)
        help_line = Div(text=HELP, sizing_mode="stretch_width")
        return column(self._heading, help_line, _row(machine, pictures), self._link, sizing_mode="stretch_width")

    def _buttons(self) -> Any:
        """Buttons that save or copy the point, and one that plays the impacts."""
        buttons = []
        for label, source, code in (
            ("Copy Python", self._python, "text.value"),
            ("Copy command", self._command, "text.value"),
            ("Copy link", self._link, "location.href"),
        ):
            button = Button(label=label, width=120)
            button.js_on_click(CustomJS(args={"text": source}, code=f"navigator.clipboard.writeText({code})"))
            buttons.append(button)
        told = [self._heading, self._verdict, self._beside, self._calm]
        saves = save_buttons(self._figures, told, self._command)
        listen = Button(label="Listen", width=120)
        listen.js_on_click(CustomJS(args={"motion": self._sources["motion"]}, code=LISTEN))
        return row(*saves, *buttons, listen, sizing_mode="stretch_width", stylesheets=[WRAPS])


def _show_around(window: Range1d, dots: Array, moved: float) -> None:
    """Let a range span the dots, and at least a share of what the motion ``moved``."""
    half = max(0.55 * float(np.ptp(dots)), 0.5 * SEEN_SCATTER * moved) or 1.0
    middle = 0.5 * float(dots.min() + dots.max())
    ends = middle - half, middle + half
    window.update(start=ends[0], end=ends[1], reset_start=ends[0], reset_end=ends[1])


def _paragraphs(lines: Iterable[str]) -> str:
    return "".join(f'<p style="margin:0 0 8px">{escape(line)}</p>' for line in lines)


def _row(*parts: Any) -> Any:
    return row(*parts, sizing_mode="stretch_width", stylesheets=[NARROW])


def open_page(document: Document, machine: Machine) -> None:
    """Fill a document with the page; the request's query, if there is one, says which machine."""
    context: Any = document.session_context
    given = {} if context is None else context.request.arguments
    asked = {name: values[0].decode() for name, values in given.items() if not name.startswith("bokeh")}
    if asked:
        try:
            machine = machine_from(asked.pop("machine", machine.name), asked, machine.name)
        except ChaosgymError as error:
            document.add_root(Div(text=f"<h2>This link can't be shown</h2><p>{escape(str(error))}</p>"))
            return
    Page(document, machine)


LOOPBACK = "127.0.0.1"


def serve(machine: Machine, port: int, ready: Callable[[str], object]) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    machine
        What it shows first.
    port
        0 for any that is free.
    ready
        Called with the address when the page can be opened.

    Raises
    ------
    OSError
        If the port is taken.
    """
    application = Application(FunctionHandler(partial(open_page, machine=machine)))
    server: Any = Server({"/": application}, address=LOOPBACK, port=port, prefix=new_secret())
    guard(server)
    server.start()
    ready(f"http://localhost:{server.port}{server.prefix}/?{link_of(machine)}")
    try:
        server.io_loop.start()
    finally:
        server.stop()

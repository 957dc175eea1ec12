"""Buttons that save a point: a picture with its verdict and settings, and the command that repeats it."""

from collections.abc import Sequence
from typing import Any

from bokeh.models import Button, CustomJS, Div, TextAreaInput

SAVE = """
const line = 22, rows = []
const shots = figures.map(f => Bokeh.index.find_one(f).export('png', false).canvas)
const wide = Math.max(...shots.map(shot => shot.width))
const pen = document.createElement('canvas').getContext('2d')
pen.font = '15px sans-serif'
for (const text of [...told.map(div => div.text), command.value]) {
    for (const part of text.replace(/<\\/(h\\d|p)>/g, '\\n').replace(/<[^>]*>/g, '').split('\\n')) {
        const words = new DOMParser().parseFromString(part, 'text/html').body.textContent.split(' ')
        let row = ''
        for (const word of words) {
            if (pen.measureText(row + word).width > 2 * wide - 20) { rows.push(row); row = '' }
            row += word + ' '
        }
        if (row.trim()) rows.push(row)
    }
}
const tall = Math.max(...shots.map(shot => shot.height)), top = line * (rows.length + 1)
pen.canvas.width = 2 * wide
pen.canvas.height = top + tall * Math.ceil(shots.length / 2)
pen.fillStyle = 'white'
pen.fillRect(0, 0, pen.canvas.width, pen.canvas.height)
pen.fillStyle = 'black'
pen.font = '15px sans-serif'
rows.forEach((row, i) => pen.fillText(row, 10, line * (i + 1)))
shots.forEach((shot, i) => pen.drawImage(shot, wide * (i % 2), top + tall * Math.floor(i / 2)))
const link = document.createElement('a')
link.download = 'chaosgym.png'
link.href = pen.canvas.toDataURL('image/png')
link.click()
"""
"""One picture of all: what is told of the point, how to repeat it, and the figures below."""

SAVE_COMMAND = """
const link = document.createElement('a')
link.download = 'chaosgym-command.txt'
link.href = URL.createObjectURL(new Blob([command.value + '\\n'], {type: 'text/plain'}))
link.click()
"""


def save_buttons(figures: Sequence[Any], told: Sequence[Div], command: TextAreaInput) -> list[Button]:
    """Return the buttons; the browser writes the files, and the server nothing."""
    save, write = Button(label="Save picture", width=120), Button(label="Save command", width=120)
    save.js_on_click(CustomJS(args={"figures": figures, "told": told, "command": command}, code=SAVE))
    write.js_on_click(CustomJS(args={"command": command}, code=SAVE_COMMAND))
    return [save, write]

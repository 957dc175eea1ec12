"""Forward pass of a trained network, dense layers or an LSTM, by numpy alone."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import ModelFileError

Array = NDArray[Any]
State = tuple[Array, Array]
"""Hidden and memory state of an LSTM, (..., units) each."""

ACTIVATIONS: Mapping[str, Callable[[Array], Array]] = {
    "tanh": np.tanh,
    "relu": lambda values: np.maximum(values, 0.0),
    "none": lambda values: values,
}


class Dense(NamedTuple):
    """A layer: ``weight`` (outputs, inputs), ``bias`` (outputs,), and the name of its activation."""

    weight: Array
    bias: Array
    activation: str

    def __call__(self, inputs: Array) -> Array:
        """Return (..., outputs) for (..., inputs)."""
        return ACTIVATIONS[self.activation](inputs @ self.weight.T + self.bias)


class Lstm(NamedTuple):
    """A layer of LSTM units, its gates in torch's order: input, forget, cell, output.

    ``from_input`` (4 units, inputs), ``from_hidden`` (4 units, units), ``bias`` (4 units,).
    """

    from_input: Array
    from_hidden: Array
    bias: Array

    @property
    def units(self) -> int:
        """Number of units."""
        return int(self.from_hidden.shape[1])

    def rest(self, leading: tuple[int, ...]) -> State:
        """State at the start of a job, for inputs (*leading, inputs)."""
        zeros = np.zeros((*leading, self.units), self.bias.dtype)
        return zeros, zeros

    def __call__(self, inputs: Array, state: State) -> State:
        """Return the next state for (..., inputs); its hidden part is the output."""
        hidden, memory = state
        gates = inputs @ self.from_input.T + hidden @ self.from_hidden.T + self.bias
        take, keep, cell, give = np.split(gates, 4, axis=-1)
        memory = _sigmoid(keep) * memory + _sigmoid(take) * np.tanh(cell)
        return _sigmoid(give) * np.tanh(memory), memory


class Network(NamedTuple):
    """An LSTM, if there is one, then dense layers."""

    lstm: Lstm | None
    layers: tuple[Dense, ...]

    def __call__(self, inputs: Array, state: State | None) -> tuple[Array, State | None]:
        """Return the outputs (..., outputs) and the next state, for inputs (..., inputs) and the state before."""
        values = inputs
        if self.lstm:
            state = self.lstm(values, state or self.lstm.rest(values.shape[:-1]))
            values = state[0]
        for layer in self.layers:
            values = layer(values)
        return values, state

    def check(self, inputs: int, outputs: int) -> None:
        """Raise a ModelFileError unless the shapes fit each other, ``inputs`` and ``outputs``, and all is finite."""
        if not self.layers:
            raise ModelFileError("the network has no layers")
        width = inputs
        if self.lstm:
            units = self.lstm.units
            _expect("lstm from_input", self.lstm.from_input, (4 * units, width))
            _expect("lstm from_hidden", self.lstm.from_hidden, (4 * units, units))
            _expect("lstm bias", self.lstm.bias, (4 * units,))
            width = units
        for place, layer in enumerate(self.layers):
            if layer.activation not in ACTIVATIONS:
                raise ModelFileError(
                    f"layer {place} has activation {layer.activation!r}; known: {', '.join(ACTIVATIONS)}"
                )
            last = place == len(self.layers) - 1
            height = outputs if last else len(layer.bias) if layer.bias.ndim == 1 else -1
            _expect(f"layer {place} weight", layer.weight, (height, width))
            _expect(f"layer {place} bias", layer.bias, (height,))
            width = height


def _expect(name: str, array: Array, shape: tuple[int, ...]) -> None:
    if array.shape != shape or array.dtype != np.float32:
        raise ModelFileError(f"{name} is {array.dtype} {array.shape}; expected: float32 {shape}")
    if not np.isfinite(array).all():
        raise ModelFileError(f"{name} holds numbers that are not finite")


def _sigmoid(values: Array) -> Array:
    # by tanh: no overflow, however large the number
    return 0.5 + 0.5 * np.tanh(0.5 * values)

"""What does chaosgym know of a machine's responses without simulating? Its trained classifiers behind one interface.

    classifier = default_classifier("impact-beam")
    classifier.classify(machine)                           from parameters
    classifier.classify_record(peaks, sensor_error=3.0)    from 8 to 64 measured cycles
    classifier.classify_table(values), classify_records(peaks)    many at once, as columns

A question that lies outside what was trained on, or that is too close to call, is not answered: ``abstained``.
"""

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.classifier.answer import Classification
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.expectations import QUANTILES
from chaosgym.classifier.features import MAX_PLAUSIBLE, as_records, record_features
from chaosgym.classifier.parameter_features import parameter_features
from chaosgym.classifier.period import repeat_period
from chaosgym.classifier.storage import read_model, write_model
from chaosgym.errors import DiagnosisError, ModelFileError, ParameterError
from chaosgym.machines import MACHINES, Machine
from chaosgym.machines.parameters import parameters_of

Array = NDArray[np.float64]

QUANTILE_NAMES = tuple(f"{100.0 * quantile:g} %" for quantile in QUANTILES)


class PairNames(NamedTuple):
    """The columns of ``Pairs`` as lists."""

    types: list[str]
    natures: list[str]
    type_of: list[int]
    nature_of: list[int]


@dataclass(frozen=True)
class MachineClassifier:
    """Trained classifiers of one machine.

    Attributes
    ----------
    machine
        The training machine; what was not varied must be as here.
    parameters
        From the varied fields, in the order of ``fields``.
    records
        From peak forces; None if the sweep had no signals.
    card
        Model card: data, split, metrics, limits, version, training command, hash.
    """

    machine: Machine
    parameters: ResponseClassifier
    records: ResponseClassifier | None
    card: Mapping[str, Any]

    @property
    def fields(self) -> tuple[str, ...]:
        """Machine fields that are the inputs."""
        return tuple(self.card["fields"])

    def classify(self, machine: Machine) -> Classification:
        """Classify one machine from its parameters.

        Raises
        ------
        ParameterError
            If it is another kind of machine than the classifier's.
        """
        if machine.name != self.machine.name:
            raise ParameterError(f"this classifier knows {self.machine.name}, not {machine.name}")
        values = np.array([[getattr(machine, name) for name in self.fields]], dtype=float)
        features = parameter_features(self.parameters.scaling_, values)
        return self._answer(
            self.parameters, features, self.parameters.chances(features)[0], values, self._foreign(machine, values[0])
        )

    def classify_table(self, values: ArrayLike) -> dict[str, Any]:
        """Classify many machines: columns of the answer by name, for field values (n, n_fields) in SI units."""
        rows = np.ascontiguousarray(values, dtype=float)
        known = self.parameters
        outside = ((rows < known.low_) | (rows > known.high_) | ~np.isfinite(rows)).any(axis=1)
        return self._columns(known, known.predict_pairs(np.where(np.isfinite(rows), rows, 0.0)), outside)

    def classify_record(
        self, peaks: ArrayLike, *, section: ArrayLike | None = None, sensor_error: float | None = None
    ) -> Classification:
        """Classify one record of 8 or more peak forces [N], one a cycle; of more than 64 the last count.

        Parameters
        ----------
        peaks : (cycles,)
            Peak force of each cycle [N].
        section : (cycles, 2), optional
            Stroboscopic displacement and velocity.
        sensor_error
            Largest error of a peak [N], if it is known.

        Raises
        ------
        DiagnosisError
            If the record is too short, or holds negative forces or values that are not finite.
        """
        record = np.asarray(peaks, dtype=float)
        if record.ndim != 1:
            raise DiagnosisError(f"the record has shape {record.shape}; allowed: (cycles,)")
        if not np.isfinite(record).all():
            raise DiagnosisError(f"cycle {int(np.argmin(np.isfinite(record)))} of the record is not a finite number")
        known = self._records()
        states = None if section is None else np.asarray(section, dtype=float)[None]
        forces, states, errors = as_records(record[None], states, sensor_error)
        features = record_features(forces, states if states.shape[1] else None, errors)
        reason = self._strange(record, features)
        return self._answer(known, features, known.chances(features)[0], forces, reason)

    def classify_records(
        self, peaks: ArrayLike, *, section: ArrayLike | None = None, sensor_error: ArrayLike | None = None
    ) -> dict[str, Any]:
        """Classify many records (n, cycles), shorter ones ending in NaN: columns of the answer by name."""
        known = self._records()
        features = record_features(peaks, section, sensor_error)
        return self._columns(known, known.chances(features), known.unlike_training(features))

    def _records(self) -> ResponseClassifier:
        if self.records is None:
            raise ModelFileError(
                "this classifier was trained on a sweep without signals and can't judge records; "
                "use `chaosgym sweep --signals SHARE` for its data"
            )
        return self.records

    @cached_property
    def _names(self) -> dict[str, PairNames]:
        """Labels as plain lists, by input: a single answer is quicker with them than with arrays."""
        known = {"parameters": self.parameters} | ({"records": self.records} if self.records else {})
        return {name: PairNames(*(column.tolist() for column in one.pairs_[:4])) for name, one in known.items()}

    @cached_property
    def _source(self) -> dict[str, str]:
        """Where an answer comes from, by input."""
        of = {"parameters": [self.machine.name], "records": self.card.get("records_of", [self.machine.name])}
        return {kind: f"learned from {self.card['rows'][kind]} {kind} of {' and '.join(of[kind])}" for kind in of}

    @cached_property
    def _fixed(self) -> tuple[Any, Any]:
        """Fields that training did not vary, as a getter, and their values."""
        getter = operator.attrgetter(*[name for name in parameters_of(self.machine) if name not in self.fields])
        return getter, getter(self.machine)

    def _foreign(self, machine: Machine, values: Array) -> str:
        """Why a machine lies outside the training; empty if it does not."""
        known = self.parameters
        for name, value, low, high in zip(self.fields, values, known.low_, known.high_, strict=True):
            if not low <= value <= high:
                unit = parameters_of(machine)[name].unit
                return (
                    f"{name} = {value:g} {unit} is outside what the classifier was trained on; "
                    f"known: {low:g} to {high:g} {unit}"
                )
        getter, expected = self._fixed
        if getter(machine) == expected:
            return ""
        name = next(
            name
            for name in parameters_of(machine)
            if name not in self.fields and getattr(machine, name) != getattr(self.machine, name)
        )
        return (
            f"{name} = {getattr(machine, name)} differs from the classifier's training machine; "
            f"known: {getattr(self.machine, name)}"
        )

    def _strange(self, record: Array, features: Array) -> str:
        """Why a record is unlike those of the training; empty if it is not."""
        if record.max() > MAX_PLAUSIBLE:
            return f"peaks of {record.max():.3g} N: wrong units suspected; forces are expected in newton"
        if not record.any():
            return "all peaks are zero: there is no contact to judge"
        if self._records().unlike_training(features)[0]:
            return "the record is unlike those that the classifier was trained on; use `chaosgym diagnose --peaks`"
        return ""

    def _answer(
        self, known: ResponseClassifier, features: Array, chances: Array, values: Array, outside: str
    ) -> Classification:
        names = self._names[known.inputs]
        types, natures = [0.0] * len(names.types), [0.0] * len(names.natures)
        for chance, kind, nature in zip(chances.tolist(), names.type_of, names.nature_of, strict=True):
            types[kind] += chance
            natures[nature] += chance
        confidence = max(types)
        best_type, best_nature = names.types[types.index(confidence)], names.natures[natures.index(max(natures))]
        period, reason = None, outside
        if not outside and confidence < known.least_confidence_:
            reason = f"too close to call: the most probable type, {best_type}, has a probability of {confidence:.2f}"
        if not reason and best_nature == "periodic":
            found = repeat_period(values[0]) if known.inputs == "records" else int(known.predict_period(features)[0])
            period = found or None
        forces = known.predict_peak_force(features, values)[0].tolist() if not outside else ()
        least = min(known.plausible_, confidence)
        return Classification(
            response_type=None if reason else best_type,
            nature=None if reason else best_nature,
            probabilities=dict(zip(names.types, types, strict=True)),
            nature_probabilities=dict(zip(names.natures, natures, strict=True)),
            confidence=confidence,
            abstained=bool(reason),
            reason=reason or self._source[known.inputs],
            period=period,
            plausible_types=tuple(kind for kind, chance in zip(names.types, types, strict=True) if chance >= least),
            peak_force=dict(zip(QUANTILE_NAMES, forces, strict=False)),
        )

    def _columns(self, known: ResponseClassifier, chances: Array, outside: NDArray[np.bool_]) -> dict[str, Any]:
        types, natures = known.pairs_.types_from(chances), known.pairs_.natures_from(chances)
        confidence = types.max(axis=1)
        unsure = confidence < known.least_confidence_
        abstained = outside | unsure
        return {
            "response_type": np.where(abstained, None, known.classes_[types.argmax(axis=1)].astype(object)),
            "nature": np.where(abstained, None, known.natures_[natures.argmax(axis=1)].astype(object)),
            **{f"probability_{name}": types[:, place] for place, name in enumerate(known.classes_)},
            **{f"probability_{name}": natures[:, place] for place, name in enumerate(known.natures_)},
            "confidence": confidence,
            "abstained": abstained,
            "reason": np.where(
                outside, "outside what the classifier was trained on", np.where(unsure, "too close to call", "")
            ),
        }

    def save(self, path: str | Path) -> None:
        """Write the model file."""
        parts = {"parameters": _state(self.parameters)}
        if self.records is not None:
            parts["records"] = _state(self.records)
        write_model(path, {name: value for name, value in self.card.items() if name != "sha256"}, parts)

    @classmethod
    def load(cls, path: str | Path) -> "MachineClassifier":
        """Read a model file.

        Raises
        ------
        ModelFileError
            If it is missing, damaged, of another version, or does not match its hash.
        """
        card, parts = read_model(path)
        try:
            machine: Any = MACHINES[card["machine"]]
            records = _restored("records", parts["records"]) if "records" in parts else None
            return cls(machine(**card["base"]), _restored("parameters", parts["parameters"]), records, card)
        except (KeyError, TypeError, ValueError) as error:
            raise ModelFileError(f"{path} can't be read as a classifier: {error!r}") from error


def _state(classifier: ResponseClassifier) -> dict[str, Any]:
    """Fitted attributes."""
    return {name: value for name, value in vars(classifier).items() if name.endswith("_") and name != "teachers_"}


def _restored(inputs: Any, state: Mapping[str, Any]) -> ResponseClassifier:
    classifier = ResponseClassifier(inputs=inputs)
    for name, value in state.items():
        setattr(classifier, name, value)
    return classifier


@lru_cache
def default_classifier(machine_name: str) -> MachineClassifier:
    """Return the classifier that is shipped for a machine.

    Raises
    ------
    ModelFileError
        If none is shipped for it.
    """
    path = resources.files("chaosgym") / "weights" / f"{machine_name}.npz"
    if not path.is_file():
        raise ModelFileError(f"no classifier is shipped for {machine_name}; train one with `chaosgym train-classifier`")
    with resources.as_file(path) as file:
        return MachineClassifier.load(file)

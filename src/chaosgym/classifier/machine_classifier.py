"""The trained classifiers of a machine behind one interface.

    classifier = default_classifier("impact-beam")         the one that is shipped for a machine
    classifier = classifier_for(machine)                   the same, or a general one for machines that have none
    classifier.classify(machine)                           type and nature, by the cascade
    classifier.classify_record(peaks, sensor_error=3.0)    irregularity and nature from 8 or more measured cycles
    classifier.classify_table(values), classify_records(peaks)    many at once, as columns

A question outside the trained ranges, in wrong units, or too close to call is not answered.
"""

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.classifier.answer import Classification, NatureAnswer, neighbours_of, type_probabilities
from chaosgym.classifier.cascade import CLEAR, MILLION, judge_nature
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.features import as_records, response_features
from chaosgym.classifier.record_answers import judge_records
from chaosgym.classifier.storage import read_model, write_model
from chaosgym.errors import DiagnosisError, ModelFileError, ParameterError
from chaosgym.machines import MACHINES, Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.recordings.record_answer import RecordAnswer

PEAK_CYCLES = 16
"""Cycles from rest that the largest peak of a neighbourhood's point rests on at least, unless an orbit is proven."""

NATURE, IRREGULAR = "record-nature", "record-irregular"
"""Names of the classifiers of records."""


@dataclass(frozen=True)
class MachineClassifier:
    """Trained classifiers of one machine.

    Attributes
    ----------
    machine
        The training machine; what was not varied must be as here.
    stages
        By the number of cycles that they see, 0 for parameters alone; more only if the sweep had signals.
    records
        Of "record-nature" and "record-irregular"; empty if the sweep had no signals.
    card
        Model card: data, split, metrics, limits, version, training command, hash.

    Examples
    --------
    >>> classifier = chaosgym.default_classifier("impact-beam")
    >>> answer = classifier.classify(chaosgym.ImpactBeam(excitation_frequency=16.0), types=False)
    >>> answer.centre.nature, answer.centre.stage
    ('periodic', 'certificate')
    """

    machine: Machine
    stages: Mapping[int, ResponseClassifier]
    records: Mapping[str, ResponseClassifier]
    card: Mapping[str, Any]

    @property
    def fields(self) -> tuple[str, ...]:
        """Machine fields that are the inputs."""
        return tuple(self.card["fields"])

    @property
    def classes(self) -> tuple[str, ...]:
        """Natures that it tells apart."""
        return tuple(str(name) for name in next(iter(self.stages.values())).classes_)

    @property
    def parameters(self) -> ResponseClassifier:
        """The classifier of natures from parameters alone.

        Raises
        ------
        ModelFileError
            If none is trained for this machine.
        """
        if 0 not in self.stages:
            raise ModelFileError(f"nothing is learned of {self.machine.name} from parameters alone")
        return self.stages[0]

    def classify(
        self, machine: Machine, *, budget_us: float | None = None, prove: bool = True, types: bool = True
    ) -> Classification:
        """Classify one machine: its nature by the cascade, then its type by those of its neighbours.

        Parameters
        ----------
        machine
            What to judge.
        budget_us
            Processor time [µs] that may be spent; None spends what it takes to be sure. A step is taken if it is
            expected to fit, so that an answer may take somewhat longer; 0 is an answer from parameters alone.
        prove
            Look for proofs of periodic orbits although the stages are sure.
        types
            Judge the type too, which takes up to five times as long.

        Raises
        ------
        ParameterError
            If it is another kind of machine than the classifier's.
        """
        if machine.name != self.machine.name:
            raise ParameterError(f"this classifier knows {self.machine.name}, not {machine.name}")
        began = thread_time()
        centre = self._nature(machine, budget_us, prove, 0)
        points: list[NatureAnswer] = []
        told: tuple[dict[str, float], str] = ({}, "not asked for")
        if types:
            points, told = self._type(machine, centre, budget_us, prove, began)
        likely = max(told[0], key=told[0].__getitem__, default=None)
        probability = told[0].get(likely, 0.0) if likely else 0.0
        clear = probability >= CLEAR
        return Classification(
            response_type=likely if clear else None,
            type_probabilities=told[0],
            type_proven=bool(points) and all(point.proven for point in (centre, *points)),
            type_reason=told[1] if clear or not likely else f"too close to call: Type {likely} has {probability:.2f}",
            begun=machine.begins_from(),
            centre=centre,
            neighbours=tuple(points),
            microseconds=MILLION * (thread_time() - began),
        )

    def _type(
        self, machine: Machine, centre: NatureAnswer, budget_us: float | None, prove: bool, began: float
    ) -> tuple[list[NatureAnswer], tuple[dict[str, float], str]]:
        """The neighbours, as far as they are needed, and the type's probabilities with their reason."""
        if centre.nature is None:
            return [], ({}, "the nature of the machine itself is not known")
        if centre.nature == "chaotic":
            rest = 1.0 - centre.probability
            return [], ({"I": 0.0, "II": rest, "III": centre.probability}, "the nominal response is chaotic")
        if centre.largest_peak is None and budget_us is None:
            centre = self._nature(machine, budget_us, prove, PEAK_CYCLES)
        try:
            around = neighbours_of(machine)
        except ParameterError as error:
            return [], ({}, f"a neighbour is not allowed: {error}")
        points = []
        for place, neighbour in enumerate(around):
            spent = MILLION * (thread_time() - began)
            share = None if budget_us is None else (budget_us - spent) / (len(around) - place)
            points.append(self._nature(neighbour, share, prove, PEAK_CYCLES))
        if any(point.largest_peak is None for point in (centre, *points)):
            return points, ({}, "the budget ends before the neighbours are simulated")
        if any(point.nature is None for point in points):
            return points, ({}, "the nature of a neighbour is not known")
        return points, type_probabilities(machine, (centre, *points))

    def _nature(self, machine: Machine, budget_us: float | None, prove: bool, least: int) -> NatureAnswer:
        values = np.array([[getattr(machine, name) for name in self.fields]], dtype=float)
        foreign = self._foreign(machine, values[0])
        return judge_nature(
            self.stages,
            machine,
            None if foreign else values,
            budget_us=budget_us,
            prove=prove,
            least_cycles=least,
            foreign=foreign,
        )

    def classify_table(self, values: ArrayLike) -> dict[str, Any]:
        """Natures of many machines from parameters alone: columns by name, for values (n, n_fields) in SI units."""
        rows = np.ascontiguousarray(values, dtype=float)
        known = self.parameters
        outside = ((rows < known.low_) | (rows > known.high_) | ~np.isfinite(rows)).any(axis=1)
        chances = known.predict_proba(np.where(np.isfinite(rows), rows, 0.0))
        unsure = chances.max(axis=1) < CLEAR
        return {
            "nature": np.where(outside | unsure, None, known.classes_[chances.argmax(axis=1)].astype(object)),
            **{f"probability_{name}": chances[:, place] for place, name in enumerate(known.classes_)},
            "abstained": outside | unsure,
            "reason": np.where(
                outside, "outside what the classifier was trained on", np.where(unsure, "too close to call", "")
            ),
        }

    def classify_record(self, peaks: ArrayLike, *, sensor_error: float | None = None) -> RecordAnswer:
        """Classify one record of 8 or more peak forces [N], one a cycle; of more than 64 the last count.

        Parameters
        ----------
        peaks : (cycles,)
            Peak force of each cycle [N].
        sensor_error
            Largest error of a peak [N], if it is known.

        Returns
        -------
        RecordAnswer
            Of a record of machines like those learned from. Random readings may look chaotic to it: where they are
            possible, take ``answer.under(chaosgym.judge_peaks(peaks).diagnosis)``.

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
        answers = self.classify_records(record[None], sensor_error=sensor_error)
        return RecordAnswer(
            **{name: _plain(column[0]) for name, column in answers.items() if not name.startswith("probability_")},
            nature_probabilities={
                name: float(answers[f"probability_{name}"][0]) for name in self._model(NATURE).classes_
            },
        )

    def classify_records(self, peaks: ArrayLike, *, sensor_error: ArrayLike | None = None) -> dict[str, Any]:
        """Classify many records (n, cycles), shorter ones ending in NaN: columns of the answer by name."""
        return judge_records(self._model(NATURE), self._model(IRREGULAR), peaks, sensor_error)

    def irregular_probability(self, peaks: ArrayLike, sensor_error: ArrayLike) -> Array:
        """How likely a sensor of this largest error [N] sees records (n, cycles) as irregular, (n,) from 0 to 1.

        Shorter records end in NaN. It is the ``irregular_probability`` of ``classify_records``, without the rest.
        """
        forces, _, errors = as_records(peaks, None, sensor_error)
        return self._model(IRREGULAR).chances(response_features(None, None, forces, None, errors))[:, 1]

    def _model(self, name: str) -> ResponseClassifier:
        if name not in self.records:
            raise ModelFileError(
                f"no classifier of records is trained for {self.machine.name}: `chaosgym judge` judges them "
                "without one, and `chaosgym sweep --label signals=SHARE` gives data to train one on"
            )
        return self.records[name]

    @cached_property
    def _fixed(self) -> tuple[Any, Any]:
        """Fields that training did not vary, as a getter, and their values."""
        getter = operator.attrgetter(*[name for name in parameters_of(self.machine) if name not in self.fields])
        return getter, getter(self.machine)

    def _foreign(self, machine: Machine, values: Array) -> str:
        """Why a machine lies outside the training; empty if it does not."""
        if not self.fields:
            return ""
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

    def save(self, path: str | Path) -> None:
        """Write the model file."""
        parts = {f"stage-{cycles}": _state(one) for cycles, one in self.stages.items()}
        parts |= {name: _state(one) for name, one in self.records.items()}
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
            stages = {
                int(name.removeprefix("stage-")): _restored("parameters", state)
                for name, state in parts.items()
                if name.startswith("stage-")
            }
            records = {name: _restored("records", parts[name]) for name in (NATURE, IRREGULAR) if name in parts}
            return cls(machine(**card["base"]), stages, records, card)
        except (KeyError, TypeError, ValueError) as error:
            raise ModelFileError(f"{path} can't be read as a classifier: {error!r}") from error


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _state(classifier: ResponseClassifier) -> dict[str, Any]:
    """Fitted attributes."""
    return {name: value for name, value in vars(classifier).items() if name.endswith("_")}


def _restored(inputs: Any, state: Mapping[str, Any]) -> ResponseClassifier:
    classifier = ResponseClassifier(inputs=inputs)
    for name, value in state.items():
        setattr(classifier, name, value)
    return classifier

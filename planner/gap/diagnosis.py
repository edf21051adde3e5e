"""The diagnosis of a campaign as a value, and as diagnosis.json."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from planner import __version__
from planner.errors import FileError
from planner.formats.files import encode_document
from planner.numerics import FloatArray

__all__ = [
    "Detectable",
    "Diagnosis",
    "Effects",
    "Experiment",
    "FoundEffect",
    "Gap",
    "Hypothesis",
    "Location",
    "Quality",
    "Traces",
    "Untestable",
    "encode_diagnosis",
    "of_document",
    "read_diagnosis",
    "to_document",
]


# ------------------------------------------------------------------------------------------------
# What the diagnosis of a campaign says: where, which, how far, and what next.


Effects = tuple[str, ...]
"""Effect ids, sorted; () stands for "none", ("unknown",) for what no effect explains."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A set of effects and its probability.

    `with_unknown` is the share of that probability, 0 to 1, that needs something unknown besides.
    """

    effects: Effects
    probability: float
    with_unknown: float = 0.0


@dataclass(frozen=True, slots=True)
class Location:
    """One axis along which the gap varies: its share of the excess variance.

    Attributes
    ----------
    p
        Family-wise, against replicate noise.
    """

    axis: str
    share: float
    share_interval: tuple[float, float]
    p: float
    detail: str


@dataclass(frozen=True, slots=True)
class Gap:
    """Normalised RMS errors of force on held-out conditions; None where it cannot be known.

    Attributes
    ----------
    closed
        ``1 - (after - floor) / (before - floor)``.
    recalibration_only, generic
        Errors after refitting the base laws alone, and after a generic regressor.
    held_out
        What was left out at a time, in words.
    extrapolated_before, extrapolated
        Errors before and after, where whole levels of a column, such as the warmest, were left out.
    negative_transfer
        Whether the effect makes held-out conditions worse.
    """

    before: float
    after: float | None
    floor: float | None
    closed: float | None
    closed_interval: tuple[float, float] | None
    recalibration_only: float | None
    generic: float | None
    held_out: str
    extrapolated_before: float | None = None
    extrapolated: float | None = None
    negative_transfer: bool = False


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """One effect of the verdict: its form's parameters and their 90 % intervals."""

    id: str
    form: str
    parameters: Mapping[str, float]
    interval: Mapping[str, tuple[float, float]]
    units: Mapping[str, str]
    specimens: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Untestable:
    """An effect that this campaign says nothing about, and why."""

    id: str
    reason: str


@dataclass(frozen=True, slots=True)
class Detectable:
    """The smallest size of an effect that would have been seen; None if none within its bounds."""

    id: str
    parameter: str
    size: float | None
    unit: str


@dataclass(frozen=True, slots=True)
class Quality:
    """Something wrong with the data; `specimen` None means the whole campaign."""

    specimen: str | None
    kind: str
    problem: str


@dataclass(frozen=True, slots=True)
class Experiment:
    """A test worth doing: what to change from the reference, and which hypotheses it splits."""

    change: Mapping[str, Any]
    splits: tuple[tuple[str, str], ...]
    expected_gain_nats: float
    hours: float
    detail: str


@dataclass(frozen=True, slots=True, eq=False)
class Traces:
    """Curves and residuals to draw, a test a row; NaN where there is nothing.

    Attributes
    ----------
    label : (P,)
        Of the test: material or design and what differs from the reference.
    specimen_ids
        The specimens of each test.
    travel_mm, time_s, before_N, after_N : (P, T)
        Predicted by the palette alone, and with the verdict's effects.
    measured_N : (n, T)
        Of each specimen, in the campaign's order, on its test's steps.
    residual_before, residual_after : (n,)
        Mean relative error of force of each specimen, positive where it bears more than predicted.
    specimens : (n,)
        Their ids in the campaign's order.
    columns
        By axis, what each specimen has there, None where it is unknown; see `axis_columns`.
    """

    label: tuple[str, ...]
    specimen_ids: tuple[tuple[str, ...], ...]
    travel_mm: FloatArray
    time_s: FloatArray
    before_N: FloatArray
    after_N: FloatArray
    measured_N: FloatArray
    residual_before: FloatArray = field(default_factory=lambda: np.zeros(0))
    residual_after: FloatArray = field(default_factory=lambda: np.zeros(0))
    specimens: tuple[str, ...] = ()
    columns: Mapping[str, tuple[float | str | None, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The diagnosis of one campaign.

    Attributes
    ----------
    verdict
        An effect id, "a+b", "none" or "unknown".
    ranking
        Most probable first; probabilities sum to 1 over all hypotheses weighed, of which the
        least are left out.
    same_class
        Hypotheses that the data cannot tell from the verdict, the verdict included.
    remainder
        Where a gap remains after the verdict's effects, significant places only.
    recalibration
        By material: the factor on its law's stress that the data ask for beside the effects, as a
        logarithm, with its standard deviation.
    """

    campaign: str
    palette: str
    palette_sha256: str
    specimens: int
    tests: int
    verdict: str
    ranking: tuple[Hypothesis, ...]
    same_class: tuple[Effects, ...]
    not_testable: tuple[Untestable, ...]
    where: tuple[Location, ...]
    gap: Gap
    effect: tuple[FoundEffect, ...]
    remainder: tuple[Location, ...]
    data_quality: tuple[Quality, ...]
    next_experiments: tuple[Experiment, ...]
    detectable: tuple[Detectable, ...]
    limitations: tuple[str, ...]
    recalibration: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    seed: int = 0
    traces: Traces | None = None

    @property
    def ok(self) -> bool:
        """Whether no gap was found: nothing to explain, and nothing that remains."""
        return self.verdict == "none" and not self.remainder


# ------------------------------------------------------------------------------------------------
# The keys of diagnosis.json and what their values may be.


_MOST = 1.0 + 1e-6


class HypothesisFile(msgspec.Struct):
    """One entry of ranking."""

    effects: list[str]
    probability: float
    with_unknown: float = 0.0


class PlaceFile(msgspec.Struct):
    """One entry of where and of remainder.where."""

    axis: str
    share: float
    p: float
    detail: str = ""
    share_interval: tuple[float | None, float | None] | None = None


class GapFile(msgspec.Struct):
    """The value of gap."""

    before: float
    after: float | None
    floor: float | None
    closed: float | None
    closed_interval: tuple[float | None, float | None] | None
    recalibration_only: float | None
    held_out: str
    generic: float | None = None
    extrapolated_before: float | None = None
    extrapolated: float | None = None
    negative_transfer: bool = False


class EffectFile(msgspec.Struct):
    """One value of effect."""

    parameters: dict[str, float]
    interval: dict[str, tuple[float | None, float | None]]
    form: str = ""
    units: dict[str, str] = {}
    specimens: list[str] = []


class RemainderFile(msgspec.Struct):
    """The value of remainder."""

    significant: bool
    where: list[PlaceFile]


class QualityFile(msgspec.Struct):
    """One entry of data_quality."""

    specimen: str | None
    problem: str
    kind: str = ""


class ExperimentFile(msgspec.Struct):
    """One entry of next_experiments."""

    change: dict[str, Any]
    splits: list[tuple[str, str]]
    expected_gain_nats: float
    hours: float = 0.0
    detail: str = ""


class DetectableFile(msgspec.Struct):
    """One entry of detectable."""

    id: str
    parameter: str
    size: float | None
    unit: str


class RecalibrationFile(msgspec.Struct):
    """One value of recalibration."""

    log_factor: float
    sd: float


class PaletteFile(msgspec.Struct):
    """The value of palette."""

    name: str = ""
    sha256: str = ""


class DiagnosisFile(msgspec.Struct):
    """The whole document; what has a default goes beyond the contract."""

    schema: Literal[1]
    verdict: str
    ranking: list[HypothesisFile]
    class_: list[list[str]] = msgspec.field(name="class")
    not_testable: list[str]
    where: list[PlaceFile]
    gap: GapFile
    effect: dict[str, EffectFile]
    remainder: RemainderFile
    data_quality: list[QualityFile]
    next_experiments: list[ExperimentFile]
    campaign: str = ""
    palette: PaletteFile = msgspec.field(default_factory=PaletteFile)
    specimens: int = 0
    tests: int = 0
    seed: int = 0
    not_testable_because: dict[str, str] = {}
    detectable: list[DetectableFile] = []
    recalibration: dict[str, RecalibrationFile] = {}
    limitations: list[str] = []


def _faults_of(file: DiagnosisFile) -> Iterator[tuple[str, str, str]]:
    """Yield key, value and what it may be, where the type alone does not say it."""
    verdict = file.verdict.split("+")
    if not all(verdict) or verdict != sorted(set(verdict)):
        yield "verdict", repr(file.verdict), "an id, or ids joined by '+' in alphabetical order"
    named = [] if file.verdict in ("none", "unknown") else verdict
    strange = sorted(set(file.effect) - set(named))
    if strange:
        yield "effect", f"given for {', '.join(strange)}", f"for the verdict {file.verdict!r} alone"
    for i, h in enumerate(file.ranking):
        for key in ("probability", "with_unknown"):
            if not 0.0 <= getattr(h, key) <= _MOST:
                yield f"ranking[{i}].{key}", f"{getattr(h, key):g}", "from 0 to 1"
    if math.fsum(h.probability for h in file.ranking) > _MOST:
        yield "the sum of ranking's probabilities", "over 1", "1 at most"
    for key, places in (("where", file.where), ("remainder.where", file.remainder.where)):
        for i, place in enumerate(places):
            if not 0.0 <= place.p <= _MOST:
                yield f"{key}[{i}].p", f"{place.p:g}", "from 0 to 1"
    if file.remainder.significant != bool(file.remainder.where):
        allowed = "true where remainder.where names a place, and else false"
        yield "remainder.significant", str(file.remainder.significant).lower(), allowed
    for key in ("before", "after", "floor", "recalibration_only", "generic"):
        value = getattr(file.gap, key)
        if value is not None and value < 0.0:
            yield f"gap.{key}", f"{value:g}", "0 or above"


# ------------------------------------------------------------------------------------------------
# diagnosis.json: a diagnosis as other programs read it, and back.


_SIGNIFICANT_DIGITS = 6
"""Finer than any figure of a diagnosis is known, coarser than what machines disagree in."""


def to_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the diagnosis as JSON holds it, figures rounded to `_SIGNIFICANT_DIGITS`.

    What is unknown, and the open end of an interval, is None. Traces are left out.

    Raises
    ------
    ValueError
        A figure that must be known is not finite; the message names its key.
    """
    d, gap = diagnosis, diagnosis.gap
    return {
        "schema": 1,
        "version": __version__,
        "campaign": d.campaign,
        "palette": {"name": d.palette, "sha256": d.palette_sha256},
        "specimens": int(d.specimens),
        "tests": int(d.tests),
        "seed": int(d.seed),
        "verdict": d.verdict,
        "ranking": [
            {
                "effects": _ids(h.effects),
                "probability": _known(h.probability, "ranking.probability"),
                "with_unknown": _known(h.with_unknown, "ranking.with_unknown"),
            }
            for h in d.ranking
        ],
        "class": [_ids(effects) for effects in d.same_class],
        "not_testable": [u.id for u in d.not_testable],
        "not_testable_because": {u.id: u.reason for u in d.not_testable},
        "where": _places(d.where, "where"),
        "gap": {
            "before": _known(gap.before, "gap.before"),
            "after": _figure(gap.after),
            "floor": _figure(gap.floor),
            "closed": _figure(gap.closed),
            "closed_interval": _interval(gap.closed_interval),
            "recalibration_only": _figure(gap.recalibration_only),
            "generic": _figure(gap.generic),
            "held_out": gap.held_out,
            "extrapolated_before": _figure(gap.extrapolated_before),
            "extrapolated": _figure(gap.extrapolated),
            "negative_transfer": bool(gap.negative_transfer),
        },
        "effect": {
            e.id: {
                "form": e.form,
                "parameters": {
                    name: _known(value, f"effect.{e.id}.parameters.{name}")
                    for name, value in e.parameters.items()
                },
                "interval": {name: _interval(ends) for name, ends in e.interval.items()},
                "units": dict(e.units),
                "specimens": list(e.specimens),
            }
            for e in d.effect
        },
        "remainder": {"significant": bool(d.remainder), "where": _places(d.remainder, "remainder")},
        "data_quality": [
            {"specimen": q.specimen, "kind": q.kind, "problem": q.problem} for q in d.data_quality
        ],
        "next_experiments": [
            {
                "change": _plain(x.change),
                "splits": [list(pair) for pair in x.splits],
                "expected_gain_nats": _known(
                    x.expected_gain_nats, "next_experiments.expected_gain_nats"
                ),
                "hours": _known(x.hours, "next_experiments.hours"),
                "detail": x.detail,
            }
            for x in d.next_experiments
        ],
        "detectable": [
            {"id": s.id, "parameter": s.parameter, "size": _figure(s.size), "unit": s.unit}
            for s in d.detectable
        ],
        "recalibration": {
            material: {
                "log_factor": _known(factor, f"recalibration.{material}.log_factor"),
                "sd": _known(sd, f"recalibration.{material}.sd"),
            }
            for material, (factor, sd) in d.recalibration.items()
        },
        "limitations": list(d.limitations),
    }


def encode_diagnosis(diagnosis: Diagnosis) -> bytes:
    """Return the bytes of diagnosis.json; the same diagnosis gives the same bytes."""
    return encode_document(to_document(diagnosis))


def of_document(document: Mapping[str, Any], *, name: str = "diagnosis") -> Diagnosis:
    """Return the diagnosis that a document holds, without traces.

    The keys of the contract suffice; those that planner does not know are ignored.

    Parameters
    ----------
    name
        Of the document, for messages.

    Raises
    ------
    FileError
        A key is missing or its value is not what it may be; the message names it.
    """
    try:
        file = msgspec.convert(dict(document), DiagnosisFile)
    except msgspec.ValidationError as error:
        raise FileError(
            f"{name}: not a diagnosis: {error}; see docs/reference/diagnosis.md for its keys"
        ) from error
    for key, value, allowed in _faults_of(file):
        raise FileError(f"{name}: {key} is {value}; it must be {allowed}")
    gap, because = file.gap, file.not_testable_because
    return Diagnosis(
        campaign=file.campaign,
        palette=file.palette.name,
        palette_sha256=file.palette.sha256,
        specimens=file.specimens,
        tests=file.tests,
        verdict=file.verdict,
        ranking=tuple(
            Hypothesis(_effects(h.effects), h.probability, h.with_unknown) for h in file.ranking
        ),
        same_class=tuple(map(_effects, file.class_)),
        not_testable=tuple(Untestable(id, because.get(id, "")) for id in file.not_testable),
        where=_read_places(file.where),
        gap=Gap(
            before=gap.before,
            after=gap.after,
            floor=gap.floor,
            closed=gap.closed,
            closed_interval=None if gap.closed_interval is None else _ends(gap.closed_interval),
            recalibration_only=gap.recalibration_only,
            generic=gap.generic,
            held_out=gap.held_out,
            extrapolated_before=gap.extrapolated_before,
            extrapolated=gap.extrapolated,
            negative_transfer=gap.negative_transfer,
        ),
        effect=tuple(
            FoundEffect(
                id,
                e.form,
                e.parameters,
                {parameter: _ends(ends) for parameter, ends in e.interval.items()},
                e.units,
                tuple(e.specimens),
            )
            for id, e in file.effect.items()
        ),
        remainder=_read_places(file.remainder.where),
        data_quality=tuple(Quality(q.specimen, q.kind, q.problem) for q in file.data_quality),
        next_experiments=tuple(
            Experiment(x.change, tuple(x.splits), x.expected_gain_nats, x.hours, x.detail)
            for x in file.next_experiments
        ),
        detectable=tuple(Detectable(s.id, s.parameter, s.size, s.unit) for s in file.detectable),
        limitations=tuple(file.limitations),
        recalibration={m: (r.log_factor, r.sd) for m, r in file.recalibration.items()},
        seed=file.seed,
    )


def read_diagnosis(path: str | Path) -> Diagnosis:
    """Read a diagnosis.json, or the folder that holds it.

    Raises
    ------
    FileError
        The file cannot be read, is no JSON, or is not a diagnosis.
    """
    path = Path(path)
    file = path / "diagnosis.json" if path.is_dir() else path
    try:
        document = msgspec.json.decode(file.read_bytes())
    except OSError as error:
        raise FileError(
            f"{file}: cannot be read ({error.strerror or error}); give a diagnosis.json as "
            "planner gap diagnose -o writes it, or its folder"
        ) from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{file}: not a JSON document: {error}") from error
    if not isinstance(document, dict):
        raise FileError(f"{file}: holds a JSON {type(document).__name__}; it must be an object")
    return of_document(document, name=str(file))


def _ids(effects: Effects) -> list[str]:
    """Return a hypothesis as the verdict is written: "none" is no empty list."""
    return list(effects) or ["none"]


def _effects(ids: list[str]) -> Effects:
    return () if ids == ["none"] else tuple(ids)


def _rounded(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT_DIGITS}g}") + 0.0  # + 0.0 turns -0.0 into 0.0


def _figure(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else _rounded(value)


def _known(value: float, key: str) -> float:
    if not math.isfinite(value):
        raise ValueError(f"{key} of a diagnosis is {value}")
    return _rounded(value)


def _interval(ends: tuple[float, float] | None) -> list[float | None] | None:
    return None if ends is None else [_figure(end) for end in ends]


def _ends(interval: tuple[float | None, float | None]) -> tuple[float, float]:
    low, high = interval
    return -math.inf if low is None else low, math.inf if high is None else high


def _places(places: Sequence[Location], key: str) -> list[dict[str, Any]]:
    return [
        {
            "axis": place.axis,
            "share": _known(place.share, f"{key}.share"),
            "share_interval": _interval(place.share_interval),
            "p": _known(place.p, f"{key}.p"),
            "detail": place.detail,
        }
        for place in places
    ]


def _read_places(places: Iterable[PlaceFile]) -> tuple[Location, ...]:
    return tuple(
        Location(p.axis, p.share, _ends(p.share_interval or (None, None)), p.p, p.detail)
        for p in places
    )


def _plain(value: Any) -> Any:
    """Return what JSON can hold: rounded figures, no numpy types, no tuples."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return _figure(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    return value

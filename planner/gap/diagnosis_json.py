"""diagnosis.json: a diagnosis as other programs read it, and back."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from planner import __version__
from planner.errors import FileError
from planner.formats.json_document import encode_document
from planner.gap.diagnosis import (
    Detectable,
    Diagnosis,
    Effects,
    Experiment,
    FoundEffect,
    Gap,
    Hypothesis,
    Place,
    Quality,
    Untestable,
)
from planner.gap.diagnosis_schema import DiagnosisFile, PlaceFile, faults_of

__all__ = ["encode_diagnosis", "of_document", "read_diagnosis", "to_document"]

SIGNIFICANT_DIGITS = 6
"""Finer than any figure of a diagnosis is known, coarser than what machines disagree in."""


def to_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the diagnosis as JSON holds it, figures rounded to `SIGNIFICANT_DIGITS`.

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
    for key, value, allowed in faults_of(file):
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
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0  # + 0.0 turns -0.0 into 0.0


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


def _places(places: Sequence[Place], key: str) -> list[dict[str, Any]]:
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


def _read_places(places: Iterable[PlaceFile]) -> tuple[Place, ...]:
    return tuple(
        Place(p.axis, p.share, _ends(p.share_interval or (None, None)), p.p, p.detail)
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

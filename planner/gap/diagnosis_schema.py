"""The keys of diagnosis.json and what their values may be."""

import math
from collections.abc import Iterator
from typing import Any, Literal

import msgspec

__all__ = ["DiagnosisFile", "PlaceFile", "faults_of"]

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


def faults_of(file: DiagnosisFile) -> Iterator[tuple[str, str, str]]:
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

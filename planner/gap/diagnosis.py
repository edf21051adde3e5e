"""The diagnosis of a campaign as a value, and as diagnosis.json."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from planner import __version__
from planner.errors import FileError, PaletteError, refused
from planner.formats.files import decode_document, json_of, path_within, read_file
from planner.formats.units import UnitOf
from planner.gap.campaign import named
from planner.glance import brief, counted, html_of, one_line, plotted
from planner.numerics import FloatArray
from planner.palette import Palette, load_palette

__all__ = [
    "PALETTE_FILE",
    "SIGNIFICANT",
    "Detectable",
    "Diagnosis",
    "Effects",
    "Experiment",
    "FoundEffect",
    "Gap",
    "Hypothesis",
    "Location",
    "QualityProblem",
    "Traces",
    "Untestable",
    "name_of",
    "read_diagnosis",
    "signed_error",
]


# ------------------------------------------------------------------------------------------------
# What the diagnosis of a campaign says: where, which, how far, and what next.


Effects = tuple[str, ...]
"""Effect ids, sorted; () stands for "none", ("unknown",) for what no effect explains."""


def name_of(effects: Effects) -> str:
    """Return a hypothesis as a verdict is written: "none", an id, or "a+b"."""
    return "+".join(effects) or "none"


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A set of effects and its probability.

    `with_unknown` is the share of that probability, 0 to 1, that needs something unknown besides.
    """

    effects: Effects
    probability: float
    with_unknown: float = 0.0

    @property
    def name(self) -> str:
        """As a verdict is written."""
        return name_of(self.effects)


SIGNIFICANT = 0.05
"""Family-wise p-value below which the gap varies along an axis. Convention: the usual level."""


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
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Gap:
    """Normalised RMS errors of force on held-out conditions; None where it cannot be known.

    Attributes
    ----------
    floor
        What replicates scatter by, and so what a prediction of a new specimen misses by, however
        good it is. Estimated from few replicates: an error slightly below it is as good.
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

    @property
    def laws_close_it(self) -> bool:
        """Whether refitted laws alone, with no effect added, leave less than half of it."""
        return self.recalibration_only is not None and self.recalibration_only < 0.5 * self.before


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """One effect of the verdict: its form's parameters and their 90 % intervals.

    Attributes
    ----------
    correlation
        Of the parameters' errors, a row each in their order; none where it is not known.
    """

    id: str
    form: str
    parameters: Mapping[str, float]
    interval: Mapping[str, tuple[float, float]]
    units: Mapping[str, str]
    specimens: tuple[str, ...] = ()
    correlation: tuple[tuple[float, ...], ...] = ()

    @property
    def text(self) -> str:
        """Its parameters with their units, and which specimens have it, if some alone do."""
        said = ", ".join(
            f"{name.removeprefix('log_')} {math.exp(value):.3g} times"
            if name.startswith("log_")
            else f"{name} {value:.3g} {self.units.get(name, '1')}".removesuffix(" 1")
            for name, value in self.parameters.items()
        )
        return f"{said}, of {named(self.specimens)} alone" if self.specimens else said


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
class QualityProblem:
    """Something wrong with the data; `specimen` None means the whole campaign.

    `unit_of` is what mends it, where another unit does.
    """

    specimen: str | None
    kind: str
    problem: str
    unit_of: UnitOf | None = None


@dataclass(frozen=True, slots=True)
class Experiment:
    """A test worth doing: what to change from the reference, and which hypotheses it splits.

    Attributes
    ----------
    hours
        Of all its specimens.
    detail
        In words.
    count
        How many specimens to print and test.
    row
        Of each, columns of specimens.csv and ``to_strain``, how far to pull it; a protocol that
        ends in "compression" is of one that is pushed.
    design
        Of a graded bar, the columns of the file that its row names as its profile.
    """

    change: Mapping[str, Any]
    splits: tuple[tuple[str, str], ...]
    expected_gain_nats: float
    hours: float = 0.0
    detail: str = ""
    count: int = 1
    row: Mapping[str, str | float] = field(default_factory=dict)
    design: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    __repr__ = brief


@dataclass(frozen=True, slots=True, eq=False)
class Traces:
    """Curves and residuals to draw, a test a row.

    Travel and force are positive the way a test loads: compressed specimens' are sizes.

    Attributes
    ----------
    label : (P,)
        Of the test: material or design and what differs from the reference.
    rows
        Of `measured_N`, by test.
    travel_mm, time_s, before_N, after_N : (P, T)
        Predicted by the palette alone, and with the verdict's effects: NaN where it names none.
    measured_N : (n, T)
        Of each specimen, in the campaign's order, on its test's steps.
    peaks_N : (n, 1)
        What errors are told over: the mean size of the largest forces of a specimen and its
        replicates.
    residual_before, residual_after : (n,)
        Error of each specimen by its own prediction, as `signed_error` has it.
    columns
        By axis, what each specimen has there, None where it is unknown; see `axis_columns`.
    """

    label: tuple[str, ...]
    rows: list[list[int]]
    travel_mm: FloatArray
    time_s: FloatArray
    before_N: FloatArray
    after_N: FloatArray
    measured_N: FloatArray
    peaks_N: FloatArray
    residual_before: FloatArray
    residual_after: FloatArray
    columns: Mapping[str, tuple[float | str | None, ...]]

    __repr__ = brief

    def errors(self, predicted_N: FloatArray) -> FloatArray:
        """Return measured less predicted over `peaks_N`, (n, T).

        Parameters
        ----------
        predicted_N : (P, T)
            `before_N` or `after_N`.
        """
        errors = np.empty_like(self.measured_N)
        for predicted, rows in zip(predicted_N, self.rows, strict=True):
            errors[rows] = self.measured_N[rows] - predicted
        return np.asarray(errors / self.peaks_N)


def signed_error(errors: FloatArray) -> FloatArray:
    """Return root mean squares of the last axis, below 0 where their mean is."""
    return np.asarray(np.copysign(np.sqrt(np.mean(errors**2, axis=-1)), errors.sum(axis=-1)))


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
    unit_of
        Units that the numbers may be in, as the data or a hypothesis of the class hint.
    recalibration
        By material: the factor on its law's stress that the data ask for beside the effects, as a
        logarithm, with its standard deviation.
    tested
        Levels of each condition of a palette's reference that the campaign tested, rising; and
        the ids of its materials, from soft to hard, as ``material``.
    changed
        By condition, the materials that were tested at another level of it than the palette's.
    summary
        Three sentences: where the gap lies, what causes it, how far it closes.
    own_palette
        The palette that was diagnosed; None where it is not at hand.
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
    data_quality: tuple[QualityProblem, ...]
    next_experiments: tuple[Experiment, ...]
    detectable: tuple[Detectable, ...]
    limitations: tuple[str, ...]
    unit_of: tuple[UnitOf, ...] = ()
    recalibration: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    tested: Mapping[str, tuple[float | str, ...]] = field(default_factory=dict)
    changed: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    summary: tuple[str, ...] = ()
    seed: int = 0
    traces: Traces | None = None
    own_palette: Palette | None = None

    _repr_html_ = html_of
    plot = plotted

    @one_line
    def __repr__(self) -> str:
        held = f"{counted(self.specimens, 'specimen')}, {counted(self.tests, 'test')}"
        after = "" if self.gap.after is None else f" -> {self.gap.after:.3g}"
        return f"{self.campaign}: {self.verdict}, {held}, error {self.gap.before:.3g}{after}"

    @property
    def ok(self) -> bool:
        """Whether no gap was found: nothing to explain, and nothing that remains."""
        return self.verdict == "none" and not self.remainder

    @property
    def named(self) -> bool:
        """Whether the verdict names effects of the library."""
        return self.verdict not in ("none", "unknown")

    def document(self) -> dict[str, Any]:
        """Return the diagnosis as JSON holds it, figures rounded to `_SIGNIFICANT_DIGITS`.

        What is unknown, and the open end of an interval, is None. Traces and the palette are left
        out.

        Raises
        ------
        ValueError
            A figure that must be known is not finite; the message names its key.
        """
        file = _DiagnosisFile(
            schema=1,
            palette=_PaletteFile(self.palette, self.palette_sha256),
            ranking=tuple(replace(h, effects=h.effects or ("none",)) for h in self.ranking),
            class_=tuple(effects or ("none",) for effects in self.same_class),
            not_testable=tuple(u.id for u in self.not_testable),
            not_testable_because={u.id: u.reason for u in self.not_testable},
            effect={e.id: e for e in self.effect},
            remainder=_RemainderFile(bool(self.remainder), self.remainder),
            recalibration={m: _LevelFile(*level) for m, level in self.recalibration.items()},
            **{name: getattr(self, name) for name in _ALIKE},
        )
        document: dict[str, Any] = _written(msgspec.to_builtins(file, enc_hook=np.generic.item))
        for entry in document["effect"].values():
            del entry["id"]  # its key says it
        return document

    json = json_of


# ------------------------------------------------------------------------------------------------
# diagnosis.json: a diagnosis as other programs read it, and back.


_SIGNIFICANT_DIGITS = 6
"""Of figures in the file. Convention: finer than any figure of a diagnosis is known, coarser than
what machines disagree in."""

_MOST = 1.0 + 1e-6
"""Of a probability, and of a sum of them. Numerical: what rounding to that many digits adds."""

_LEFT_OUT: Mapping[str, Mapping[str, Any]] = {
    "where": {"share_interval": None},
    "remainder.where": {"share_interval": None},
    "gap": {"generic": None},
    "data_quality": {"kind": ""},
}
"""What an entry may leave out, as it goes beyond the contract, and what stands for it."""


class _PaletteFile(msgspec.Struct):
    name: str = ""
    sha256: str = ""


class _RemainderFile(msgspec.Struct):
    significant: bool
    where: tuple[Location, ...]


class _LevelFile(msgspec.Struct):
    log_factor: float
    sd: float


class _DiagnosisFile(msgspec.Struct, kw_only=True):
    """The keys of diagnosis.json in their order; what has a default goes beyond the contract."""

    schema: Literal[1]
    version: Any = __version__
    campaign: str = ""
    palette: _PaletteFile = msgspec.field(default_factory=_PaletteFile)
    specimens: int = 0
    tests: int = 0
    tested: dict[str, tuple[float | str, ...]] = {}
    changed: dict[str, tuple[str, ...]] = {}
    seed: int = 0
    verdict: str
    summary: tuple[str, ...] = ()
    ranking: tuple[Hypothesis, ...]
    class_: tuple[Effects, ...] = msgspec.field(name="class")
    not_testable: tuple[str, ...]
    not_testable_because: dict[str, str] = {}
    where: tuple[Location, ...]
    gap: Gap
    effect: dict[str, FoundEffect]
    remainder: _RemainderFile
    data_quality: tuple[QualityProblem, ...]
    unit_of: tuple[UnitOf, ...] = ()
    next_experiments: tuple[Experiment, ...]
    detectable: tuple[Detectable, ...] = ()
    recalibration: dict[str, _LevelFile] = {}
    limitations: tuple[str, ...] = ()


_OTHERWISE = {"palette", "ranking", "not_testable", "effect", "remainder", "recalibration"}
_ALIKE = {*Diagnosis.__dataclass_fields__} & {*_DiagnosisFile.__struct_fields__} - _OTHERWISE
"""What the file holds otherwise than the diagnosis does, and as it does."""


PALETTE_FILE = "palette.toml"
"""What the diagnosed palette is called in the folder of its diagnosis."""


def read_diagnosis(path: str | Path) -> Diagnosis:
    """Read a diagnosis.json, or the folder that holds it; there are no traces in it.

    The keys of the contract suffice; those that planner does not know are ignored.

    Parameters
    ----------
    path
        The file, or the folder that ``planner gap diagnose`` wrote.

    Returns
    -------
    Diagnosis
        Without traces, which the report alone draws; with the palette that lies in the folder.

    Raises
    ------
    FileError
        The file cannot be read, is no JSON, or is not a diagnosis; the message names the key.

    Examples
    --------
    >>> planner.read_diagnosis("diagnosis").verdict  # doctest: +SKIP
    'temperature'
    """
    is_folder = isinstance(path, str | Path) and Path(path).is_dir()
    file = path_within(path, "diagnosis.json") if is_folder else path
    advice = "give a diagnosis.json as planner gap diagnose -o writes it, or its folder"
    document = decode_document(read_file(file, advice=advice), dict[str, Any], str(file))
    said = "not a diagnosis: {}; see docs/reference/diagnosis.md for its keys"
    with refused(FileError, file, said, msgspec.ValidationError):
        content = msgspec.convert(_completed(document), _DiagnosisFile)
    for key, value, allowed in _faults_of(content):
        raise FileError(f"{file}: {key} is {value}; it must be {allowed}")
    return Diagnosis(
        palette=content.palette.name,
        palette_sha256=content.palette.sha256,
        ranking=tuple(replace(h, effects=_unnamed(h.effects)) for h in content.ranking),
        same_class=tuple(map(_unnamed, content.class_)),
        not_testable=tuple(
            Untestable(id, content.not_testable_because.get(id, "")) for id in content.not_testable
        ),
        effect=tuple(content.effect.values()),
        remainder=content.remainder.where,
        recalibration={m: (r.log_factor, r.sd) for m, r in content.recalibration.items()},
        own_palette=_own_palette(Path(file), document, content.palette.sha256),
        **{name: getattr(content, name) for name in _ALIKE},
    )


def _own_palette(file: Path, document: Mapping[str, Any], sha256: str) -> Palette | None:
    """Return the palette that was written beside a diagnosis.json, unless it was changed since."""
    try:
        found = load_palette(path_within(file.parent, PALETTE_FILE))
        written = document["files_sha256"][PALETTE_FILE]
    except (FileError, PaletteError, KeyError, TypeError):
        return None
    return found.known_by(sha256) if found.sha256 == written else None


def _faults_of(file: _DiagnosisFile) -> Iterator[tuple[str, str, str]]:
    """Yield key, value and what it may be, where the type alone does not say it."""
    verdict = file.verdict.split("+")
    if not all(verdict) or verdict != sorted(set(verdict)):
        yield "verdict", repr(file.verdict), "an id, or ids joined by '+' in alphabetical order"
    named = [] if file.verdict in ("none", "unknown") else verdict
    if strange := sorted(set(file.effect) - set(named)):
        yield "effect", f"given for {', '.join(strange)}", f"for the verdict {file.verdict!r} alone"
    places = {"where": file.where, "remainder.where": file.remainder.where}
    shares = {
        **{f"ranking[{i}].probability": h.probability for i, h in enumerate(file.ranking)},
        **{f"ranking[{i}].with_unknown": h.with_unknown for i, h in enumerate(file.ranking)},
        **{f"{key}[{i}].p": at.p for key, found in places.items() for i, at in enumerate(found)},
    }
    for key, value in shares.items():
        if not 0.0 <= value <= _MOST:
            yield key, f"{value:g}", "from 0 to 1"
    if math.fsum(h.probability for h in file.ranking) > _MOST:
        yield "the sum of ranking's probabilities", "over 1", "1 at most"
    for i, test in enumerate(file.next_experiments):
        profile = str(test.row.get("profile", ""))
        if test.design and not re.fullmatch(r"profiles/[^/\\\0]+\.csv", profile):
            yield f"next_experiments[{i}].row.profile", repr(profile), "profiles/NAME.csv"
    for id, one in file.effect.items():
        if {len(one.correlation), *map(len, one.correlation)} - {0, len(one.parameters)}:
            yield f"effect.{id}.correlation", "no square", "a row and a column for each parameter"
    if file.remainder.significant != bool(file.remainder.where):
        allowed = "true where remainder.where names a place, and else false"
        yield "remainder.significant", str(file.remainder.significant).lower(), allowed
    for key in ("before", "after", "floor", "recalibration_only", "generic"):
        error = getattr(file.gap, key)
        if error is not None and error < 0.0:
            yield f"gap.{key}", f"{error:g}", "0 or above"


_OPEN = re.compile(r"^gap\.(?!before$)|interval(\.[^.]*)?$|^detectable\.size$|\.change\.")
"""Keys of figures that need not be known."""


def _written(value: Any, key: str = "") -> Any:
    """Return what JSON can hold: rounded figures, no tuples, None for what is not finite."""
    if isinstance(value, float):
        if math.isfinite(value):
            return float(f"{value:.{_SIGNIFICANT_DIGITS}g}") + 0.0  # + 0.0 turns -0.0 into 0.0
        if not _OPEN.search(key):
            raise ValueError(f"{key} of a diagnosis is {value}")
        return None
    if isinstance(value, dict):
        return {k: _written(inner, f"{key}.{k}" if key else k) for k, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_written(inner, key) for inner in value]
    return value


def _completed(value: Any, key: str = "") -> Any:
    """Return a document with what it may leave out, open ends of intervals infinite."""
    if isinstance(value, dict):
        value = {**_LEFT_OUT.get(key, {}), **value}
        if re.fullmatch(r"effect\.[^.]*", key):
            value = {"form": "", "units": {}, **value, "id": key.removeprefix("effect.")}
        return {k: _completed(inner, f"{key}.{k}" if key else k) for k, inner in value.items()}
    if key.endswith("share_interval") and value is None:
        value = [None, None]
    if not isinstance(value, list):
        return value
    if re.search(r"_interval$|\.interval\.[^.]*$", key) and len(value) == 2:
        infinite = (-math.inf, math.inf)
        return [end if end is not None else open for end, open in zip(value, infinite, strict=True)]
    return [_completed(inner, key) for inner in value]


def _unnamed(effects: Effects) -> Effects:
    return () if effects == ("none",) else effects

"""The sealed truth of a set of campaigns."""

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from planner.errors import FileError
from planner.formats.json_document import decode_document
from planner.gap.bench.hypothesis import EFFECT_IDS, UNKNOWN, Effects, effects_of

__all__ = ["CampaignTruth", "Truth", "read_truth"]


@dataclass(frozen=True, slots=True)
class CampaignTruth:
    """What one campaign hides.

    Attributes
    ----------
    effects
        Ids, sorted; () is none. One that is not in `EFFECT_IDS` stands for "unknown".
    same_class
        Hypotheses that the design cannot tell apart by construction, the truth among them.
    where
        Axes of which at least one carries the gap.
    snr, detectability
        None where nothing is hidden.
    before, with_true_effect, noise
        Normalised RMS errors of force: of the palette, with the effect, and of the bench itself.
    """

    tier: str
    effects: Effects
    same_class: frozenset[Effects]
    where: frozenset[str]
    snr: float | None
    detectability: float | None
    before: float
    with_true_effect: float
    noise: float

    def expected(self, without: Collection[str] = ()) -> Effects:
        """Return the right answer of a diagnosis that does not know the effects `without`."""
        foreign = any(i not in EFFECT_IDS or i in without for i in self.effects)
        return UNKNOWN if foreign else self.effects

    @property
    def closed(self) -> float | None:
        """Share of the gap that the true effect closes; None where there is none to close."""
        gap = self.before - self.noise
        if not self.effects or gap <= 0.0:
            return None
        return 1.0 - (self.with_true_effect - self.noise) / gap


@dataclass(frozen=True, slots=True)
class Truth:
    """A truth file: its hash, the options it was made by, and its campaigns by folder name."""

    file: str
    sha256: str
    made_by: Mapping[str, Any]
    campaigns: Mapping[str, CampaignTruth]


class _Cause(msgspec.Struct):
    effect: str
    where: list[str]


class _Gap(msgspec.Struct):
    before: float
    with_true_effect: float
    noise: float


class _Campaign(msgspec.Struct):
    tier: str
    effects: list[str]
    causes: list[_Cause]
    gap: _Gap
    same_class: list[list[str]] = msgspec.field(name="class", default_factory=list)
    snr: float | None = None
    detectability: float | None = None


class _File(msgspec.Struct):
    schema: Literal[1]
    kind: Literal["withheld-truth"]
    campaigns: dict[str, _Campaign]
    made_by: dict[str, Any] = {}


def read_truth(path: str | Path, *, sha256: str | None = None) -> Truth:
    """Read a truth file.

    Parameters
    ----------
    sha256
        The hash that was published of it; None does not check.

    Raises
    ------
    FileError
        The file cannot be read, breaks its schema, or is not the one that was published.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror or error}); give the truth file that was "
            "written when the campaigns were made"
        ) from error
    found = hashlib.sha256(data).hexdigest()
    if sha256 is not None and found != sha256.strip().casefold():
        raise FileError(
            f"{path}: its sha256 is {found}, the published one {sha256}; the file is not the one "
            "that was sealed"
        )
    file = decode_document(data, _File, path.name)
    if not file.campaigns:
        raise FileError(f"{path.name}: no campaign; there is nothing to score")
    campaigns = {name: _truth(entry, f"{path.name}, {name}") for name, entry in
                 sorted(file.campaigns.items())}  # fmt: skip
    return Truth(path.name, found, file.made_by, campaigns)


def _truth(entry: _Campaign, place: str) -> CampaignTruth:
    effects = effects_of(entry.effects)
    caused = effects_of(cause.effect for cause in entry.causes)
    if caused != effects or len(entry.causes) != len(effects):
        raise FileError(
            f"{place}: effects are {', '.join(effects) or 'none'}, causes "
            f"{', '.join(caused) or 'none'}; they must be the same, one cause an effect"
        )
    return CampaignTruth(
        tier=entry.tier,
        effects=effects,
        same_class=frozenset({effects, *(effects_of(ids) for ids in entry.same_class)}),
        where=frozenset(axis for cause in entry.causes for axis in cause.where),
        snr=entry.snr if effects else None,
        detectability=entry.detectability if effects else None,
        before=entry.gap.before,
        with_true_effect=entry.gap.with_true_effect,
        noise=entry.gap.noise,
    )

"""What a part is to be graded to: options as stated, an earlier plan to follow, and defaults."""

import hashlib
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import (
    ArgumentError,
    PlannerError,
    UnknownNameError,
    as_count,
    as_number,
    check_kind,
    did_you_mean,
    positive,
)
from planner.fields.basic import Field
from planner.fields.parse import TableFile, field_of
from planner.grading.profile import (
    SHAPES,
    Profile,
    StiffnessScale,
    profile_of,
    read_moduli,
    stated_modulus_MPa,
)
from planner.materials.mixtures import nearest_on
from planner.numerics import FloatArray, numbers_in
from planner.palette import Material, Palette
from planner.plan import Gradient, Plan, plan_file, read_plan
from planner.printers import Printer, load_printer

__all__ = ["End", "Wish", "Wished", "targets_of"]


# ------------------------------------------------------------------------------------------------
# What a caller may state, and what an earlier plan or a default fills in.


End: TypeAlias = str | float | Material
"""Where a gradient begins or ends: a material by name or value, or a modulus, in MPa or as text
with its unit."""

Wished: TypeAlias = (
    str | Path | Profile | Sequence[tuple[float, End]] | Callable[[FloatArray], ArrayLike]
)
"""A target along the field: a shape or CSV file by name, a value, rows of position and modulus, or
a function of the position."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """The options of `planner.grade` that say what is wanted; None where nothing is stated."""

    start: End | None = None
    end: End | None = None
    profile: Wished | None = None
    axis: str | tuple[float, float, float] | None = None
    field: str | Field | TableFile | Callable[[FloatArray], FloatArray] | None = None
    pitch_mm: float | None = None
    bands: int | None = None
    blend: str | None = None
    cell_mm: float | None = None
    at_strain: float | None = None
    tolerance: float | None = None
    printer: str | Path | Printer | None = None
    palette: str | Path | Palette | None = None
    unit: str | None = None

    def or_else(self, other: "Wish") -> "Wish":
        """Return this wish, with what it leaves open as another has it."""
        open_ = [f.name for f in fields(self) if getattr(self, f.name) is None]
        return replace(self, **{name: getattr(other, name) for name in open_})

    def whole(self, like: str | Path | Plan | None) -> "tuple[Wish, _EarlierPlan | None]":
        """Return this wish with nothing open that a plan needs, and the plan that it follows.

        Raises
        ------
        ArgumentError
            Options that contradict the plan to follow, or that it cannot give.
        FileError
            No such plan.
        """
        if self.field is not None and self.axis is not None:
            raise ArgumentError(
                "give `axis` or `field`, not both; `field` 'axis: z' is an axis too"
            )
        if like is None:
            return self.or_else(_DEFAULTS), None
        earlier = _earlier(like)
        return self.or_else(earlier.wish(self)).or_else(_DEFAULTS), earlier


_DEFAULTS = Wish(profile="log", blend="nearest", at_strain=0.1, tolerance=2.0, printer="connex3")


# ------------------------------------------------------------------------------------------------
# An earlier plan, whose targets in MPa are to be met again.


@dataclass(frozen=True, slots=True)
class _EarlierPlan:
    """A plan to follow, and the hash of its plan.json."""

    plan: Plan
    sha256: str

    @property
    def says(self) -> Mapping[str, Any]:
        """What the new plan says of this one."""
        plan = self.plan
        palette = {"name": plan.palette.name, "sha256": plan.palette.sha256}
        ends = {"from": plan.gradient.start, "to": plan.gradient.end}
        return {"plan_sha256": self.sha256, "palette": palette, **ends}

    def wish(self, stated: Wish) -> Wish:
        """Return what this plan was made with, as far as the options beside it leave it open.

        A field of one's own takes the place of the plan's field and its pitch, a blend that of
        its blend, bands and cells; a shape of profile runs between the ends of its target.

        Raises
        ------
        ArgumentError
            The options contradict it, or it cannot give what they leave open.
        """
        self._refuse(stated)
        gradient, part = self.plan.gradient, self.plan.part
        target = profile_of(gradient.profile)
        had_ends = gradient.start is not None and gradient.end is not None
        ends = not _has_targets(stated.profile) if stated.profile is not None else had_ends
        field, pitch_mm = None, None
        if stated.field is None and stated.axis is None:
            field = field_of(gradient.field, part.translation_mm, self.plan.folder)
            if "within_mm" not in gradient.field:
                pitch_mm = _number(gradient.field.get("pitch_mm"))
        return Wish(
            start=target.moduli_MPa[0] if ends else None,
            end=target.moduli_MPa[-1] if ends else None,
            profile=target,
            field=field,
            pitch_mm=pitch_mm,
            at_strain=self.plan.stiffness.at_strain,
            tolerance=getattr(self.plan.checks.get("worst_stiffness_error"), "limit", None),
            printer=self.plan.printer,
            palette=None if stated.palette is not None else self._own_palette(stated.printer),
            unit=None if part.unit == "mm" else part.unit,
            **({} if stated.blend is not None else _blending(gradient)),
        )

    def remarks(self, part_sha256: str) -> tuple[str, ...]:
        """Return what a reader of the new plan should know, a sentence each."""
        if part_sha256 == self.plan.part.sha256:
            return ()
        return (
            f"not the part of the plan that it follows, {self.plan.part.file}: the gradient lies "
            "where it lay there (else --axis or --field)",
        )

    def _refuse(self, stated: Wish) -> None:
        for option, end in (("from_", stated.start), ("to", stated.end)):
            if end is not None:
                raise ArgumentError(
                    f"`{option}` {_called(end)} contradicts `like`, which keeps the targets in MPa "
                    f"of the plan of {self.plan.part.file}: leave out one of the two"
                )
        strain = self.plan.stiffness.at_strain
        other = stated.at_strain is not None and stated.at_strain != strain
        if other and not _has_targets(stated.profile):
            raise ArgumentError(
                f"`at_strain` {stated.at_strain:g} contradicts `like`: the plan's targets are "
                f"secant moduli up to a strain of {strain:g}; leave out `at_strain`, or give "
                "targets of your own with `profile`"
            )

    def _own_palette(self, printer: str | Path | Printer | None) -> Palette:
        used = self.plan.palette
        with suppress(PlannerError):
            palette = load_printer(printer or self.plan.printer).palette(used.name)
            if palette.sha256 == used.sha256:
                return palette
        raise ArgumentError(
            f"the plan of {self.plan.part.file} was made with a palette {used.name} (sha256 "
            f"{used.sha256[:12]}) that its printer does not bring: give a palette file with "
            "`palette`"
        )


def _earlier(like: str | Path | Plan) -> _EarlierPlan:
    if isinstance(like, Plan):
        return _EarlierPlan(like, hashlib.sha256(like.json()).hexdigest())
    check_kind(like, (str, Path), "`like` as a planner.Plan, a plan.json or its folder")
    return _EarlierPlan(read_plan(like), hashlib.sha256(plan_file(like).read_bytes()).hexdigest())


def _blending(gradient: Gradient) -> dict[str, Any]:
    """Return the options that made a plan's blend."""
    blend = gradient.blend or {}
    name = f"bands:{blend.get('periods')}" if gradient.kind == "bands" else gradient.kind
    return {"blend": name, "bands": gradient.bands, "cell_mm": _number(blend.get("cell_mm"))}


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) else None


# ------------------------------------------------------------------------------------------------
# The target along the field: from two ends, or knot by knot.


_MEANT_AS_MODULUS = re.compile(r"[+-]?[\d.,]+(?:e[+-]?\d+)?\s*(?:[A-Z]*|N/mm.*)", re.IGNORECASE)


def targets_of(wish: Wish, scale: StiffnessScale) -> tuple[Profile, str | None, str | None]:
    """Return the target along the field, and what stands at its ends.

    Raises
    ------
    ArgumentError
        No profile, or one that does not go with the ends.
    UnknownNameError
        An end that is no material of the palette.
    FileError
        A profile file that breaks the rules.
    """
    profile, palette = wish.profile, scale.palette
    if isinstance(profile, Profile):
        return profile, _end(wish.start, "from_", scale)[1], _end(wish.end, "to", scale)[1]
    if _has_targets(profile):
        if wish.start is not None or wish.end is not None:
            named = f" {profile}" if isinstance(profile, (str, Path)) else ""
            raise ArgumentError(
                f"`profile`{named} names its own targets; leave out `from_` and `to`"
            )
        if callable(profile):
            return sampled_profile(profile), None, None
        if not isinstance(profile, (str, Path)):
            return _listed(profile, scale), None, None
        moduli = {m.id: scale.modulus_of(m.id) for m in palette.materials}
        return read_moduli(profile, moduli, lambda called: palette.resolve(called).id), None, None
    if wish.start is None or wish.end is None:
        ids = ", ".join(material.id for material in palette.materials)
        raise ArgumentError(
            "give both ends of the gradient, as in `from_` Tango `to` Vero or `from_` 0.5MPa `to` "
            f"7MPa; palette {palette.name} has {ids}"
        )
    start_MPa, start = _end(wish.start, "from_", scale)
    end_MPa, end = _end(wish.end, "to", scale)
    if start == end:
        raise ArgumentError(
            f"`from_` {_called(wish.start)} and `to` {_called(wish.end)} are one material or "
            f"modulus, {start}; a gradient needs two"
        )
    return between(str(profile), start_MPa, end_MPa, scale.moduli_MPa), start, end


def _listed(rows: object, scale: StiffnessScale) -> Profile:
    """Return the target that rows of position and modulus give, log-linear between them."""
    positions, moduli = [], []
    try:
        for position, end in rows:  # type: ignore[attr-defined]
            positions.append(position)
            moduli.append(_end(end, "profile", scale)[0])
    except (TypeError, ValueError):
        raise ArgumentError(
            f"`profile` is a {type(rows).__name__}; give a name, a CSV file, a planner.Profile, a "
            "function of the position, or rows of (position, modulus) such as [(0, 'Tango'), "
            "(1, '7MPa')]"
        ) from None
    return Profile("list", tuple(positions), tuple(moduli), "log")


def _has_targets(profile: Wished | None) -> bool:
    """Return whether a profile names its own targets, so that it needs no ends."""
    return profile.casefold().endswith(".csv") if isinstance(profile, str) else profile is not None


def _end(end: End | None, option: str, scale: StiffnessScale) -> tuple[float, str | None]:
    """Return an end's modulus, and what a plan calls it: the material's id, or the modulus."""
    if end is None:
        return 0.0, None
    if isinstance(end, Material):
        end = end.id
    if isinstance(end, str):
        stated = stated_modulus_MPa(end)
        if stated is None:
            palette = scale.palette
            try:
                id = palette.resolve(end).id
            except UnknownNameError as error:
                if _MEANT_AS_MODULUS.fullmatch(end.strip()) is None:
                    raise
                raise ArgumentError(
                    f"`{option}` {end}: it is no material of palette {palette.name}; for a "
                    "modulus, write a decimal point and its unit (kPa, MPa or GPa), as in 0.5MPa"
                ) from error
            return scale.modulus_of(id), id
        end = stated
    modulus_MPa = positive(end, f"`{option}`")
    return modulus_MPa, f"{modulus_MPa:.9g}MPa"


def _called(end: End) -> str:
    return end.id if isinstance(end, Material) else f"{end}"


# ------------------------------------------------------------------------------------------------
# Profiles by a name, between two moduli, and by a function.


_PROFILES = (*SHAPES, "steps:N", "grades", "FILE.csv")


def between(
    spec: str, start_MPa: float, end_MPa: float, moduli_MPa: Sequence[float] = ()
) -> Profile:
    """Make the profile that `spec` names between two moduli.

    Parameters
    ----------
    spec
        ``log``, ``linear``, ``smooth``, ``steps:N`` (N equal steps, evenly spaced in log) or
        ``grades`` (an equal length of each material from the one nearest to the first modulus to
        that nearest to the other).
    moduli_MPa
        Of the catalogue materials, strictly rising; for ``grades``.

    Raises
    ------
    ArgumentError
        An unknown name, fewer than two steps, or both ends nearest to one material.
    """
    if spec in SHAPES:
        return Profile(spec, (0.0, 1.0), (start_MPa, end_MPa), SHAPES[SHAPES.index(spec)])
    if spec == "grades":
        return _steps(spec, _grades(start_MPa, end_MPa, moduli_MPa))
    if spec.startswith("steps:"):
        word = spec.removeprefix("steps:")
        steps = next(iter(numbers_in([word], int)), word)
        count = as_count(steps, f"`profile` {spec}: N", 10_000, least=2)
        ratio = end_MPa / start_MPa
        return _steps(spec, [start_MPa * ratio ** (i / (count - 1)) for i in range(count)])
    hint = did_you_mean(spec, ["log", "linear", "smooth", "steps:5", "grades"])
    raise ArgumentError(f"`profile` {spec}: no such profile; {hint}it takes {', '.join(_PROFILES)}")


def _steps(name: str, moduli_MPa: Sequence[float]) -> Profile:
    """Give each modulus an equal length of the field."""
    edges = [i / len(moduli_MPa) for i in range(len(moduli_MPa) + 1)]
    positions = tuple(u for pair in itertools.pairwise(edges) for u in pair)
    twice = tuple(modulus for modulus in moduli_MPa for _ in range(2))
    return Profile(name, positions, twice, "log")


def _grades(start_MPa: float, end_MPa: float, moduli_MPa: Sequence[float]) -> list[float]:
    """Return the moduli of the materials between two, those included, in log stiffness.

    What is wanted at the first and the last is the end itself, so that the material's distance
    from it counts as an error.
    """
    first, last = nearest_on(moduli_MPa, (start_MPa, end_MPa)).tolist()
    if first == last:
        raise ArgumentError(
            f"`profile` grades: {start_MPa:.3g} and {end_MPa:.3g} MPa are both nearest to one "
            f"material of the palette, with {moduli_MPa[first]:.3g} MPa; it takes two or more"
        )
    step = 1 if first < last else -1
    return [start_MPa, *moduli_MPa[first + step : last : step], end_MPa]


_SAMPLES = 257
"""Places at which a function is read. Chosen: between them it is followed to 1e-4 of its bend."""


def sampled_profile(modulus_MPa: Callable[[FloatArray], ArrayLike]) -> Profile:
    """Follow a function of the position, 0 to 1, that returns moduli in MPa.

    It is read at 257 places, log-linear between them, so that a jump becomes a steep ramp.

    Parameters
    ----------
    modulus_MPa
        Takes an array of positions, or one position at a time.

    Raises
    ------
    ArgumentError
        It returns something else than a modulus for each position.
    """
    u = np.linspace(0.0, 1.0, _SAMPLES)
    try:
        moduli = np.asarray(modulus_MPa(u), dtype=np.float64)
    except (TypeError, ValueError):  # it takes one at a time
        each = (np.asarray(modulus_MPa(v), dtype=object) for v in u)
        moduli = np.array([as_number(value.flat[0], "`profile`: the function") for value in each])
    if moduli.shape not in ((), u.shape):
        raise ArgumentError(
            f"`profile`: the function returns an array of shape {moduli.shape} for {len(u)} "
            "positions; it must return a modulus in MPa for each"
        )
    values = np.broadcast_to(moduli, u.shape).tolist()
    return Profile("function", tuple(u.tolist()), tuple(values), "log")

"""A plan's table as rows of words: what the terminal and the page show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.plan import Plan, Region

__all__ = [
    "PlanTable",
    "error_words",
    "format_interval",
    "format_number",
    "format_range",
    "mm_along",
    "moved_words",
    "plan_table",
    "unreachable_words",
]


def format_number(value: float, digits: int = 3) -> str:
    """Write a figure with `digits` significant digits, without exponent where it reads well."""
    if value == 0.0:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        exponent = int(f"{value:e}".split("e")[1])
        return f"{value:.{max(0, digits - 1 - exponent)}f}"
    return f"{value:.{digits - 1}e}"


def format_range(ends: Sequence[float]) -> str:
    """Write the two ends of a range with three significant digits, or the one that they are."""
    return " .. ".join(dict.fromkeys(format_number(end) for end in ends))


def format_interval(ends: Sequence[float]) -> str:
    """Write how sure a figure is; one of no width is of a palette that states no uncertainty."""
    return format_range(ends) if ends[0] < ends[-1] else "unknown"


@dataclass(frozen=True, slots=True)
class PlanTable:
    """What was wanted and what is printed, a row a region.

    Attributes
    ----------
    rows
        By column, one for each of `Plan.regions`.
    total
        Of the whole part: a row with fewer columns.
    right
        Columns whose figures stand flush right.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Mapping[str, str], ...]
    total: Mapping[str, str]
    right: tuple[str, ...] = ("#", "achieved MPa", "error", "volume mm3", "mass g")


def plan_table(plan: "Plan") -> PlanTable:
    """Return the table of a plan."""
    long = isinstance(plan.gradient.field.get("span_mm"), float)
    begin, way = mm_along(plan.gradient.field) if long else (0.0, 1.0)
    rows = tuple(
        {
            "#": str(r.index),
            "material": r.printed,
            "blend": _blend_text(r),
            "along mm" if long else "field": " .. ".join(
                f"{begin + u * way:.{2 if long else 4}f}" for u in r.field
            ),
            "target MPa": format_range(r.target_modulus_MPa),
            "achieved MPa": format_number(r.modulus_MPa),
            "95 % interval": format_interval(r.modulus_interval_MPa),
            "error": " .. ".join(dict.fromkeys(f"{100 * e:+.0f}" for e in r.error)) + " %",
            "volume mm3": format_number(r.volume_mm3, 4),
            "mass g": format_number(r.mass_g),
        }
        for r in plan.regions
    )
    total = {
        "material": "all",
        "volume mm3": format_number(sum(r.volume_mm3 for r in plan.regions), 4),
        "mass g": format_number(sum(r.mass_g for r in plan.regions)),
    }
    blended = plan.gradient.blend is not None
    return PlanTable(
        f"{plan.part.file} on {plan.printer}: secant modulus at strain "
        f"{plan.stiffness.at_strain:g}",
        tuple(name for name in rows[0] if name != "blend" or blended),
        rows,
        total,
    )


def error_words(plan: "Plan") -> str:
    """Say how far the stiffness is off its target at worst, and what would make it less.

    Nothing of a plan that does not say so.
    """
    from planner.grading.stiffness_error import error_text

    check = plan.checks.get("worst_stiffness_error")
    if check is None:
        return ""
    better = [
        f"{option} {error_text(ratio)}" for option, ratio in plan.stiffness.alternatives.items()
    ]
    return f"largest error of the stiffness: {', '.join([error_text(check.value), *better])}"


def moved_words(plan: "Plan") -> str:
    """Say how many cuts were moved off faces of the part; nothing where none was."""
    snap = plan.gradient.snap
    if snap is None:
        return ""
    moved = snap["moved"]
    cuts = "1 cut was" if len(moved) == 1 else f"{len(moved)} cuts were"
    return (
        f"{cuts} moved by up to {max(cut['by_mm'] for cut in moved):.2f} mm, so that no sliver is "
        "left beside a face of the part (--snap 0: not at all)"
    )


def unreachable_words(plan: "Plan") -> list[str]:
    """Say of each stretch whose target no material reaches where it lies and what comes nearest."""
    return [
        f"target {missed.target_modulus_MPa[0]:.3g} .. {missed.target_modulus_MPa[1]:.3g} MPa at "
        f"field {missed.field[0]:.3f} .. {missed.field[1]:.3f} is out of reach; the nearest is "
        f"{missed.nearest} with {missed.modulus_MPa:.3g} MPa"
        for missed in plan.unreachable
    ]


def mm_along(field: Mapping[str, object]) -> tuple[float, float]:
    """Return where a field that is a length begins, and how far it goes, in mm."""
    begin, end, span = field.get("from_mm"), field.get("to_mm"), field.get("span_mm")
    if isinstance(begin, float) and isinstance(end, float):
        return begin, end - begin
    return 0.0, span if isinstance(span, float) else 1.0


def _blend_text(region: "Region") -> str:
    """Say in a few words what a region has to do with its neighbour."""
    blend = region.blend or {}
    if blend.get("kind") == "dither":
        return f"{100 * blend['volume_fraction']:.1f} % {blend['upper']} in {blend['lower']}"
    if blend.get("kind") == "bands":
        return f"{100 * blend['share']:.1f} % {blend['upper']}, {blend['lower']} in turn"
    if blend.get("kind") == "mix":
        return f"{100 * blend['fraction']:.1f} % {blend['upper']} mixed in {blend['lower']}"
    return ""

"""What each specimen has on every axis that a column of specimens.csv gives."""

from collections.abc import Mapping

from planner.gap.campaign import Campaign

__all__ = ["COLUMNS", "axis_columns"]

COLUMNS = (
    "rate_mm_s", "temperature_C", "soak_h", "age_days", "orientation", "protocol", "batch",
    "width_mm", "thickness_mm", "measured_width_mm", "measured_thickness_mm", "gauge_mm",
)  # fmt: skip
"""Known columns along which a gap may vary, besides material and design."""


def axis_columns(campaign: Campaign) -> Mapping[str, tuple[float | str | None, ...]]:
    """Return the columns by name, each with a value a specimen in the campaign's order.

    ``material`` holds the design's name for a graded bar, ``specimen`` the id; further columns
    stand last under their own names.
    """
    specimens = campaign.specimens
    columns: dict[str, tuple[float | str | None, ...]] = {
        "specimen": tuple(s.id for s in specimens),
        "material": tuple(s.material or (s.profile.name if s.profile else None) for s in specimens),
    }
    for name in COLUMNS:
        columns[name] = tuple(getattr(s, name) for s in specimens)
    for name in campaign.covariates:
        columns[name] = tuple(s.covariates.get(name) for s in specimens)
    return columns

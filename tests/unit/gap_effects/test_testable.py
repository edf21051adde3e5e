"""What a campaign can tell an effect by, and the reasons where it cannot."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.gap.campaign import Campaign, Specimen
from planner.gap.effect import untestable
from planner.gap.effects import EFFECTS
from planner.printers import load_printer
from planner.simulation.bar import ProfileDesign

CONNEX3 = load_printer("connex3").palette()
PALETTE = replace(CONNEX3, reference=replace(CONNEX3.reference, strain_rate_per_s=0.01))
STEP_BAR = ProfileDesign("step", np.array([0.0, 12.5, 12.5, 25.0]), np.array([0.1, 0.1, 0.9, 0.9]))


def specimen(k: int, kind: str = "monotonic", **changes: Any) -> Specimen:
    """A specimen of a linear law, pulled to strain 0.4 as fast as the palette's, at 0.25 mm/s."""
    t = np.linspace(0.0, 40.0, 401)
    travel = {
        "monotonic": 0.25 * t,
        "cyclic": 10.0 * (1.0 - np.abs(1.0 - t / 20.0)),
        "relaxation": np.minimum(t, 10.0),
    }[kind]
    values: dict[str, Any] = {"material": "FLX9760", "width_mm": 6.0, "thickness_mm": 2.0}
    return Specimen(f"S{k}", t, travel, 1.0 * travel, 25.0, **(values | changes))


def reason(id: str, *specimens: Specimen) -> str | None:
    return untestable(EFFECTS[id], Campaign("one", "connex3", PALETTE, specimens))


def test_a_condition_must_be_known_and_vary() -> None:
    hot = [specimen(k, temperature_C=t) for k, t in enumerate((23.0, 23.4, 22.8))]
    assert reason("temperature", *hot) == "temperature_C was 23 in all specimens"
    assert reason("temperature", *hot, specimen(3, temperature_C=33.0)) is None
    nothing = [specimen(k) for k in range(3)]
    assert reason("temperature", *nothing) == "temperature_C is not known for any specimen"
    assert (
        reason("temperature", *hot, specimen(3))
        == "temperature_C is known for 3 of 4 specimens, and was 23 in them"
    )
    turned = [specimen(0, orientation="x"), specimen(1, orientation="x")]
    assert reason("orientation", *turned) == "orientation was x in all specimens"
    assert reason("orientation", *turned, specimen(2, orientation="z")) is None
    assert reason("moisture", specimen(0, soak_h=0.0), specimen(1, soak_h=24.0)) is None
    assert "age_days was 9" in (reason("ageing", specimen(0, age_days=9.0)) or "")


@pytest.mark.parametrize(
    ("id", "column", "own", "other"),
    [("temperature", "temperature_C", 23, 35), ("moisture", "soak_h", 0, 24),
     ("ageing", "age_days", 9, 60), ("orientation", "orientation", "x", "z")],
)  # fmt: skip
def test_a_condition_that_is_not_the_palettes_is_told_by_its_laws(
    id: str, column: str, own: Any, other: Any
) -> None:
    """All at 35 degC against laws of 23 degC: temperature may be the cause, and none varies it.

    Where the palette does not say at which it was measured, there is nothing to tell it by.
    """
    alike = [specimen(k, **{column: other}) for k in range(3)]
    assert reason(id, *alike) is None
    same = [specimen(k, **{column: own}) for k in range(3)]
    assert (reason(id, *same) or "").startswith(f"{column} was {own}")
    unsaid = replace(PALETTE, reference=replace(PALETTE.reference, **{column: None}))
    found = untestable(EFFECTS[id], Campaign("one", "connex3", unsaid, alike))
    assert found == f"{column} was {other} in all specimens"


def test_rate_is_told_by_records_or_by_a_hold() -> None:
    slow = specimen(0, rate_mm_s=0.25)
    lied = specimen(1, rate_mm_s=2.5)
    assert reason("rate", slow, lied) == (
        "rate_mm_s was 0.25 in all specimens and no specimen was held at a strain"
    )
    held = specimen(2, "relaxation")
    assert reason("rate", held, specimen(3, "relaxation")) is None
    fast = replace(slow, id="S4", time_s=slow.time_s / 10.0)
    assert reason("rate", slow, fast) is None
    unlike = [replace(s, time_s=s.time_s / 10.0) for s in (slow, lied)]
    assert reason("rate", *unlike) is None, "of each other's, not of the palette's"
    untimed = [replace(s, time_recorded=False) for s in (slow, lied)]
    assert reason("rate", *untimed) is None


def test_channels_are_found_in_the_records() -> None:
    pulled = specimen(0, protocol="cyclic")
    assert reason("softening", pulled) == "no specimen was unloaded"
    assert reason("permanent-set", pulled) == "no specimen was unloaded"
    assert reason("softening", specimen(1, "cyclic", protocol="monotonic")) is None
    assert reason("interface-bleed", pulled) == "there is no graded bar"
    assert reason("composition-offset", pulled) == "there is one material only"
    assert reason("material-law", pulled) == "there is one material only"
    assert reason("composition-offset", pulled, specimen(1, material="FLX9740")) is None
    bar = specimen(2, material=None, profile=STEP_BAR)
    assert reason("interface-bleed", bar) is None
    assert reason("composition-offset", bar) is None
    plain = replace(STEP_BAR, coordinate=np.full(4, 0.5))
    assert reason("interface-bleed", replace(bar, profile=plain)) == "there is no graded bar"
    sizeless = replace(bar, width_mm=None, thickness_mm=None)
    assert reason("cross-section", sizeless) == "width and thickness are not known for any specimen"


@pytest.mark.parametrize(
    "id",
    ["grip-slack", "grip-slip", "machine-compliance", "cross-section", "force-scale",
     "force-offset", "strain-scale", "skin"],
)  # fmt: skip
def test_grips_sensors_and_geometry_can_always_be_told(id: str) -> None:
    assert reason(id, specimen(0)) is None

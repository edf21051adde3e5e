"""Write gap-effects.md from the effects: python docs/explanation/make_gap_effects.py."""

from collections.abc import Iterator
from pathlib import Path

from planner.gap.effect import STANDARD, Effect, Form, Parameter
from planner.gap.effects import EFFECTS

TARGET = Path(__file__).with_name("gap-effects.md")

HEAD = f"""# The effects of the gap

Made by `docs/explanation/make_gap_effects.py` from `planner/gap/effects`; do not edit.

A palette's laws hold at its reference conditions, for the mixture that was asked for, at first
loading. An effect is something they leave out. Each attaches to one stage of the forward model, in
the order in which a specimen comes to be: the composition that was printed, its law, its geometry,
its boundary (grips and machine), the sensor.

An effect has several forms, as nobody knows its true one, and of every form a size first: 0 is
off, below the lower bound it is not worth naming, above the upper one it is not physical. Sizes
marked ± may have either sign. Bounds marked log stand for equal ratios being equally likely. At
most two parameters more give a form its shape. Some forms have details beside: values that are
normal with deviation 1 before any data, and 0 unless the data ask for more.

Everything is told relative to the palette's reference: at its rate, temperature, soaking, age and
direction an effect of these changes nothing. Where a palette does not name one of them,
{STANDARD.strain_rate_per_s:g} /s, {STANDARD.temperature_C:g} °C, {STANDARD.soak_h:g} h and
{STANDARD.age_days:g} days along x stand in; a specimen whose own is unknown counts as being at
the reference. A law that relaxes is made stiffer at once by as much as it relaxes in the palette's
own test (a pull at the reference's rate), strain by strain, so that this test stays what it was.

Some forms are graded: w(m) = exp(-((u - peak) / 0.7)²) says how much of the effect a mixture
shows, u its place on the palette from 0, softest, to 1, hardest. Rate and temperature act most on
soft and middling mixtures and little on rigid ones, but a palette of soft grades alone may show
the reverse.

An effect cannot be tested, and is then neither found nor excluded, where a column it needs is
unknown or the same for all specimens (within what replicates may differ by), or where nothing it
shows in was measured. Some vary from specimen to specimen about their mean; force scale may hold
for some specimens only.
"""

TAIL = """## Choices

- **Unit slips** have forms of their own, with the factor known to 3 %. As they have almost no room
  in which to be tuned, data that fit one of them are strong evidence for it, where a free gain of
  the same size is not. A slip between other units is one form with room up to ln 1100.
- **Material law** has a factor and a tilt with strain for each material of the palette, full at it
  and falling to nothing at its neighbours; the table shows them for a palette of three. The
  palette's own uncertainty is allowed for beside it: sizes begin at 10 %.
- **Composition** is kept within the palette: the nearer its end, the less a mixture moves towards
  it. Pure resins cannot become purer.
- **Bleed** is the exact convolution of the drawn profile with its kernel: the profile is made of
  steps and bends, and each goes over into the kernel's integral or double integral. Densely
  sampled profiles are first replaced by straight pieces within 0.0001 of the coordinate. A bar is
  taken to go on beyond its gauge as it ends.
- **Slack, set, softening** leave the first loading beyond them alone, or shift it; what tells them
  apart is the way back. Slack that seats for good does not return; dead travel does.
- **Skin, section, gain** and a palette that is off as a whole look alike where all specimens have
  one size. They can be tested still, but come out as one class.
"""


def page() -> str:
    """Return the page."""
    lines = [
        HEAD,
        "## Overview",
        "",
        "| effect | stage | varies along | needs |",
        "| --- " * 4 + "|",
    ]
    ordered = sorted(EFFECTS.values(), key=lambda effect: (effect.order, effect.id))
    for effect in ordered:
        where = ", ".join(f"`{axis}`" for axis in effect.where)
        lines.append(f"| `{effect.id}` | {effect.stage} | {where} | {_needs(effect)} |")
    lines += ["", "## Forms", ""]
    for effect in ordered:
        lines += [f"### {effect.id}: {effect.title}", ""]
        lines += ["| form | equation | parameters | source |", "| --- " * 4 + "|"]
        lines += [_row(form) for form in effect.forms]
        lines += ["", *_scatter(effect)]
    return "\n".join([*lines, TAIL])


def _row(form: Form) -> str:
    equation = form.equation.replace("|", r"\|")
    described = [_bounds(p) for p in form.parameters]
    if form.details:
        described.append(f"details: {', '.join(form.details)}")
    parameters = "<br>".join(described)
    return f"| {form.name} | `{equation}` | {parameters} | {form.source} |"


def _bounds(parameter: Parameter) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    sign = "±" if parameter.signed else ""
    log = ", log" if parameter.log else ""
    return (
        f"{parameter.name} {sign}({parameter.low:.4g} to {parameter.high:.4g}){unit}{log}: "
        f"{parameter.meaning}"
    )


def _needs(effect: Effect) -> str:
    words = {
        "unloading": "a specimen that is unloaded",
        "hold": "a hold",
        "bar": "a graded bar",
        "materials": "two materials or a graded bar",
        "section": "known width and thickness",
    }
    needs = [
        " or ".join(words.get(name, f"`{name}` that varies") for name in entry.split("|"))
        for entry in (*effect.covariates, *effect.channels)
    ]
    return ", ".join(needs) or "nothing more"


def _scatter(effect: Effect) -> Iterator[str]:
    if effect.individual:
        yield f"Differs from specimen to specimen by {100 * effect.individual:.0f} % of its mean."
        yield ""
    if effect.some:
        yield "May hold for some specimens only, alike in these."
        yield ""


if __name__ == "__main__":
    TARGET.write_text(page(), encoding="utf-8", newline="\n")

"""The library of effects as tables for the site."""

from collections.abc import Iterator

from planner.gap.effect import Effect, Form, Parameter
from planner.gap.effects import EFFECTS


def tables() -> str:
    """Return all effects in one table, then a table of forms for each."""
    lines = [
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
    return "\n".join(lines)


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

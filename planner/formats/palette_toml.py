"""Palette files: TOML in one canonical form, so that equal palettes are equal bytes."""

import contextlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from planner.errors import OutputError
from planner.palette import LawParameters, Material, Palette, Uncertainty

__all__ = ["SIGNIFICANT_DIGITS", "encode_palette", "write_palette"]

SIGNIFICANT_DIGITS = 9
"""Figures are rounded to this: finer than any measurement, coarser than the last bits in which
mathematical libraries of different machines differ."""

_LISTS = {"yeoh", "ogden", "ogden-thesis"}
"""Models whose parameters are lists whatever their length; the others' are single figures."""


def encode_palette(palette: Palette) -> bytes:
    """Write a palette as `planner.palette.parse_palette` reads it.

    Keys come in a fixed order, those at their default are left out, figures are rounded to
    `SIGNIFICANT_DIGITS`; UTF-8. `Palette.sha256` is not written: it is the file's own.
    """
    return ("\n".join(_lines(palette)) + "\n").encode("utf-8")


def write_palette(palette: Palette, path: str | Path, *, force: bool = False) -> None:
    """Write a palette file whole or not at all.

    Raises
    ------
    OutputError
        The file is there already and `force` is false, or the system refused.
    """
    target = Path(path)
    if target.exists() and not force:
        raise OutputError(f"{path}: exists already; replace it with --force, or name another file")
    scratch = target.with_name(f".{target.name}.partial")
    try:
        scratch.write_bytes(encode_palette(palette))
        scratch.replace(target)
    except OSError as error:
        raise OutputError(
            f"{path}: {error.strerror or error}; nothing was written; choose another place with "
            "--output"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            scratch.unlink()


def _lines(palette: Palette) -> Iterator[str]:
    yield "schema = 1"
    yield f"name = {_text(palette.name)}"
    yield 'kind = "palette"'
    if palette.source:
        yield f"source = {_text(palette.source)}"
    reference = palette.reference
    conditions = {
        "strain_rate_per_s": reference.strain_rate_per_s,
        "temperature_C": reference.temperature_C,
        "soak_h": reference.soak_h,
        "age_days": reference.age_days,
        "orientation": reference.orientation,
    }
    if any(value is not None for value in conditions.values()):
        yield from ("", "[reference]")
        yield from _pairs(conditions)
    for material in palette.materials:
        yield from ("", "[[material]]")
        yield from _material(material)


def _material(material: Material) -> Iterator[str]:
    default = Material("", 0.0, 0.0, 0.0, material.law)
    yield f"id = {_text(material.id)}"
    if material.aliases:
        yield f"aliases = [{', '.join(_text(a) for a in material.aliases)}]"
    yield f"coordinate = {_number(material.coordinate)}"
    yield f"elongation_at_break = {_number(material.elongation_at_break)}"
    yield f"density_g_cm3 = {_number(material.density_g_cm3)}"
    yield f"deformation = {_text(material.deformation)}"
    yield f"modulus_log_sd = {_number(material.modulus_log_sd)}"
    if material.colour != default.colour:
        yield f"colour = {_text(material.colour)}"
    if material.source:
        yield f"source = {_text(material.source)}"
    yield from _law("law", material.law)
    if material.published is not None:
        yield from _law("published", material.published)
    if material.uncertainty is not None:
        yield from _uncertainty(material.uncertainty)


def _law(key: str, law: LawParameters) -> Iterator[str]:
    yield f"[material.{key}]"
    yield f"model = {_text(law.model)}"
    for symbol, values in law.parameters.items():
        single = len(values) == 1 and (law.model not in _LISTS or symbol.startswith("strain"))
        yield f"{symbol} = {_number(values[0]) if single else _list(values)}"


def _uncertainty(uncertainty: Uncertainty) -> Iterator[str]:
    yield "[material.uncertainty]"
    yield from _pairs(
        {
            "specimens": uncertainty.specimens,
            "level": uncertainty.level,
            "basis": uncertainty.basis or None,
            "r2": uncertainty.r2,
            "nrmse": uncertainty.nrmse,
            "held_out_error": uncertainty.held_out_error,
        }
    )
    for key, ends in (("law_low", uncertainty.law_low), ("law_high", uncertainty.law_high)):
        if ends:
            yield f"[material.uncertainty.{key}]"
            for symbol, values in ends.items():
                yield f"{symbol} = {_list(values)}"


def _pairs(values: Mapping[str, str | float | None]) -> Iterator[str]:
    for key, value in values.items():
        if isinstance(value, str):
            yield f"{key} = {_text(value)}"
        elif value is not None:
            yield f"{key} = {value if isinstance(value, int) else _number(value)}"


def _list(values: Sequence[float]) -> str:
    return f"[{', '.join(_number(v) for v in values)}]"


def _number(value: float) -> str:
    """Write a TOML float; open ends of intervals are inf."""
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    rounded = float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0  # + 0.0 turns -0.0 into 0.0
    return repr(rounded)


def _text(value: str) -> str:
    """Write a TOML basic string: JSON's escapes, and DEL, which JSON lets through."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")

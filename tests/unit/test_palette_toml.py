"""Palette files are read back as they were written, in one canonical form."""

import math
import tomllib
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import OutputError, PaletteError
from planner.palette import (
    LAW_PARAMETERS,
    LawParameters,
    Material,
    Palette,
    Reference,
    Uncertainty,
    encode_palette,
    load_palette,
    parse_palette,
    write_palette,
)

figures = st.floats(-1e9, 1e9, allow_nan=False).map(lambda v: float(f"{v:.9g}") + 0.0)
positive = st.floats(1e-6, 1e6).map(lambda v: float(f"{v:.9g}"))
possible = st.floats(1e-6, 24.0).map(lambda v: float(f"{v:.9g}"))  # as breaks and densities
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
ends = st.dictionaries(
    st.sampled_from(["mu_MPa", "alpha"]),
    st.lists(figures | st.sampled_from([math.inf, -math.inf]), min_size=1, max_size=3).map(tuple),
)
uncertainties = st.builds(
    Uncertainty, specimens=st.integers(1, 99), level=st.just(0.95), law_low=ends, law_high=ends,
    basis=texts, r2=st.none() | figures, nrmse=st.none() | figures,
    held_out_error=st.none() | figures,
    strain=st.just((0.0, 0.5)), log_sd=st.just((0.1, 0.05)),
)  # fmt: skip
LENGTHS = {"yeoh": {"c_MPa": 3}, "ogden-thesis": {"c": 6}, "ogden": {"mu_MPa": 2, "alpha": 2}}


@st.composite
def laws(draw: st.DrawFn) -> LawParameters:
    model = draw(st.sampled_from(sorted(LAW_PARAMETERS)))
    return LawParameters(
        model,
        {
            symbol: tuple(draw(figures) for _ in range(LENGTHS.get(model, {}).get(symbol, 1)))
            for symbol in LAW_PARAMETERS[model]
        },
    )


@st.composite
def palettes(draw: st.DrawFn) -> Palette:
    count = draw(st.integers(1, 3))
    materials = tuple(
        Material(
            id=f"M{number}",
            aliases=draw(st.sampled_from([(), (f"alias {number}", f"µ{number}")])),
            coordinate=float(number) / 3.0 if number % 3 == 0 else float(number),
            elongation_at_break=draw(possible),
            density_g_cm3=draw(possible),
            law=draw(laws()),
            published=draw(st.none() | laws()),
            colour=draw(st.sampled_from(["#808080", "#FBD724"])),
            source=draw(texts),
            deformation=draw(st.sampled_from(["elastic", "plastic"])),
            modulus_log_sd=draw(st.floats(0, 1).map(lambda v: float(f"{v:.9g}"))),
            uncertainty=draw(st.none() | uncertainties),
        )
        for number in range(count)
    )
    reference = Reference(
        strain_rate_per_s=draw(st.none() | positive), orientation=draw(st.sampled_from([None, "x"]))
    )
    resins = draw(st.sampled_from([(), ("Soft", 'Hard "1"')]))
    hardness = draw(st.sampled_from([(), ((0.0, 27.0), (1.0, 95.5))]))
    return Palette(draw(texts), materials, reference, draw(texts), resins, hardness)


@settings(deadline=None, derandomize=True, max_examples=150)
@given(palettes())
def test_a_palette_is_read_back_as_it_was(palette: Palette) -> None:
    data = encode_palette(palette)
    read = parse_palette(data, name="test")
    # Figures had nine digits already, so that nothing at all may change.
    assert read.materials == palette.materials
    assert read.reference == palette.reference
    assert (read.name, read.source) == (palette.name, palette.source)
    assert (read.base_resins, read.hardness) == (palette.base_resins, palette.hardness)
    assert encode_palette(read) == data


def test_figures_keep_nine_digits() -> None:
    law = LawParameters("linear", {"modulus_MPa": (1.0 / 3.0,)})
    data = encode_palette(Palette("p", (Material("a", 0.0, -0.0 + 1.0, 1.1, law),)))
    assert b"modulus_MPa = 0.333333333\n" in data


def test_one_ogden_term_is_a_list() -> None:
    law = LawParameters("ogden", {"mu_MPa": (0.3,), "alpha": (2.5,)})
    document = tomllib.loads(
        encode_palette(Palette("p", (Material("a", 0.0, 1.0, 1.1, law),))).decode()
    )
    assert document["material"][0]["law"] == {"model": "ogden", "mu_MPa": [0.3], "alpha": [2.5]}


def test_an_unknown_key_of_uncertainty_is_named() -> None:
    law = LawParameters("linear", {"modulus_MPa": (1.0,)})
    palette = Palette("p", (Material("a", 0.0, 1.0, 1.1, law, uncertainty=Uncertainty(3)),))
    data = encode_palette(palette).replace(b"specimens = 3", b"specimens = 3\nguess = 1")
    with pytest.raises(PaletteError, match=r"guess.*material\[0\]\.uncertainty"):
        parse_palette(data, name="test")


def test_uncertainty_is_a_value() -> None:
    assert Uncertainty(3) == Uncertainty(3)
    with pytest.raises(AttributeError):
        Uncertainty(3).specimens = 4  # type: ignore[misc]
    assert msgspec.structs.replace(Uncertainty(3), specimens=4).specimens == 4


def test_writing_is_whole_or_not_at_all(tmp_path: Path) -> None:
    law = LawParameters("linear", {"modulus_MPa": (1.0,)})
    palette = Palette("p", (Material("a", 0.0, 1.0, 1.1, law),))
    target = tmp_path / "p.toml"
    write_palette(palette, target)
    assert load_palette(target).materials == palette.materials
    with pytest.raises(OutputError, match=r"p\.toml: exists already; replace it with `force`"):
        write_palette(palette, target)
    write_palette(palette, target, force=True)
    with pytest.raises(OutputError, match="there is no folder"):
        write_palette(palette, tmp_path / "missing" / "p.toml")
    assert [path.name for path in tmp_path.iterdir()] == ["p.toml"]

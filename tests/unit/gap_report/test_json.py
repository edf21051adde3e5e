"""diagnosis.json holds what the contract asks for, and reads back."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.errors import FileError
from planner.gap.diagnosis import Diagnosis, Hypothesis, read_diagnosis
from planner.report.gap_page import verdict_text

Examples = dict[str, Diagnosis]
CONTRACT = {
    "schema",
    "verdict",
    "ranking",
    "class",
    "not_testable",
    "where",
    "gap",
    "effect",
    "remainder",
    "data_quality",
    "next_experiments",
}
CONTRACT_GAP = {
    "before",
    "after",
    "floor",
    "closed",
    "closed_interval",
    "recalibration_only",
    "held_out",
}


def read(folder: Path, document: object) -> Diagnosis:
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return read_diagnosis(path)


def test_the_document_has_the_keys_of_the_contract(diagnosis: Diagnosis) -> None:
    document = json.loads(diagnosis.json())
    assert set(document) >= CONTRACT
    assert set(document["gap"]) >= CONTRACT_GAP
    assert document["schema"] == 1
    assert all(isinstance(id, str) for id in document["not_testable"])
    assert set(document["remainder"]) == {"significant", "where"}
    assert document["remainder"]["significant"] == bool(diagnosis.remainder)
    assert "+".join(document["ranking"][0]["effects"]) == diagnosis.verdict


def test_reading_a_document_gives_the_diagnosis_back(diagnosis: Diagnosis, tmp_path: Path) -> None:
    """But for the traces, and for digits beyond the sixth."""
    back = read(tmp_path, json.loads(diagnosis.json()))
    assert back.document() == diagnosis.document()
    assert back.json() == diagnosis.json()
    assert (back.traces, back.same_class, back.where) == (
        None,
        diagnosis.same_class,
        diagnosis.where,
    )


def test_figures_are_rounded_and_open_ends_are_null(examples: Examples, tmp_path: Path) -> None:
    document = examples["rate"].document()
    assert document["ranking"][0]["probability"] == 0.912346
    assert document["effect"]["rate"]["interval"]["centre"] == [8.0, None]
    assert read(tmp_path, document).effect[0].interval["centre"] == (8.0, np.inf)
    assert document["next_experiments"][0]["change"] == {"rate_mm_s": 0.005, "replicates": 3}


def test_a_figure_that_must_be_known_is_never_written_as_nan(examples: Examples) -> None:
    with pytest.raises(ValueError, match=r"gap\.before"):
        replace(examples["rate"], gap=replace(examples["rate"].gap, before=np.nan)).document()


def test_none_reads_alike_as_an_empty_hypothesis_and_by_name(examples: Examples) -> None:
    """Both forms stand for no effect; the document always has the name."""
    named = replace(
        examples["none"], ranking=(Hypothesis(("none",), 0.94),), same_class=(("none",),)
    )
    assert named.document() == examples["none"].document()
    assert verdict_text(named) == verdict_text(examples["none"])


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"verdict": None}, r"`\$\.verdict`"),
        ({"schema": 2}, r"`\$\.schema`"),
        ({"gap": {}}, "before"),
        ({"verdict": "rate+ageing"}, "alphabetical"),
        ({"verdict": "temperature"}, "effect is given for rate"),
        ({"ranking": [{"effects": ["rate"], "probability": 1.4}]}, r"ranking\[0\]\.probability"),
        ({"ranking": [{"effects": ["rate"], "probability": 0.6}] * 2}, "sum of ranking"),
        ({"where": [{"axis": "time", "share": 0.1, "p": -1.0}]}, r"where\[0\]\.p"),
        ({"remainder": {"significant": True, "where": []}}, r"remainder\.significant"),
        (
            {
                "effect": {
                    "rate": {
                        "parameters": {"rise": 0.1},
                        "interval": {},
                        "correlation": [[1.0, 0.5], [0.5, 1.0]],
                    }
                }
            },  # of two
            r"effect\.rate\.correlation",
        ),
        (
            {"next_experiments": [{"change": {}, "splits": [["a"]], "expected_gain_nats": 1}]},
            r"next_experiments\[0\]\.splits",
        ),
    ],
)
def test_a_document_that_is_no_diagnosis_is_refused_by_its_key(
    change, named: str, examples: Examples, tmp_path: Path
) -> None:
    with pytest.raises(FileError, match=named):
        read(tmp_path, {**examples["rate"].document(), **change})


def test_the_contracts_keys_suffice_and_others_are_ignored(
    examples: Examples, tmp_path: Path
) -> None:
    document = {k: v for k, v in examples["rate"].document().items() if k in CONTRACT}
    document["gap"] = {k: v for k, v in document["gap"].items() if k in CONTRACT_GAP}
    document["where"] = [{"axis": "time", "share": 0.1, "p": 0.5}]
    document["effect"] = {"rate": {"parameters": {"rise": 0.1}, "interval": {}, "colour": "red"}}
    back = read(tmp_path, document | {"weather": "fine"})
    assert back.where[0].share_interval == (-np.inf, np.inf)
    assert (back.effect[0].id, back.effect[0].form) == ("rate", "")


def test_reading_a_file_names_it(tmp_path: Path, examples: Examples) -> None:
    (tmp_path / "diagnosis.json").write_bytes(examples["rate"].json())
    assert read_diagnosis(tmp_path).verdict == read_diagnosis(tmp_path / "diagnosis.json").verdict
    for content, said in (
        (b"{", "not the JSON"),
        (b"[]", "got `array`"),
        (b"\xff", "not the JSON"),
    ):
        (tmp_path / "bad.json").write_bytes(content)
        with pytest.raises(FileError, match=rf"bad\.json.*{said}"):
            read_diagnosis(tmp_path / "bad.json")
    with pytest.raises(FileError, match="cannot be read"):
        read_diagnosis(tmp_path / "none.json")


def test_the_reference_page_has_every_key(
    request: pytest.FixtureRequest, examples: Examples
) -> None:
    """Of the document and of each record in it; ids, names and units are data, not keys."""
    page = request.config.rootpath / "docs" / "reference" / "diagnosis.md"
    explained = page.read_text(encoding="utf-8")
    document = replace(examples["rate"], remainder=examples["rate"].where).document()
    records = [document, document["palette"], document["gap"], document["remainder"]]
    for key in ("ranking", "where", "data_quality", "unit_of", "next_experiments", "detectable"):
        records += document[key]
    records += [*document["effect"].values(), *document["recalibration"].values()]
    keys = {key for record in records for key in record}
    assert {key for key in keys if not re.search(rf"\b{key}\b", explained)} == set()

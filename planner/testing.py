"""What tests of other projects call: golden plans, a check for printer plugins, files' schemas.

>>> from planner.testing import assert_golden
>>> assert_golden("finger-graded", "golden/finger.json")  # doctest: +SKIP
"""

import hashlib
import json
from pathlib import Path
from typing import Any, Literal

import msgspec

from planner.errors import check_known
from planner.formats.files import encode_document, read_file, unpacked
from planner.gap.campaign_folder import CampaignFile
from planner.grading.check import diff
from planner.grading.profile import stiffness_scale
from planner.palette import LAW_PARAMETERS, PaletteFile
from planner.plan import Plan, plan_file
from planner.printers import Printer, ProfileFile, printer_faults

__all__ = ["assert_golden", "assert_same_plan", "check_printer", "file_schema", "golden_record"]


def golden_record(folder: str | Path) -> dict[str, Any]:
    """Return the hashes that stand for a plan's folder.

    STL files and plan.json count by their bytes, the 3MF by its inner XML (deflate differs
    between versions of zlib); plan.json without its list of files, which are here themselves.
    """
    root = plan_file(folder).parent
    record: dict[str, Any] = {"schema": 1, "files": {}}
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.suffix == ".3mf":
            record["files"][name] = threemf_xml_hashes(path)
        elif path.is_file():
            data = path.read_bytes()
            if name == "plan.json":
                document = json.loads(data)
                if encode_document(document) == data:
                    document.pop("files_sha256", None)
                    data = encode_document(document)
            record["files"][name] = hashlib.sha256(data).hexdigest()
    return record


def assert_golden(folder: str | Path, golden: str | Path, *, update: bool = False) -> None:
    """Assert that a plan's folder is, byte for byte, the one a golden file was made from.

    Parameters
    ----------
    folder
        What `Plan.write` or ``planner grade`` wrote.
    golden
        JSON file of `golden_record`; written when `update` is true.

    Raises
    ------
    AssertionError
        With the files that differ.
    """
    record, golden = golden_record(folder), Path(golden)
    if update:
        golden.parent.mkdir(parents=True, exist_ok=True)
        golden.write_bytes(encode_document(record))
    expected = json.loads(golden.read_text(encoding="utf-8"))
    names = {*expected["files"], *record["files"]}
    differ = sorted(n for n in names if expected["files"].get(n) != record["files"].get(n))
    if differ:
        raise AssertionError(f"{folder} differs from {golden} in: {', '.join(differ)}")


def assert_same_plan(
    plan: Plan | str | Path, expected: Plan | str | Path, tolerance: float = 1e-6
) -> None:
    """Assert that two plans mean the same, as ``planner diff`` does.

    Raises
    ------
    AssertionError
        With each difference in words.
    """
    found = diff(expected, plan, tolerance=tolerance)
    if found:
        raise AssertionError("the plans differ:\n" + "\n".join(d.text for d in found))


def check_printer(printer: object) -> None:
    """Assert that an object is a printer planner can plan for; call it in a plugin's tests.

    Raises
    ------
    AssertionError
        With everything that is missing or out of range.
    """
    problems = printer_faults(printer)
    if problems or not isinstance(printer, Printer):
        raise AssertionError("\n".join(problems))
    known = set()
    for name in printer.palettes:
        palette = printer.palette(name)
        known |= {material.id for material in palette.materials}
        if palette.name != name:
            problems.append(f"palette {name!r} calls itself {palette.name!r}")
        stiffness_scale(palette, 0.01)
        for material in palette.materials:
            if not printer.operator_name(material.id):
                problems.append(f"operator_name({material.id!r}) is empty")
    for name in sorted(set(getattr(printer, "operator_names", ())) - known):
        problems.append(f"operator_names has {name!r}, which no palette has")
    if not printer.job_notes().strip():
        problems.append("job_notes() is empty; tell the operator how to print the files")
    if problems:
        raise AssertionError("\n".join(problems))


def file_schema(kind: Literal["printer", "palette", "campaign"]) -> dict[str, Any]:
    """Return the JSON Schema by which an editor checks a file (TOML) that planner reads.

    It is derived from the types that the file's reader converts to. What no schema can say, planner
    checks on reading.

    Parameters
    ----------
    kind
        ``printer``, ``palette`` or ``campaign``.

    Returns
    -------
    dict
        Of draft 7, the newest that editors of TOML follow.

    Raises
    ------
    ArgumentError
        Another kind.

    Examples
    --------
    >>> planner.file_schema("campaign")["$ref"]  # doctest: +SKIP
    '#/$defs/CampaignFile'
    """
    files = {"printer": ProfileFile, "palette": PaletteFile, "campaign": CampaignFile}
    check_known(kind, files, f"`kind` {kind}: {{}}it may be")
    document = msgspec.json.schema(files[kind])
    for part in document["$defs"].values():
        if "law" in part["properties"]:
            part["properties"]["law"] = _law_schema()
        for key in part["properties"].values():
            if key.get("items") is False:  # of equal kinds, as that draft says it
                key["items"] = key.pop("prefixItems")[0]
    if kind == "printer":  # what it need not say is as of the printer that it is like
        whole = document["$defs"]["ProfileFile"]
        whole["if"] = {"not": {"required": ["like"]}}
        whole["then"] = {"required": whole["required"]}
        whole["required"] = ["schema", "name"]
    return {"$schema": "http://json-schema.org/draft-07/schema#", **document}


def _law_schema() -> dict[str, Any]:
    """Return the JSON Schema of a law in a palette file: of each model its parameters."""

    def values(count: int | None) -> dict[str, Any]:
        kind = "array" if count and count > 1 else ["number", "array"]
        most = {} if count is None else {"maxItems": count}
        return {"type": kind, "items": {"type": "number"}, "minItems": count or 1, **most}

    def one(model: str) -> dict[str, Any]:
        known = {name: values(length) for name, length in LAW_PARAMETERS[model].items()}
        given = {"model": {"const": model}, **known}
        takes = {"properties": given, "required": [*known], "additionalProperties": False}
        return {"if": {"properties": {"model": {"const": model}}}, "then": takes}

    return {
        "type": "object",
        "properties": {"model": {"enum": list(LAW_PARAMETERS)}},
        "required": ["model"],
        "allOf": [one(model) for model in LAW_PARAMETERS],
    }


def threemf_xml_hashes(path: str | Path) -> dict[str, str]:
    """Return the SHA-256 of each part of a 3MF file by name, in the archive's order.

    Of content, not deflated bytes: these differ between versions of zlib.

    Raises
    ------
    FileError
        The file is missing or no zip archive.
    """
    members = unpacked(read_file(path), str(path))
    return {member: hashlib.sha256(content).hexdigest() for member, content in members}

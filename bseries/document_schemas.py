"""The published JSON Schema of the documents that `to_dict` and the command write."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

from bseries.exceptions import SeriesError
from bseries_base.errors import shown, suggestion

FILE = "documents.schema.json"
SHARED = "shared-"
"""Prefix of the names of definitions that several kinds use."""


def json_schema(kind: str | None = None) -> dict[str, Any]:
    """The JSON Schema of the documents of a kind, or of all kinds.

    Args:
        kind: The entry ``kind`` of the documents, such as ``series`` or ``check``; ``tableau`` for tableau files,
            ``scene-file`` for scene files and ``verdict`` for verdicts, which have no such entry. By default all kinds.

    Returns:
        A schema of draft 2020-12, with its definitions under ``$defs``. It refuses unknown entries, so that it changes
        with the documents.

    Raises:
        SeriesError: There are no documents of this kind.

    Example:
        >>> import bseries as bs
        >>> bs.json_schema("series")["$ref"]
        '#/$defs/series'
        >>> import jsonschema
        >>> document = bs.series("rk4", 3).to_dict()
        >>> jsonschema.validate(document, bs.json_schema("series"))
        >>> jsonschema.validate({**document, "order": "3"}, bs.json_schema("series"))
        Traceback (most recent call last):
        ...
        jsonschema.exceptions.ValidationError: '3' is not of type 'integer'
        ...

    References:
        https://json-schema.org/draft/2020-12
    """
    schema = json.loads(files("bseries").joinpath(FILE).read_text(encoding="utf-8"))
    if kind is None:
        return schema
    kinds = [name for name in schema["$defs"] if not name.startswith(SHARED)]
    if kind not in kinds:
        near = suggestion(kind, kinds) if isinstance(kind, str) else ""
        raise SeriesError(f"kind must be one of {', '.join(kinds)}, but was {shown(kind)}{near}")
    del schema["oneOf"]
    return {**schema, "$id": f"{schema['$id']}:{kind}", "$ref": f"#/$defs/{kind}"}

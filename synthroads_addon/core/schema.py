"""What every JSON file of the project has in common: strict models, one-line errors, byte-stable writing.

The models are pydantic's, because it names field, value and limit of every fault, makes the JSON Schema from the same
declarations, and its limits, units and descriptions can be read back by the panel. All numbers must be finite.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from .errors import InputError, MissingFileError, nearest_name

VENDOR_PREFIX = "+"
"""Keys that begin with this are a vendor's own: read, kept, written back, never interpreted (CityJSON's habit)."""


def quantity(
    default: Any = ...,
    *,
    unit: str,
    description: str,
    ge: float | None = None,
    gt: float | None = None,
    le: float | None = None,
    lt: float | None = None,
) -> Any:
    """Declare a numeric field with its unit (``m``, ``deg``, ``1``, ...) and limits."""
    return Field(
        default,
        description=description,
        ge=ge,
        gt=gt,
        le=le,
        lt=lt,
        strict=True,
        json_schema_extra={"unit": unit},
    )


def _only_vendor_keys(schema: dict[str, Any]) -> None:
    schema["additionalProperties"] = False
    schema["patternProperties"] = {f"^\\{VENDOR_PREFIX}": {}}


class Model(BaseModel):
    """Base of all parameter classes: immutable, no unknown keys but a vendor's, no NaN; numbers are strict."""

    model_config = ConfigDict(
        extra="allow",
        frozen=True,
        allow_inf_nan=False,
        json_schema_extra=_only_vendor_keys,
    )
    vendor_keys_allowed: ClassVar[bool] = True

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            known = [field.alias or name for name, field in cls.model_fields.items()]
            for key in data:
                if key in known or (cls.vendor_keys_allowed and str(key).startswith(VENDOR_PREFIX)):
                    continue
                raise ValueError(f"unknown key '{key}'{nearest_name(str(key), known)}")
        return data

    @classmethod
    def from_dict(cls: type[T], data: object, source: str = "") -> T:
        """Validate plain JSON data; raise `InputError` naming the first wrong field."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise _input_error(error, data, source) from None
        except (TypeError, ValueError, RecursionError) as error:
            raise InputError(source or cls.__name__, None, f"must be plain JSON data ({error})") from None

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data in the order of the declaration, without fields that are None."""
        return self.model_dump(mode="json", exclude_none=True, by_alias=True)

    def to_json(self) -> str:
        """Return the canonical text: the same set gives the same bytes."""
        return canonical_json(self.to_dict())


T = TypeVar("T", bound=Model)


def canonical_json(data: object) -> str:
    """Serialise with one layout for the whole project: one space of indent, keys as ordered, final newline."""
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def rounded(value: float, digits: int = 9) -> float:
    """Round a sampled value so that its text is short and the same on every machine (-0.0 becomes 0.0)."""
    return round(float(value), digits) + 0.0


def read_json(path: Path | str) -> Any:
    """Read a JSON file; NaN and infinity are refused, as JSON has none.

    Raises:
        MissingFileError: there is no such file, or it can't be read.
        InputError: it isn't JSON; the message names line and column.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise MissingFileError(str(path), None, "no such file") from None
    except UnicodeDecodeError:
        raise InputError(str(path), None, "must be JSON in UTF-8") from None
    except OSError as error:
        raise MissingFileError(str(path), None, f"cannot be read ({os.strerror(error.errno or 0)})") from None
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise InputError(str(path), None, f"must be valid JSON ({error})") from None


def unit_of(field: FieldInfo) -> str:
    """Return the unit declared by `quantity`, or an empty string."""
    extra = field.json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")


def _input_error(error: ValidationError, data: object, source: str) -> InputError:
    """Turn pydantic's first complaint into the project's one line."""
    first = error.errors(include_url=False)[0]
    path = _field_path(first["loc"], data) or "the file"
    message = str(first["msg"]).removeprefix("Value error, ")
    value = None if first["type"] in ("missing", "value_error") else first.get("input")
    field = f"{source}: {path}" if source else path
    return InputError(field, value, message[0].lower() + message[1:])


def _field_path(location: tuple[int | str, ...], data: object) -> str:
    """Return the dotted path of a field; pydantic also names the chosen type of a union, which is left out."""
    parts = []
    for part in location:
        if isinstance(data, dict) and part not in data and data.get("type") == part:
            continue
        parts.append(str(part))
        try:
            data = data[part]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            data = None
    return ".".join(parts)

"""What every scenario model is made of: strict finite numbers, refused unknown keys, units in key names."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Coordinate = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e5, le=1e5)]  # m; float32 keeps 8 mm there
Whole = Annotated[int, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]
Point = tuple[Coordinate, Coordinate]  # (x, z) in the world
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]{0,63}$")]

# Units a key may be written in beside the declared one: ending -> (declared ending, factor).
UNITS: dict[str, tuple[str, float]] = {
    "_cm": ("_m", 0.01),
    "_mm": ("_m", 0.001),
    "_km": ("_m", 1000.0),
    "_rad": ("_deg", 57.29577951308232),
}
_NOT_LENGTH = ("_n_m", "_kg_m", "_n_s_m")  # endings in _m that are no lengths


def declared_key(key: str) -> tuple[str, float] | None:
    """The key in the declared unit and the factor to it ("radius_cm" -> ("radius_m", 0.01)); None without one."""
    for ending, (declared, factor) in UNITS.items():
        if key.endswith(ending):
            return key.removesuffix(ending) + declared, factor
    return None


def spellings(key: str) -> list[str]:
    """Other keys that are accepted for a declared one and converted."""
    if key.endswith(_NOT_LENGTH):
        return []
    return [key.removesuffix(declared) + ending for ending, (declared, _) in UNITS.items() if key.endswith(declared)]


def converted(value: Any, factor: float) -> Any:
    """`value` times `factor`, through lists and mappings; anything else is left for validation to refuse."""
    if isinstance(value, bool):
        return value
    if isinstance(value, int | float):
        return value * factor
    if isinstance(value, list):
        return [converted(item, factor) for item in value]
    if isinstance(value, dict):
        return {key: converted(item, factor) for key, item in value.items()}
    return value


class Model(BaseModel):
    """A mapping of the scenario file."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)

    exactly_one: ClassVar[tuple[str, ...]] = ()  # keys of which exactly one must be given
    at_least_one: ClassVar[tuple[tuple[str, ...], ...]] = ()  # groups of keys, each with one or more given

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        schema = handler(core)
        body = handler.resolve_ref_schema(schema)
        rules: list[dict[str, Any]] = []
        properties = body.get("properties", {})
        for key in list(properties):
            others = [other for other in spellings(key) if other not in properties]
            for other in others:
                properties[other] = {**properties[key], "title": f"{other} (converted to {key})"}
            if others and key in body.get("required", []):
                body["required"].remove(key)
                rules.append({"oneOf": [{"required": [name]} for name in (key, *others)]})
        rules += [{"anyOf": [{"required": [name]} for name in group]} for group in cls.at_least_one]
        if cls.exactly_one:
            names = [name for key in cls.exactly_one for name in (key, *spellings(key))]
            rules.append({"oneOf": [{"required": [name]} for name in names]})
        if rules:
            body["allOf"] = rules
        return schema

"""The ground that parameter classes stand on: frozen, no unknown field, units, one kind of error.

A field with ``Annotated[float, Unit("m3")]`` takes a number in that unit or a text with any unit of
its kind; the docstring below a field says what it means, in templates and in the reference too.
Whatever is wrong with the input becomes one InputError with field, value, unit and remedy, both
from a file (`input_error`) and from a call in Python.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import math
import re
import textwrap
from collections.abc import Collection, Iterable
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, Union, cast, get_args, get_origin

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError, core_schema

from swimbladder.errors import InputError
from swimbladder.units import parse_quantity

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)

_Path = list[str | int]
_Owner = type[BaseModel] | None
# Sizes that no part of a vehicle has: their products would leave the range of floats.
SMALLEST, LARGEST = 1e-20, 1e15


class Unit:
    """The unit of a field: parses texts on the way in, and stands in messages and templates."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Return pydantic's schema: the text is parsed before the bounds are checked."""
        return core_schema.no_info_before_validator_function(self._parse, handler(source))

    def _parse(self, value: object) -> float:
        number = quantity_in(value, self.text)
        if number != 0.0 and not SMALLEST <= abs(number) <= LARGEST:
            remedy = f"Check the unit; sizes from {SMALLEST:g} to {LARGEST:g}, and 0, are taken"
            raise refusal(f"{number:.3g} {self.text}".rstrip() + " is beyond any vehicle", remedy)
        return number


class PistonArea(Unit):
    """The area of a piston in m2, or the diameter that it has: "diameter 60 mm"."""

    def _parse(self, value: object) -> float:
        word, _, across = value.partition("diameter") if isinstance(value, str) else ("-", "", "")
        if word.strip() or not across:
            return super()._parse(value)
        return super()._parse(math.pi / 4.0 * quantity_in(across, "m") ** 2)


class _ParametersMeta(ModelMetaclass):
    """Turns pydantic's report into one InputError where a class is called."""

    def __call__(cls, /, *args: Any, **fields: Any) -> Any:  # noqa: N805
        try:
            return super().__call__(*args, **fields)
        except ValidationError as error:
            raise input_error(error, cast(type[BaseModel], cls)) from None


class Parameters(BaseModel, metaclass=_ParametersMeta):
    """Base of all parameter classes: frozen, no unknown fields, nothing infinite."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True
    )

    def __hash__(self) -> int:
        """Return a hash of its fields, tables by name among them: alike where records are equal."""
        values = vars(self).values()
        return hash(tuple(tuple(sorted(x.items())) if isinstance(x, dict) else x for x in values))

    @model_validator(mode="after")
    def _checked(self) -> Self:
        try:
            self.check()
        except InputError as error:
            raise carried(error) from None
        return self

    def check(self) -> None:
        """Raise a `refusal` where fields do not go together."""


def refusal(what: str, remedy: str, *field: str | int) -> PydanticCustomError:
    """Return what a validator raises: a sentence on what is wrong and one on what to do.

    field: the path, within the model at hand, of the field that is to be named.
    """
    return PydanticCustomError("refused", "{what}", {"what": what, "remedy": remedy, "at": field})


def carried(error: InputError) -> PydanticCustomError:
    """Return what a validator raises for an InputError, its field within the model at hand."""
    return PydanticCustomError("carried", "{what}", {"what": error.what, "error": error})


def quantity_in(value: object, unit: str, remedy: str = "") -> float:
    """Return a number, or a text with a unit, in `unit`; raises a `refusal` where it is none.

    remedy: what to do, where the unit alone does not say it.
    """
    try:
        return parse_quantity(value, unit)
    except InputError as error:
        raise refusal(error.what, remedy or error.remedy or "") from None


def field_unit(model: type[BaseModel], name: str) -> str | None:
    """Return the unit of field `name` of a parameter class, None where it has none."""
    info = model.model_fields[name]
    found = [item for item in info.metadata if isinstance(item, Unit)]
    for argument in (a for one in get_args(info.annotation) for a in (one, *get_args(one))):
        found += [i for i in getattr(argument, "__metadata__", ()) if isinstance(i, Unit)]
    return found[0].text if found else None


@cache
def meanings(model: type[BaseModel]) -> dict[str, str]:
    """Return what the fields of a parameter class mean, as the docstrings below them say."""
    found: dict[str, str] = {}
    (source,) = ast.parse(textwrap.dedent(inspect.getsource(model))).body
    for field, doc in pairwise(source.body if isinstance(source, ast.ClassDef) else ()):
        match field, doc:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(ast.Constant(str(text))):
                found[name] = " ".join(text.split())
    return found


def dotted(path: Iterable[str | int]) -> str:
    """Return a place in a file as text: ``("setpoints", 0, "depth")`` -> ``setpoints[0].depth``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        elif re.fullmatch(r"[A-Za-z0-9_-]+", part):
            text += f".{part}"
        else:
            text += '."' + part.replace('"', '\\"') + '"'
    return text.removeprefix(".")


def did_you_mean(given: str, known: Iterable[str]) -> str:
    """Return "Did you mean ...? " where a known name is near, else an empty text."""
    names = list(known)
    lower = {name.lower(): name for name in names}
    near = [lower[n] for n in difflib.get_close_matches(given.lower(), lower, n=1, cutoff=0.6)]
    return f"Did you mean {near[0]}? " if near else ""


def no_such(what: str, name: str, known: Iterable[str], *, field: str) -> InputError:
    """Return the error for a name that is none of those known."""
    names = list(known)
    remedy = f"{did_you_mean(name, names)}Choose from {', '.join(names)}"
    return InputError(what, field=field, value=name, remedy=remedy)


def check_choice(name: str | None, known: Collection[str], what: str, *, field: str) -> None:
    """Raise InputError, saying `what`, for a name that is none of those known; None: not given."""
    if name is not None and name not in known:
        raise no_such(what, name, known, field=field)


def input_error(error: ValidationError, model: type[BaseModel]) -> InputError:
    """Return pydantic's first complaint as an InputError with field, value, unit and remedy.

    An unknown field comes first: it is the cause where a required one is missing too.
    """
    found = error.errors(include_url=False)
    first = next((item for item in found if item["type"] == "extra_forbidden"), found[0])
    context: dict[str, Any] = dict(first.get("ctx", {}))
    path, annotation, owner = _walk(model, first["loc"])
    value: Any = first["input"]
    if first["type"] == "carried":
        inside: InputError = context["error"]
        return inside.but(field=".".join(filter(None, (dotted(path), inside.field))))
    if first["type"].startswith("union_tag"):
        path, owner, value = [*path, "kind"], None, context.get("tag")
    elif context.get("at"):
        inner, annotation, owner = _walk(annotation, context["at"])
        path = [*path, *inner]
        for part in context["at"]:
            value = _inside(value, part)
    name = str(path[-1]) if path else ""
    unit = field_unit(owner, name) if owner is not None and name in owner.model_fields else None
    what, remedy = _explain(first, path, annotation, owner, unit)
    if first["type"] in ("missing", "extra_forbidden") or isinstance(value, (dict, BaseModel)):
        value = None
    place = dotted(path) or model.__name__
    return InputError(what, field=place, value=value, unit=unit, remedy=remedy)


# What is wrong and what to do, for errors that have one cause.
_SAID = {
    "float_type": ("not a number", "Write a bare number"),
    "too_short": ("an empty list", "Write something between the brackets"),
    "string_type": ("not a text", "Write it in quotes"),
    "string_too_short": ("an empty text", "Write something between the quotes"),
    "bool_type": ("not a yes or no", "Write true or false"),
    "bool_parsing": ("not a yes or no", "Write true or false"),
}


def _explain(
    error: ErrorDetails, path: _Path, annotation: Any, owner: _Owner, unit: str | None
) -> tuple[str, str]:
    """Return what is wrong and what to do, for one of pydantic's kinds of error."""
    kind, message, context = error["type"], str(error["msg"]), error.get("ctx", {})
    name = str(path[-1]) if path else ""
    if kind == "refused":
        return context["what"], context["remedy"]
    if kind == "extra_forbidden":
        known = sorted(owner.model_fields) if owner is not None else []
        return "unknown field", f"{did_you_mean(name, known)}Known here: {', '.join(known)}"
    if kind == "missing":
        return "a required field is missing", _how_to_add(path, annotation, unit)
    if kind.startswith("union_tag"):
        kinds = [tag for member in models_in(annotation) for tag in tags_of(member)]
        tag = str(context.get("tag", ""))
        what = "unknown kind" if kind == "union_tag_invalid" else "a required field is missing"
        return what, f"{did_you_mean(tag, kinds)}Allowed: {', '.join(kinds)}"
    if kind == "literal_error":
        members = (annotation, *get_args(annotation))  # one of them, where it may be left out
        allowed = [str(x) for one in members if get_origin(one) is Literal for x in get_args(one)]
        return "not one of the allowed values", f"Allowed: {', '.join(allowed)}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return "not a table", f"Write [{dotted(path)}] on a line of its own and its fields below it"
    if kind in ("tuple_type", "list_type"):
        if _of_tables(annotation):
            return "not a list of tables", f"Write [[{dotted(path)}]] above the fields of each"
        return "not a list", "Write it in square brackets, with commas between"
    if kind in _SAID:
        return _SAID[kind]
    if "than" in kind:
        return message.replace("Input should", "must"), "Check the number and its unit"
    return message, "See `swimbladder vehicle new --full` for a file with every field explained"


def _how_to_add(path: _Path, annotation: Any, unit: str | None) -> str:
    if models_in(annotation):
        return f"Add a table [{dotted(path)}]"
    if get_origin(annotation) in (tuple, list):
        if _of_tables(annotation):
            return f"Add a table [[{dotted(path)}]] for each"
        return f"Add a line {path[-1]} = [...]"
    if unit is None:
        return f"Add a line {path[-1]} = ..."
    return f"Add a line {path[-1]} = " + (f'"... {unit}"' if unit else "(a bare number)")


def _of_tables(annotation: Any) -> bool:
    return listed_model(annotation) is not None


def _walk(annotation: Any, loc: tuple[str | int, ...]) -> tuple[_Path, Any, _Owner]:
    """Follow pydantic's location: the path in the file, what stands there, the class that has it.

    Pydantic's locations also name the member of a union; no such part stands in the file.
    """
    path: _Path = []
    current: Any = annotation
    owner: _Owner = None
    for part in loc:
        models = models_in(current)
        if len(models) > 1:
            current = next((m for m in models if part in tags_of(m)), current)
        elif models:
            path.append(part)
            owner = models[0]
            info = owner.model_fields.get(str(part))
            current = info.annotation if info is not None else None
        elif get_origin(current) in (dict, tuple, list):
            path.append(part)
            owner = None
            arguments = get_args(current)
            current = arguments[1] if get_origin(current) is dict else arguments[0]
    return path, current, owner


def _inside(value: Any, part: str | int) -> Any:
    """Return what stands at `part` of an input, None where nothing does."""
    try:
        return getattr(value, str(part)) if isinstance(value, BaseModel) else value[part]
    except (LookupError, TypeError):
        return None


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the parameter classes that an annotation allows, without those inside containers."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) is Annotated:
        return models_in(get_args(annotation)[0])
    if get_origin(annotation) is Union or type(annotation).__name__ == "UnionType":
        return [model for argument in get_args(annotation) for model in models_in(argument)]
    return []


def listed_model(annotation: Any) -> type[BaseModel] | None:
    """Return the parameter class that a list of tables holds, None where there is no such list."""
    if get_origin(annotation) is Annotated:
        return listed_model(get_args(annotation)[0])
    if get_origin(annotation) not in (tuple, list):
        return None
    return next((model for argument in get_args(annotation) for model in models_in(argument)), None)


def tags_of(model: type[BaseModel]) -> tuple[str, ...]:
    """Return the values of `kind` that choose a parameter class out of a union."""
    info = model.model_fields.get("kind")
    return () if info is None else get_args(info.annotation)

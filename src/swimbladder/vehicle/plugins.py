"""What other packages add: libraries of an extra, and entry points of a group.

A package says in its `pyproject.toml` what it has, under names that swimbladder then knows::

    [project.entry-points."swimbladder.laws"]
    tanh = "my_package.laws:TANH"

Nothing is imported before it is used. An entry point that cannot be loaded is refused where
it is named, with its package, and is left out where all are listed: it is in nobody else's way.
"""

import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any, Generic, TypeVar

from swimbladder.errors import InputError

Kind = TypeVar("Kind")


def optional(module: str, extra: str, user: str, **place: Any) -> Any:
    """Return a module that is installed by an extra of swimbladder.

    user: what needs it, for the message. place: as `InputError` has it.
    Raises InputError naming the extra where it cannot be imported.
    """
    try:
        return import_module(module)
    except ImportError:
        what = f"{user} needs the library {module.partition('.')[0]}, which is not installed"
        remedy = f'Install it: pip install "swimbladder[{extra}]"'
        raise InputError(what, remedy=remedy, **place) from None


@dataclass(eq=False, repr=False)
class Registry(Mapping[str, Kind], Generic[Kind]):
    """Things of one kind by name: swimbladder's own, then those of other packages.

    Names that cannot be loaded are in it, and raise InputError where they are asked for, but are
    not among those that it counts and goes through; `broken` says why.

    group: of entry points. what: "law", as messages have it. own: swimbladder's, each loaded by a
    call. accept: given what another package has and its name, returns it as it is to be used;
    raises InputError.
    """

    group: str
    what: str
    own: Mapping[str, Callable[[], Kind]]
    accept: Callable[[Any, str], Kind]
    _loaded: dict[Any, Kind] = field(default_factory=dict, init=False)

    def names(self) -> list[str]:
        """Return all names, loaded or not."""
        return [*self.own, *(name for name in self._others() if name not in self.own)]

    def package(self, name: str) -> str | None:
        """Return the package that a name is from; None for one of swimbladder's own."""
        return None if name in self.own else _package(self._others()[name][0])

    def broken(self) -> dict[str, str]:
        """Return why each name that cannot be used cannot be."""
        found = {}
        for name in self.names():
            try:
                self[name]
            except InputError as error:
                found[name] = str(error)
        return found

    def __getitem__(self, name: str) -> Kind:
        points = self._others().get(name, ())
        if points and (name in self.own or len(points) > 1):
            has = ["swimbladder"] if name in self.own else []
            what = (
                f"there are several of the {self.what} {name!r}: of "
                f"{' and '.join([*has, *map(_package, points)])}"
            )
            remedy = f"Uninstall {_package(points[-1])}, or ask its authors for another name"
            raise InputError(what, field=self.group, remedy=remedy)
        if not points:
            return self._load(name, self.own[name])
        return self._load(points[0], lambda: self._from_outside(name, points[0]))

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self._others()

    def __iter__(self) -> Iterator[str]:
        broken = self.broken()
        return (name for name in self.names() if name not in broken)

    def __len__(self) -> int:
        return len(list(iter(self)))

    def _load(self, key: Any, load: Callable[[], Kind]) -> Kind:
        if key not in self._loaded:
            self._loaded[key] = load()
        return self._loaded[key]

    def _others(self) -> Mapping[str, tuple[Any, ...]]:
        return _entry_points(self.group, tuple(sys.path))

    def _from_outside(self, name: str, point: Any) -> Kind:
        package = _package(point)
        try:
            return self.accept(point.load(), name)
        except Exception as error:  # whatever another package does
            why, remedy = f"{type(error).__name__}: {error}", f"Update {package}, or uninstall it"
            if isinstance(error, InputError):
                why, remedy = error.what, f"{error.remedy}; or uninstall {package}"
            what = (
                f"the {self.what} {name!r} of the package {package} cannot be used: "
                f"{' '.join(why.split())}"
            )
            raise InputError(what, field=self.group, value=point.value, remedy=remedy) from None


@cache
def _entry_points(group: str, path: tuple[str, ...]) -> Mapping[str, tuple[Any, ...]]:  # noqa: ARG001
    """Return the entry points of a group by name; path: where Python looks for packages now."""
    from importlib.metadata import entry_points

    found: dict[str, tuple[Any, ...]] = defaultdict(tuple)
    for point in sorted(entry_points(group=group), key=lambda point: (point.name, _package(point))):
        found[point.name] += (point,)
    return dict(found)


def _package(point: Any) -> str:
    """Return the name of the package that has an entry point."""
    return str(point.module.partition(".")[0] if point.dist is None else point.dist.name)

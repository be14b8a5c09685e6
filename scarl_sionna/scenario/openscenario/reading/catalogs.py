"""Entries of catalogs: where a CatalogReference points to, with the parameters that it assigns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from scarl_sionna.core.errors import ScenarioFileError

from .source import Node, parameter_name, read_root

_MOST_FILES = 200
_DEEPEST = 8
"""How deep a reference may lead to a further one."""


class Catalogs:
    """The catalogs in the folders that a scenario names.

    Parameters
    ----------
    root : Node
        ``<OpenSCENARIO>`` with its parameters.
    """

    def __init__(self, root: Node) -> None:
        self._folders: list[Path] = []
        self._loaded: dict[Path, Node | None] = {}
        self._root = root
        holder = root.child("CatalogLocations")
        for kind in [] if holder is None else holder.children():
            directory = kind.need("Directory")
            folder = root.file.parent / directory.text("path")
            if folder.is_dir():
                self._folders.append(folder)
            else:
                directory.note(f"path = '{directory.text('path')[:80]}' is no folder")

    def resolve(self, reference: Node, depth: int = 0) -> Node:
        """Return the element of a ``<CatalogReference>`` with its own parameters and those that are assigned.

        Raises
        ------
        ScenarioError
            If there is no such catalog or entry.
        """
        if depth > _DEEPEST:
            raise reference.error(f"leads through more than {_DEEPEST} references")
        catalog, wanted = reference.text("catalogName"), reference.text("entryName")
        names = []
        for node in self._catalogs(reference, catalog):
            for entry in node.children():
                names.append(entry.name())
                if entry.name() == wanted:
                    return self._assigned(entry, reference)
        if not names:
            raise ScenarioFileError(
                f"no catalog '{catalog}' is in the folders of <CatalogLocations>",
                reference.place,
                "correct the folder or put the catalog there",
                value=catalog,
            )
        raise reference.error(f"catalog '{catalog}' has no entry '{wanted}'", f"it has {', '.join(names[:12])}")

    def _assigned(self, entry: Node, reference: Node) -> Node:
        scope: dict[str, str] = {}
        for holder in entry.children("ParameterDeclarations"):
            for one in holder.children("ParameterDeclaration"):
                inner = replace(one, scope={**reference.scope, **scope})
                scope[parameter_name(one)] = inner.text("value", "")
        for holder in reference.children("ParameterAssignments"):
            for one in holder.children("ParameterAssignment"):
                name = parameter_name(one, "parameterRef")
                if name not in scope:
                    raise one.error(f"'{name}' is no parameter of '{entry.name()}'", f"it has {', '.join(scope)}")
                scope[name] = one.text("value")
        return replace(entry, scope={**reference.scope, **scope}, is_assigned=True)

    def _catalogs(self, reference: Node, name: str) -> list[Node]:
        """Return the catalogs of a name; where none has it, those whose file is called so."""
        found, by_file = [], []
        for path in self.files():
            if path not in self._loaded:
                root = read_root(path, self._root.problems)
                catalog = root.child("Catalog")
                self._loaded[path] = catalog
            node = self._loaded[path]
            if node is not None and node.name() == name:
                found.append(replace(node, scope=reference.scope))
            elif node is not None and path.stem == name:
                by_file.append(replace(node, scope=reference.scope))
        for node in by_file if not found else ():
            node.note(f"is called '{node.name()}', and taken for '{name}' by the name of its file")
        return found or by_file

    def files(self) -> list[Path]:
        """Return the files of all catalogs."""
        files = [path for folder in self._folders for path in sorted(folder.glob("*.xosc"))]
        if len(files) > _MOST_FILES:
            raise self._root.error(f"the folders of <CatalogLocations> hold more than {_MOST_FILES} files")
        return list(dict.fromkeys(files))

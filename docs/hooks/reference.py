"""Write the pages of the API reference while the site is built: one for each folder of the package.

The pages follow the package, so that a module that moves or appears needs no edit here. Nothing of the
package is imported: griffe reads its source.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
PACKAGE = "manipose_mj"
FOLDER = "reference"


def on_config(config: Any) -> Any:
    """Add the pages to the navigation's section "API reference"."""
    for section in config["nav"]:
        if "API reference" in section:
            section["API reference"] = [{"Overview": f"{FOLDER}/index.md"}, *_tree(ROOT / PACKAGE)]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages themselves."""
    folders = _folders(ROOT / PACKAGE)
    pages = {f"{FOLDER}/index.md": _index(folders)}
    pages.update({_page(folder): _text(folder) for folder in folders})
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def _folders(folder: Path) -> list[Path]:
    """Packages in and below a folder that hold modules, the folder itself first."""
    found = [folder] if _modules(folder) else []
    for child in sorted(folder.iterdir()):
        if (child / "__init__.py").is_file():
            found += _folders(child)
    return found


def _tree(folder: Path) -> list[Any]:
    """Entries of the navigation for what lies in a folder."""
    entries: list[Any] = [{folder.name: _page(folder)}] if _modules(folder) else []
    for child in sorted(folder.iterdir()):
        if not (child / "__init__.py").is_file():
            continue
        below = _tree(child)
        entries.append(below[0] if len(below) == 1 else {child.name: below})
    return entries


def _modules(folder: Path) -> list[Path]:
    """Public modules that define something, the package's own `__init__` first."""
    files = [folder / "__init__.py", *sorted(folder.glob("[!_]*.py"))]
    return [file for file in files if ast.parse(file.read_text(encoding="utf-8")).body]


def _dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _page(folder: Path) -> str:
    return f"{FOLDER}/{_dotted(folder)}.md"


def _text(folder: Path) -> str:
    blocks = "\n\n".join(f"::: {_dotted(module)}" for module in _modules(folder))
    return f"# `{_dotted(folder)}`\n\n{blocks}\n"


def _index(folders: list[Path]) -> str:
    """A table of the folders with the first line of what each is for."""
    rows = [
        f"| [`{_dotted(folder)}`]({Path(_page(folder)).name}) | "
        + ", ".join(f"`{module.stem}`" for module in _modules(folder) if module.stem != "__init__")
        + " |"
        for folder in folders
    ]
    return (
        "# API reference\n\nOne page for each folder of the package. Lengths are in metres, angles in radians, "
        "quaternions `wxyz`; see [Frames](../concepts/frames.md).\n\n| package | modules |\n| --- | --- |\n"
        + "\n".join(rows)
        + "\n"
    )

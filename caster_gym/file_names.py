"""Names of files inside YAML files: a relative one starts from the folder of the file that names it.

A field that names a file has the type `FileName`, or `NameOrFile` where it may also name what comes with the package.
`parse` is told the folder of the file that it reads; what Python or the command line give has none, so that relative
names in it start from the working folder, as everywhere.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, ValidationInfo

from caster_gym.bounded_files import expanded

FOLDER = "folder"  # key of the validation context


def beside_its_file(name: str | Path, info: ValidationInfo) -> Path:
    """The file of that name, in the folder of the YAML file that names it if the name is relative."""
    path = expanded(name)
    folder = (info.context or {}).get(FOLDER)
    return path if folder is None else Path(folder).absolute() / path


def is_file_name(name: str) -> bool:
    """Is this the name of a file, and not of something that comes with the package? Files have a suffix."""
    return Path(name).suffix[1:2].isalpha()


def with_files_beside(items: Any, info: ValidationInfo) -> Any:
    """A list of mappings whose 'file', where they have one, starts from the folder of the file that holds the list."""
    if not isinstance(items, list | tuple):
        return items
    return [
        {**one, "file": str(beside_its_file(one["file"], info))}
        if isinstance(one, Mapping) and isinstance(one.get("file"), str | Path)
        else one
        for one in items
    ]


def from_working_folder(value: Any) -> Any:
    """A value of the command line that is to stand in a file's content: its names of files start where they did."""
    if isinstance(value, Mapping):
        return {key: from_working_folder(one) for key, one in value.items()}
    if isinstance(value, list):
        return [from_working_folder(one) for one in value]
    return str(expanded(value).absolute()) if isinstance(value, str) and is_file_name(value) else value


def _file(name: str, info: ValidationInfo) -> str:
    return str(beside_its_file(name, info))


def _name_or_file(name: str, info: ValidationInfo) -> str:
    return _file(name, info) if is_file_name(name) else name


FileName: TypeAlias = Annotated[str, AfterValidator(_file)]
NameOrFile: TypeAlias = Annotated[str, AfterValidator(_name_or_file)]

"""`seqinfo.ini`, which describes a MOTChallenge sequence, however its letters are written."""

from __future__ import annotations

import configparser
from pathlib import Path

from heel.schemas.errors import SourceError

SEQUENCE_FILE = "seqinfo.ini"


def sequence_file(folder: Path) -> Path | None:
    """The file that describes a folder, `SeqInfo.INI` too; None where there is none."""
    usual = folder / SEQUENCE_FILE
    if usual.is_file():
        return usual
    try:
        found = [path for path in folder.iterdir() if path.name.lower() == SEQUENCE_FILE]
    except OSError:
        return None
    return min((path for path in found if path.is_file()), default=None)


def read_sequence_file(file: Path) -> dict[str, str]:
    """What stands under `[Sequence]`; keys in lower case, like `imext`.

    Raises:
        SourceError: the file cannot be read, or has no such section.
    """
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(file.read_text(encoding="utf-8-sig"))
        names = [name for name in parser.sections() if name.lower() == "sequence"]
        return dict(parser[names[0] if names else "Sequence"])
    except (configparser.Error, KeyError, UnicodeDecodeError, OSError) as error:
        reason = " ".join(str(error).split())
        raise SourceError(
            f"{file}: not a MOTChallenge sequence file ({reason}); give imDir, imExt and "
            "frameRate under [Sequence]"
        ) from error

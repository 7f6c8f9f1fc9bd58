"""The one door for files: what may be read, what may be written, and that it appears whole."""

from .inputs import (
    MODEL_BYTES,
    RUNS_BYTES,
    SIMULATION_BYTES,
    InputFile,
    check_input,
    partition_keys,
    partition_name,
    read_whole,
    sha256_of,
)
from .kinds import (
    CERTIFICATE,
    FLEET,
    MODEL,
    PAGE,
    PDF,
    PICTURE,
    REPORT,
    RUNS,
    SENSOR,
    SIMULATION,
    FileKind,
    declare_endings,
    ending_of,
    kind_of_log,
    promised_format,
)
from .named import named_output
from .outputs import check_output, external_output, publish, written_atomically
from .samefile import same_file
from .workplace import remove_leftovers, restore

__all__ = [
    "CERTIFICATE",
    "FLEET",
    "MODEL",
    "MODEL_BYTES",
    "PAGE",
    "PDF",
    "PICTURE",
    "REPORT",
    "RUNS",
    "RUNS_BYTES",
    "SENSOR",
    "SIMULATION",
    "SIMULATION_BYTES",
    "FileKind",
    "InputFile",
    "check_input",
    "check_output",
    "declare_endings",
    "ending_of",
    "external_output",
    "kind_of_log",
    "named_output",
    "partition_keys",
    "partition_name",
    "promised_format",
    "publish",
    "read_whole",
    "remove_leftovers",
    "restore",
    "same_file",
    "sha256_of",
    "written_atomically",
]
